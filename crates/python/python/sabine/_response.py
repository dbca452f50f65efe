"""A traced response."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from . import _plots, _pyfar
from ._parameters import MeasuredParameters, Parameters, measure
from ._readings import Readings


@dataclass(frozen=True, eq=False, repr=False)
class Response:
    """The response between two places of a room, as :meth:`Room.trace` finds it.

    Attributes:
        samples: pressure, float32, shape (samples,); sample 0 is the emission, 1 the direct sound at 1 m, of a directional
            source on its axis.
        sample_rate: samples per second.
        parameters: of the paths, with the standard error that the number of rays leaves. What is read from the samples:
            :meth:`measure`.
        decay_db: energy that is still to come in dB relative to all of it, shape (bands, times).
        decay_times_s: times of ``decay_db`` in seconds after the emission, shape (times,).
        paths: number of paths found.
    """

    samples: np.ndarray
    sample_rate: int
    parameters: Parameters
    decay_db: np.ndarray
    decay_times_s: np.ndarray = field(repr=False)
    paths: int

    @classmethod
    def _of(cls, traced: dict) -> Response:
        step_s, parameters = traced.pop("decay_step_s"), Parameters._of(traced.pop("parameters"))
        times_s = step_s * np.arange(traced["decay_db"].shape[1])
        return cls(parameters=parameters, decay_times_s=times_s, **traced)

    @property
    def t60_s(self) -> Readings:
        """Reverberation time of the paths in seconds: T30 of ISO 3382-1."""
        return self.parameters.t30_s

    def measure(self) -> MeasuredParameters:
        """Parameters read from the samples, as :func:`measure` reads those of a recording."""
        return measure(self.samples, self.sample_rate, bands_hz=self.parameters.bands_hz)

    def to_pyfar(self):
        """The samples as ``pyfar.Signal``.

        Raises:
            ImportError: pyfar is not installed.
        """
        return _pyfar.signal(self.samples, self.sample_rate)

    def plot(self, ax=None):
        """Draws the decay of each band over time; returns the axes (new ones by default)."""
        ax = _plots.new_axes(ax)
        for hz, level_db in zip(self.parameters.bands_hz, self.decay_db):
            ax.plot(self.decay_times_s, level_db, label=f"{hz:g} Hz")
        ax.set(xlabel="Time (s)", ylabel="Energy decay (dB)", ylim=(-65, 1))
        ax.grid(True, alpha=0.3)
        ax.legend()
        return ax

    def __repr__(self) -> str:
        seconds = len(self.samples) / self.sample_rate
        return f"Response({seconds:.2f} s at {self.sample_rate} Hz, {self.paths} paths, t60_s={self.t60_s})"
