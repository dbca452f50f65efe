"""Parameters of ISO 3382-1, of measured responses and of traced paths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, Sequence

from . import _inputs, _sabine
from ._readings import OCTAVES, Reading, Readings
from ._table import Table


@dataclass(frozen=True, eq=False, repr=False)
class Parameters(Table):
    """Parameters of ISO 3382-1 per band, times counted from the arrival of the direct sound.

    Attributes:
        bands_hz: nominal centres in Hz, shape (bands,).
        edt_s, t20_s, t30_s: time for 60 dB in seconds, by the line through 0 to -10, -5 to -25, -5 to -35 dB of the decay.
        c50_db, c80_db: early-to-late energy ratio at 50 and 80 ms, in dB.
        d50: share of the energy within 50 ms, 0 to 1.
        centre_time_s: centre time in seconds.
        drr_db: direct-to-reverberant energy ratio, in dB.
        single_numbers: means over the octaves 500 Hz and 1 kHz, or the six third octaves of these (ISO 3382-1:2009, table A.1):
            ``edt_mid_s``, ``t30_mid_s``, ``c80_mid_db``, ``d50_mid``, ``centre_time_mid_s``; and ``bass_ratio``, T30 at 125 and
            250 Hz over T30 at 500 Hz and 1 kHz (L. Beranek: Concert Halls and Opera Houses, 2004).
    """

    edt_s: Readings
    t20_s: Readings
    t30_s: Readings
    c50_db: Readings
    c80_db: Readings
    d50: Readings
    centre_time_s: Readings
    drr_db: Readings
    single_numbers: Dict[str, Reading]

    def plot(self, ax=None):
        """Draws EDT, T20 and T30 with 95 % intervals over frequency; returns the axes (new ones by default)."""
        names = {"edt_s": "EDT", "t20_s": "T20", "t30_s": "T30"}
        return self._plot(ax, names, "Reverberation time (s)")


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
