"""Speech transmission index."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Sequence

import numpy as np

from . import _inputs, _plots, _sabine

@dataclass(frozen=True, eq=False, repr=False)
class SpeechTransmission:
    """Speech transmission by IEC 60268-16:2020; ``float()`` gives the index.

    It has no standard error: at reverberation times of 0.3 to 4 s the index of one response lies within 0.013 of the mean over
    all responses of its decay (docs/validation/measures.md).

    Attributes:
        value: STI, 0 to 1; NaN where it cannot be read.
        reason: None, or why there is no value.
        qualification: letter of annex F, ``U`` (below 0.36), ``J`` to ``A``, ``A+`` (from 0.76 on); None where there is no value.
        bands_hz: nominal centres of the octaves, 125 Hz to 8 kHz, shape (7,).
        modulation_hz: modulation frequencies, 0.63 to 12.5 Hz, shape (14,).
        transmission_indices: modulation transfer index of each octave, 0 to 1, shape (7,).
        modulation_transfer: what is left of the modulation of speech, 0 to 1, shape (7, 14).
    """

    value: float
    reason: str | None
    qualification: str | None
    bands_hz: np.ndarray
    modulation_hz: np.ndarray
    transmission_indices: np.ndarray
    modulation_transfer: np.ndarray

    @classmethod
    def _of(cls, found: dict) -> SpeechTransmission:
        for name in ("bands_hz", "modulation_hz"):
            found[name] = np.asarray(found[name])
        return cls(**found)

    def __float__(self) -> float:
        return self.value

    def __repr__(self) -> str:
        if self.reason is not None:
            return f"SpeechTransmission(- ({self.reason}))"
        return f"SpeechTransmission({self.value:.3f}, {self.qualification})"

    def plot(self, ax=None):
        """Draws the modulation transfer of each octave over modulation frequency; returns the axes (new ones by default)."""
        ax = _plots.new_axes(ax)
        for hz, transfer in zip(self.bands_hz, self.modulation_transfer):
            ax.plot(self.modulation_hz, transfer, "o-", label=f"{hz:g} Hz")
        ax.set(xscale="log", xlabel="Modulation frequency (Hz)", ylabel="Modulation transfer", ylim=(0, 1))
        ax.set_title(f"STI {self.value:.2f}")
        ax.grid(True, alpha=0.3)
        ax.legend()
        return ax


def speech_transmission(
    response,
    sample_rate: float,
    *,
    snr_db: float | Sequence[float] | np.ndarray | None = None,
    speech_level_db: float | None = None,
    noise_db: float | Sequence[float] | np.ndarray | None = None,
) -> SpeechTransmission:
    """Measures the speech transmission index by the indirect method, for male speech (IEC 60268-16:2020, 6.1 and annex A).

    The noise of the measurement is taken out. Without ``snr_db`` and ``speech_level_db`` the index is that of the room alone: no
    background noise, well above the threshold of hearing.

    Args:
        response: the impulse response, shape (samples,).
        sample_rate: samples per second, 22.5 kHz or more for the octave at 8 kHz.
        snr_db: signal-to-noise ratio of the speech, -200 to 200 dB: one number, or one for each octave from 125 Hz to 8 kHz,
            shape (7,).
        speech_level_db: A-weighted level of the speech at the listener, in dB re 20 uPa (60 is normal speech at 1 m): adds
            auditory masking and the threshold of hearing.
        noise_db: level of the noise in each octave, in dB re 20 uPa, shape (7,); only with ``speech_level_db``.

    Raises:
        ValueError: samples, a sample rate or levels are refused, or levels are given that do not go together.
    """
    samples, sample_rate = _inputs.samples(response, "response"), _inputs.number(sample_rate, "sample_rate")
    disturbance = _disturbance(snr_db, speech_level_db, noise_db)
    return SpeechTransmission._of(_sabine.speech_transmission(samples, sample_rate, disturbance))


def speech_transmission_of(
    modulation_transfer,
    *,
    snr_db: float | Sequence[float] | np.ndarray | None = None,
    speech_level_db: float | None = None,
    noise_db: float | Sequence[float] | np.ndarray | None = None,
) -> SpeechTransmission:
    """The speech transmission index of modulation transfer that was measured or computed elsewhere.

    Args:
        modulation_transfer: for each octave from 125 Hz to 8 kHz what is left of the modulation at 0.63, 0.8, 1, 1.25, 1.6, 2,
            2.5, 3.15, 4, 5, 6.3, 8, 10 and 12.5 Hz, shape (7, 14), 0 to 1; values to 1.3 count as 1 (IEC 60268-16:2020, A.2.4).
        snr_db: as :func:`speech_transmission` has it.
        speech_level_db: the same.
        noise_db: the same.

    Raises:
        ValueError: a value or a level is refused, or levels are given that do not go together.
    """
    transfer = _inputs.table(modulation_transfer, "modulation_transfer", (7, 14)).tolist()
    disturbance = _disturbance(snr_db, speech_level_db, noise_db)
    return SpeechTransmission._of(_sabine.speech_transmission_of(transfer, disturbance))


def _disturbance(snr_db, speech_level_db, noise_db) -> dict:
    if snr_db is not None and speech_level_db is not None:
        raise ValueError("snr_db: give this or speech_level_db, not both")
    if noise_db is not None and speech_level_db is None:
        raise ValueError("noise_db: levels of noise need speech_level_db; or give snr_db")

    def octaves(values, name: str):
        return None if values is None else _inputs.numbers(values, name, (7,)).tolist()

    return {
        "snr_db": octaves(snr_db, "snr_db"),
        "speech_level_db": None if speech_level_db is None else _inputs.number(speech_level_db, "speech_level_db"),
        "noise_db": octaves(noise_db, "noise_db"),
    }
