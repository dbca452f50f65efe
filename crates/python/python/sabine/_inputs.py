"""What users pass in, as the compiled half takes it. Whatever is wrong is a ValueError that names the argument."""

from __future__ import annotations

from typing import Sequence, Union

import numpy as np

#: A position (x, y, z) in metres, or the name of a source or receiver of the room.
Place = Union[str, Sequence[float], np.ndarray]


def samples(values, name: str) -> np.ndarray:
    """One channel as contiguous float32 with full scale 1; 16 and 32 bit integers are divided by 2**15 and 2**31."""
    array = np.asarray(values)
    if array.ndim != 1:
        raise ValueError(f"{name}: shape {array.shape}; expected one channel of shape (samples,)")
    if array.dtype in (np.int16, np.int32):
        array = array / 2.0 ** (8 * array.dtype.itemsize - 1)
    elif array.dtype.kind != "f":
        raise ValueError(f"{name}: dtype {array.dtype}; expected float32, float64, int16 or int32")
    with np.errstate(over="ignore"):  # What is too large becomes infinite, which the library refuses.
        return np.ascontiguousarray(array, dtype=np.float32)


def number(value, name: str) -> float:
    """A number; its range is checked where it is used."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name}: expected a number, found {value!r}") from None


def bands(centres_hz, name: str = "bands_hz") -> list:
    """Centres of bands, in Hz."""
    array = np.asarray(centres_hz)
    if array.ndim != 1 or array.dtype.kind not in "fiu":
        raise ValueError(f"{name}: expected centres in Hz, found {centres_hz!r}")
    return array.astype(float).tolist()


def numbers(values, name: str, shape: tuple) -> np.ndarray:
    """Numbers of this shape; one number stands for all."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: {values!r} are not numbers") from None
    if array.ndim == 0:
        return np.full(shape, float(array))
    if array.shape != shape:
        raise ValueError(f"{name}: shape {array.shape}; expected {shape} or one number")
    return array


def position(values, name: str) -> list:
    """Three coordinates in metres."""
    array = np.asarray(values)
    if array.shape != (3,) or array.dtype.kind not in "fiu":
        raise ValueError(f"{name}: expected 3 coordinates in metres, found {values!r}")
    return array.tolist()


def place(values: Place, name: str) -> Union[str, list]:
    """A name of the room, or a position."""
    return values if isinstance(values, str) else position(values, name)


def count(value, name: str) -> int:
    """A whole number that is not negative."""
    if not isinstance(value, (int, np.integer)) or not 0 <= value < 2**64:
        raise ValueError(f"{name}: expected a whole number from 0 on, found {value!r}")
    return int(value)
