"""Parameters of ISO 3382-1, of measured responses and of traced paths."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Sequence

import numpy as np

from . import _inputs, _sabine
from ._readings import OCTAVES, Readings


@dataclass(frozen=True, eq=False)
class Parameters:
    """Parameters of ISO 3382-1 per band, times counted from the arrival of the direct sound.

    Attributes:
        bands_hz: nominal centres in Hz, shape (bands,).
        edt_s, t20_s, t30_s: time for 60 dB in seconds, by the line through 0 to -10, -5 to -25, -5 to -35 dB of the decay.
        c50_db, c80_db: early-to-late energy ratio at 50 and 80 ms, in dB.
        d50: share of the energy within 50 ms, 0 to 1.
        centre_time_s: centre time in seconds.
        drr_db: direct-to-reverberant energy ratio, in dB.
    """

    bands_hz: np.ndarray
    edt_s: Readings
    t20_s: Readings
    t30_s: Readings
    c50_db: Readings
    c80_db: Readings
    d50: Readings
    centre_time_s: Readings
    drr_db: Readings

    @classmethod
    def _of(cls, found: dict):
        bands_hz = np.asarray(found["bands_hz"])
        given = {"bands_hz": bands_hz, "onset_s": found.get("onset_s")}
        names = (field.name for field in fields(cls))
        return cls(**{n: given[n] if n in given else Readings._of(bands_hz, found[n]) for n in names})

    def __repr__(self) -> str:
        """A table; below it why numbers are missing."""
        quantities = [(f.name, getattr(self, f.name)) for f in fields(self)]
        quantities = [(name, value) for name, value in quantities if isinstance(value, Readings)]
        head = f"{type(self).__name__:<20}" + "".join(f"{hz:>9g}" for hz in self.bands_hz) + " Hz"
        rows = [
            f"{name:<20}" + "".join(f"{'-' if np.isnan(v) else format(v, '.3f'):>9}" for v in readings)
            for name, readings in quantities
        ]
        places = {}
        for name, readings in quantities:
            for hz, why in readings.missing.items():
                places.setdefault(why, []).append(f"{name} {hz:g}")
        reasons = [f"- {why}: {', '.join(where)}" for why, where in places.items()]
        return "\n".join([head, *rows, *reasons])

    def plot(self, ax=None):
        """Draws EDT, T20 and T30 with 95 % intervals over frequency; returns the axes (new ones by default)."""
        for name in ("edt_s", "t20_s", "t30_s"):
            ax = getattr(self, name).plot(ax, label=name[:-2].upper())
        ax.set_ylabel("Reverberation time (s)")
        ax.legend()
        return ax


@dataclass(frozen=True, eq=False, repr=False)
class MeasuredParameters(Parameters):
    """What :func:`measure` reads from a response.

    Attributes:
        t60_s: time for 60 dB in seconds, -5 to -35 dB of a decay plus noise that is fitted to the response: less uncertain than T30.
        eq_db: mean power density in dB relative to the octave at 1 kHz, which is 0.
        onset_s: arrival of the direct sound in seconds after the first sample; None where there is none.
    """

    t60_s: Readings
    eq_db: Readings
    onset_s: float | None


def measure(response, sample_rate: float, *, bands_hz: Sequence[float] = OCTAVES) -> MeasuredParameters:
    """Measures an impulse response: parameters of ISO 3382-1 per band.

    Args:
        response: the impulse response, shape (samples,); float32, float64, int16 or int32.
        sample_rate: samples per second, 1 kHz to 768 kHz.
        bands_hz: nominal centres of octaves or third octaves without a gap: ``OCTAVES``, ``THIRD_OCTAVES`` or a part of them.

    Returns:
        Values, standard errors, and NaN with a reason where a value cannot be read: noise too near, band above half the sample rate.

    Raises:
        ValueError: the response is empty, of another shape or type or not finite; a sample rate or bands out of range.
    """
    samples, sample_rate = _inputs.samples(response, "response"), _inputs.number(sample_rate, "sample_rate")
    return MeasuredParameters._of(_sabine.measure(samples, sample_rate, _inputs.bands(bands_hz)))
