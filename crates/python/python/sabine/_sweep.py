"""Exponential sweeps, and impulse responses from their recordings."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Tuple

import numpy as np

from . import _inputs, _plots, _pyfar, _sabine


@dataclass(frozen=True)
class Sweep:
    """An exponential sine sweep x(t) = a sin(2 pi f1 L (exp(t / L) - 1)) with L = T / ln(f2 / f1) (ISO 18233:2006, annex B).

    Play :meth:`playback` in the room, record it, and give the recording to :meth:`deconvolve`:

        >>> sweep = sabine.Sweep(duration_s=5, silence_s=2, repetitions=3)
        >>> found = sweep.deconvolve(recording, 48_000)
        >>> sabine.measure(found.responses[0], found.sample_rate)

    Attributes:
        sample_rate: samples per second, 1 kHz to 768 kHz.
        from_hz: first frequency, 1 Hz to a quarter of the sample rate.
        to_hz: last frequency, at least twice the first, at most half the sample rate.
        duration_s: length of a sweep, 0.1 to 600 s. Twice the length gives 3 dB more range.
        silence_s: silence after each sweep, 0 to 600 s: longer than the reverberation time, or the response is cut.
        repetitions: how often it is played, 1 to 100. Twice as often gives 3 dB more range; three or more tell which one differs.
        peak: largest amplitude, 0.001 to 1 (full scale).
        fade_in_s: half-cosine fade at the beginning; by default a hundredth of the sweep, 0.1 s at most.
        fade_out_s: half-cosine fade at the end; by default 0.002 of the sweep, 0.02 s at most. Both together last at most half of it.

    Raises:
        ValueError: a setting is out of range; the message names it.
    """

    sample_rate: int = 48_000
    from_hz: float = 20.0
    to_hz: float = 20_000.0
    duration_s: float = 10.0
    silence_s: float = 3.0
    repetitions: int = 1
    peak: float = 0.5
    fade_in_s: float | None = None
    fade_out_s: float | None = None
    _handle: _sabine.Sweep = field(init=False, repr=False, compare=False)

    def __post_init__(self):
        names = ("sample_rate", "from_hz", "to_hz", "duration_s", "silence_s", "peak")
        settings = {name: _inputs.number(getattr(self, name), name) for name in names}
        for name, share, longest_s in (("fade_in_s", 0.01, 0.1), ("fade_out_s", 0.002, 0.02)):
            given = getattr(self, name)
            fade_s = min(share * settings["duration_s"], longest_s) if given is None else _inputs.number(given, name)
            settings[name] = fade_s
        settings["repetitions"] = _inputs.count(self.repetitions, "repetitions")
        object.__setattr__(self, "_handle", _sabine.Sweep(settings))

    @property
    def samples(self) -> np.ndarray:
        """One sweep without silence, float32, shape (samples,)."""
        return self._handle.samples()

    def playback(self) -> np.ndarray:
        """What is played: every repetition with the silence after it, float32, shape (samples,)."""
        return self._handle.playback()

    def deconvolve(
        self,
        recording,
        sample_rate: float,
        *,
        leave_out_differing: bool = False,
        allow_clock_drift: bool = False,
    ) -> SweepMeasurement:
        """Makes impulse responses of a recording of this sweep, one for each channel (ISO 18233:2006).

        Recording over sweep: a chain that passes the sweep as it is gives a pulse of 1. Harmonic distortion is cut off. The response is
        flat from 1.12 times the first frequency to the last one over 1.12. Repetitions are compared and averaged; of several channels
        the loudest decides about sweep, clock and repetitions.

        Args:
            recording: shape (samples,) or (channels, samples), begun before the sweep.
            sample_rate: samples per second, that of the sweep.
            leave_out_differing: leaves repetitions out that are not like the others, where at least two stay.
            allow_clock_drift: takes the response as it is where the clocks of playback and recording differ.

        Raises:
            ValueError: the recording is silent, clipped, too short, begun too late, of another sweep, sample rate or clock, its
                repetitions differ, or it is not finite or of another shape or type.
        """
        channels, sample_rate = _inputs.channels(recording, "recording"), _inputs.number(sample_rate, "sample_rate")
        _inputs.same_length(channels, [f"recording[{number}]" for number in range(len(channels))])
        found = self._handle.deconvolve(channels, sample_rate, bool(leave_out_differing), bool(allow_clock_drift))
        return SweepMeasurement(**{**found, "left_out": tuple(found["left_out"])})


@dataclass(frozen=True, eq=False, repr=False)
class SweepMeasurement:
    """What :meth:`Sweep.deconvolve` makes of a recording.

    Attributes:
        responses: impulse responses, float32, shape (channels, samples), all on one time axis.
        sample_rate: samples per second.
        start_s: what is added to times in the responses to count from the emission, where playback and recording started together,
            in seconds; the latency is in it. The responses begin 50 ms before the onset.
        differences_db: difference of each repetition from the one most like it, in dB re the energy of the response, shape
            (repetitions,); empty for a single sweep.
        left_out: repetitions that were left out, from 0.
        clock_drift_ppm: by how much the recording is longer than the playback, in parts per million; None for a single sweep.
    """

    responses: np.ndarray
    sample_rate: int
    start_s: float
    differences_db: np.ndarray
    left_out: Tuple[int, ...]
    clock_drift_ppm: float | None

    def to_pyfar(self):
        """The responses as ``pyfar.Signal`` of as many channels.

        Raises:
            ImportError: pyfar is not installed.
        """
        return _pyfar.signal(self.responses, self.sample_rate)

    def plot(self, ax=None):
        """Draws the level of each response in dB re its peak over time; returns the axes (new ones by default)."""
        ax = _plots.new_axes(ax)
        times_s = np.arange(self.responses.shape[1]) / self.sample_rate
        for number, response in enumerate(self.responses):
            magnitude = np.abs(response)
            level_db = 20 * np.log10(np.maximum(magnitude / magnitude.max(), 1e-6))
            ax.plot(times_s, level_db, label=f"channel {number}", linewidth=0.5)
        ax.set(xlabel="Time (s)", ylabel="Level (dB re peak)", ylim=(-100, 3))
        ax.grid(True, alpha=0.3)
        ax.legend()
        return ax

    def __repr__(self) -> str:
        channels, samples = self.responses.shape
        left_out = f", left out {list(self.left_out)}" if self.left_out else ""
        return f"SweepMeasurement({channels} channels, {samples / self.sample_rate:.2f} s at {self.sample_rate} Hz{left_out})"
