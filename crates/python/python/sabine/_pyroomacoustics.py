"""A room of pyroomacoustics in the words of ``sabine.ShoeBox``. pyroomacoustics itself is not imported."""

from __future__ import annotations

from typing import Sequence

import numpy as np

#: Names of the faces of a box there, in the order of those here.
_WALLS = ("west", "east", "south", "north", "floor", "ceiling")
#: A humidity below this is none that was stated: it is 0 or 0.3 there by default ...
_LEAST_HUMIDITY_PERCENT = 1.0
#: ... and air absorbs then as a table for 30 to 50 % says.
_HUMIDITY_PERCENT = 40.0


def shoebox(room, bands_hz: Sequence[float], faces: Sequence[str]) -> dict:
    """Arguments of ``sabine.ShoeBox``.

    Raises:
        ValueError: the room is no box in three dimensions.
    """
    walls = {wall.name: wall for wall in getattr(room, "walls", ())}
    if getattr(room, "dim", None) != 3 or not hasattr(room, "shoebox_dim") or not set(_WALLS) <= set(walls):
        raise ValueError(
            f"room: expected a pyroomacoustics.ShoeBox in three dimensions, found {type(room).__name__}; "
            "other rooms: write the mesh as OBJ into a room folder, and use Room.read"
        )
    centres_hz = room.octave_bands.centers
    nearest = [int(np.argmin(np.abs(np.log(centres_hz / hz)))) for hz in bands_hz]

    def on_bands(values) -> np.ndarray:
        """Rounded, for they are float32 there: 0.1 would become 0.10000000149."""
        values = np.atleast_1d(values).astype(float).round(6)
        return values[nearest] if len(values) > 1 else np.full(len(bands_hz), values[0])

    humidity_percent = float(room.physics.H)
    microphones = room.mic_array.R.T if room.mic_array is not None else ()
    return {
        "size_m": np.asarray(room.shoebox_dim, dtype=float),
        "absorption": {face: on_bands(walls[wall].absorption) for face, wall in zip(faces, _WALLS)},
        "scattering": {face: on_bands(walls[wall].scatter) for face, wall in zip(faces, _WALLS)},
        "bands_hz": bands_hz,
        "sources": {f"s{i + 1}": np.asarray(source.position) for i, source in enumerate(room.sources)},
        "receivers": {f"r{i + 1}": np.asarray(position) for i, position in enumerate(microphones)},
        "temperature_c": float(room.physics.T),
        "humidity_percent": (
            humidity_percent if humidity_percent >= _LEAST_HUMIDITY_PERCENT else _HUMIDITY_PERCENT
        ),
    }
