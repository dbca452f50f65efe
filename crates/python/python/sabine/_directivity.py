"""How sources radiate and microphones hear in different directions."""

from __future__ import annotations

from typing import Sequence, Union

import numpy as np

from . import _inputs, _plots, _sabine

#: Names of patterns of first order.
PATTERNS = ("omni", "subcardioid", "cardioid", "supercardioid", "hypercardioid", "figure_of_eight")


class Directivity:
    """Energy gain over direction and band, relative to the acoustic axis, where it is 1; without phase.

    A directional source is compared with the omnidirectional one that is as loud on its axis: the direct sound on the axis keeps its
    level, and reverberation falls by the directivity index. Bands that it lacks take the nearest one's pattern.

    Args:
        name: a pattern of first order: ``omni``, ``subcardioid``, ``cardioid``, ``supercardioid``, ``hypercardioid`` or
            ``figure_of_eight``. Others are made by :meth:`first_order`, :meth:`axisymmetric` and :meth:`table`.

    Raises:
        ValueError: there is no pattern of that name.
    """

    def __init__(self, name: str):
        if not isinstance(name, str):
            raise ValueError(f"name: expected that of a pattern, found {name!r}")
        self._handle = _sabine.Directivity.named(name)

    @classmethod
    def _of(cls, handle: _sabine.Directivity) -> Directivity:
        made = cls.__new__(cls)
        made._handle = handle
        return made

    @staticmethod
    def first_order(
        omni_share: float | Sequence[float] | np.ndarray, *, bands_hz: Sequence[float] | None = None
    ) -> Directivity:
        """Pressure a + (1 - a) cos(angle to the axis).

        Args:
            omni_share: a, 0 to 1: one number, or with ``bands_hz`` one for each band, shape (bands,).
            bands_hz: nominal centres of the bands; None for the same in all.

        Raises:
            ValueError: a share outside 0 to 1, or bands are refused.
        """
        hz = None if bands_hz is None else _inputs.bands(bands_hz)
        shares = _inputs.numbers(omni_share, "omni_share", (1 if hz is None else len(hz),)).tolist()
        return Directivity._of(_sabine.Directivity.first_order(shares, hz))

    @staticmethod
    def axisymmetric(angles_deg, levels_db, bands_hz: Sequence[float]) -> Directivity:
        """A pattern that depends on the angle to the axis only. Between angles the magnitude of the pressure goes along a line.

        Args:
            angles_deg: angles that rise from 0 to 180 degrees, shape (angles,).
            levels_db: levels in dB, to 300, shape (bands, angles); -inf is a null. Their common reference does not matter.
            bands_hz: nominal centres of the bands.

        Raises:
            ValueError: angles, levels or bands are refused, or the axis is silent.
        """
        angles, hz = _inputs.table(angles_deg, "angles_deg", (None,)), _inputs.bands(bands_hz)
        levels = _inputs.table(levels_db, "levels_db", (len(hz), len(angles))).tolist()
        return Directivity._of(_sabine.Directivity.axisymmetric(angles.tolist(), levels, hz))

    @staticmethod
    def table(levels_db, bands_hz: Sequence[float]) -> Directivity:
        """A pattern on a regular grid. Between nodes the magnitude of the pressure goes bilinearly over the angles.

        Args:
            levels_db: levels in dB, to 300, shape (bands, elevations, azimuths): elevations from -90 to 90 degrees, both
                included; azimuths from 0 (forward) to the left, 360 / azimuths degrees apart; -inf is a null. Their common
                reference does not matter. At least three of each.
            bands_hz: nominal centres of the bands.

        Raises:
            ValueError: levels or bands are refused, or the axis is silent.
        """
        hz = _inputs.bands(bands_hz)
        levels = _inputs.table(levels_db, "levels_db", (len(hz), None, None))
        _, elevations, azimuths = levels.shape
        flat = levels.reshape(len(hz), -1).tolist()
        return Directivity._of(_sabine.Directivity.table(azimuths, elevations, flat, hz))

    @property
    def bands_hz(self) -> np.ndarray | None:
        """Nominal centres of its bands in Hz, shape (bands,); None where it is the same in all."""
        hz = self._handle.bands_hz
        return None if hz is None else np.asarray(hz)

    @property
    def index_db(self) -> np.ndarray:
        """Directivity index of each band: energy on the axis over its mean over all directions, in dB, shape (bands,) or (1,)."""
        return np.asarray(self._handle.index_db())

    def gain_db(self, directions) -> np.ndarray:
        """Level in some directions relative to the axis.

        Args:
            directions: components (forward, left, up) of any length but 0, shape (directions, 3).

        Returns:
            Levels in dB, shape (directions, bands) or (directions, 1); -inf in a null.

        Raises:
            ValueError: a direction is zero or not finite, or the shape is another.
        """
        directions = _inputs.table(directions, "directions", (None, 3))
        lengths = np.linalg.norm(directions, axis=1, keepdims=True)
        if not (np.all(np.isfinite(lengths)) and np.all(lengths > 0)):
            raise ValueError("directions: each must be finite and not zero")
        with np.errstate(divide="ignore"):
            return 10 * np.log10(self._handle.energy_gains((directions / lengths).tolist()))

    def plot(self, ax=None):
        """Draws the level of each band in the horizontal plane in polar form, from 0 to -30 dB; returns the axes.

        Args:
            ax: polar axes of matplotlib; new ones by default.
        """
        ax = _plots.new_axes(ax, polar=True)
        angles = np.radians(np.arange(361))
        levels_db = self.gain_db(np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1))
        labels = ["all bands"] if self.bands_hz is None else [f"{hz:g} Hz" for hz in self.bands_hz]
        for label, level_db in zip(labels, levels_db.T):
            ax.plot(angles, np.maximum(level_db, -30), label=label)
        ax.set_rlim(-30, max(0.0, float(levels_db.max())))
        ax.set_theta_zero_location("N")
        ax.legend()
        return ax

    def __repr__(self) -> str:
        hz = self.bands_hz
        bands = "all bands" if hz is None else f"{hz[0]:g} to {hz[-1]:g} Hz"
        index = ", ".join(f"{value:.1f}" for value in self.index_db)
        return f"Directivity({bands}, index {index} dB)"


#: A pattern, or the name of one of first order.
Pattern = Union[str, Directivity]


def handle_of(directivity: Pattern | None, name: str) -> _sabine.Directivity | None:
    """The compiled half of a pattern; None stays."""
    if directivity is None:
        return None
    if not isinstance(directivity, Directivity) and directivity not in PATTERNS:
        raise ValueError(f"{name}: expected a Directivity or one of {', '.join(PATTERNS)}, found {directivity!r}")
    return (Directivity(directivity) if isinstance(directivity, str) else directivity)._handle
