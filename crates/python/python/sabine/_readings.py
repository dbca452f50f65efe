"""Numbers per band, each with its uncertainty or the reason why there is none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, Sequence, Tuple

import numpy as np

from . import _plots, _sabine

#: Nominal centres of octaves, 62.5 Hz to 8 kHz: what is measured unless something else is asked for.
OCTAVES = (62.5, 125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0)
#: Nominal centres of third octaves, 50 Hz to 10 kHz.
THIRD_OCTAVES = (
    *(50.0, 62.5, 80.0, 100.0, 125.0, 160.0, 200.0, 250.0, 315.0, 400.0, 500.0, 630.0),
    *(800.0, 1000.0, 1250.0, 1600.0, 2000.0, 2500.0, 3150.0, 4000.0, 5000.0, 6300.0, 8000.0, 10000.0),
)


@dataclass(frozen=True, repr=False)
class Reading:
    """A single number; ``float()`` gives its value.

    Attributes:
        value: the value; NaN where there is none.
        standard_error: one standard error, in the same unit; NaN where there is no value.
        reason: None, or why there is no value.
    """

    value: float
    standard_error: float
    reason: str | None

    def __float__(self) -> float:
        return self.value

    def __repr__(self) -> str:
        return f"{self.value:.3g} ± {self.standard_error:.2g}" if self.reason is None else f"- ({self.reason})"


@dataclass(frozen=True, eq=False)
class Readings:
    """A quantity in each band.

    It is used as the array of its values: ``np.nanmean(t30)``, ``t30[2]``, ``len(t30)``.

    Attributes:
        bands_hz: nominal centres in Hz, shape (bands,).
        value: the values, NaN where there is none, shape (bands,).
        standard_error: one standard error, in the same unit, shape (bands,); 0 for what is exact.
        reason: for each band None, or why there is no value.
    """

    bands_hz: np.ndarray
    value: np.ndarray
    standard_error: np.ndarray
    reason: Tuple[str | None, ...]

    @classmethod
    def _of(cls, bands_hz, columns: dict) -> Readings:
        reason = tuple(columns["reason"])
        return cls(np.asarray(bands_hz), columns["value"], columns["standard_error"], reason)

    def at(self, centre_hz: float) -> float:
        """The value in the band of this nominal centre.

        Raises:
            ValueError: there is no such band.
        """
        found = np.flatnonzero(np.isclose(self.bands_hz, centre_hz))
        if not found.size:
            bands = ", ".join(f"{hz:g}" for hz in self.bands_hz)
            raise ValueError(f"centre_hz: there is no band at {centre_hz} Hz; there are {bands}")
        return float(self.value[found[0]])

    def interval(self, quantile: float = 1.96) -> Tuple[np.ndarray, np.ndarray]:
        """Lower and upper ends of the central interval at a normal quantile (1.96 for 95 %)."""
        return self.value - quantile * self.standard_error, self.value + quantile * self.standard_error

    @property
    def missing(self) -> Dict[float, str]:
        """Bands without a value, in Hz, and why."""
        return {float(hz): why for hz, why in zip(self.bands_hz, self.reason) if why is not None}

    def __array__(self, dtype=None, copy=None):
        return np.array(self.value, dtype=dtype)

    def __len__(self) -> int:
        return len(self.value)

    def __getitem__(self, index):
        return self.value[index]

    def __repr__(self) -> str:
        cells = (
            f"{hz:g} Hz: -" if np.isnan(value) else f"{hz:g} Hz: {value:.3g} ± {error:.2g}"
            for hz, value, error in zip(self.bands_hz, self.value, self.standard_error)
        )
        return f"Readings({', '.join(cells)})"

    def plot(self, ax=None, label: str | None = None):
        """Draws values and 95 % intervals over frequency.

        Args:
            ax: matplotlib axes; new ones by default.
            label: name in the legend.

        Returns:
            The axes.
        """
        ax = _plots.new_axes(ax)
        ax.errorbar(self.bands_hz, self.value, 1.96 * self.standard_error, fmt="o-", capsize=3, label=label)
        _plots.band_axis(ax, self.bands_hz)
        return ax


@dataclass(frozen=True, eq=False)
class SpatialMean:
    """What :func:`spatial_mean` finds.

    Attributes:
        mean: the mean in each band; its standard error is the standard deviation over the root of the number of positions, for
            a single position that position's own.
        positions: number of positions that have a value, shape (bands,).
    """

    mean: Readings
    positions: np.ndarray


def spatial_mean(positions: Sequence[Readings]) -> SpatialMean:
    """Mean of one quantity over positions in a room, band by band (ISO 3382-2:2008, clause 8: arithmetic mean of the times).

    Args:
        positions: readings of each position, all in the same bands: ``[sabine.measure(r, rate).t30_s for r in responses]``.
            Positions without a value do not count in that band; where none has one, the reason is the first position's.

    Raises:
        ValueError: there are no positions, or their bands differ.
    """
    positions = list(positions)
    if not positions:
        raise ValueError("positions: there are none")
    for number, readings in enumerate(positions):
        if not isinstance(readings, Readings):
            raise ValueError(f"positions[{number}]: expected Readings, found {readings!r}")
        if not np.array_equal(readings.bands_hz, positions[0].bands_hz):
            raise ValueError(f"positions[{number}]: its bands are not those of positions[0]")
    first = positions[0]
    found = _sabine.spatial_mean(
        first.bands_hz.tolist(), [(r.value.tolist(), r.standard_error.tolist()) for r in positions]
    )
    columns = found["mean"]
    known = ~np.isnan(columns["value"])
    reason = tuple(None if is_known else why for is_known, why in zip(known, first.reason))
    mean = Readings(first.bands_hz, columns["value"], columns["standard_error"], reason)
    return SpatialMean(mean, np.asarray(found["positions"]))
