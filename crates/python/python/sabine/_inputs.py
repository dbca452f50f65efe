"""What users pass in, as the compiled half takes it. Whatever is wrong is a ValueError that names the argument."""

from __future__ import annotations

import os
from typing import List, Sequence, Union

import numpy as np

from . import _sabine

#: A position (x, y, z) in metres, or the name of a source or receiver of the room.
Place = Union[str, Sequence[float], np.ndarray]
#: The path of a TOML file, or its text: a string that has a line break.
Document = Union[str, "os.PathLike[str]"]


def samples(values, name: str) -> np.ndarray:
    """One channel as contiguous float32 with full scale 1; 16 and 32 bit integers are divided by 2**15 and 2**31."""
    array = _array(values, name)
    if array.ndim != 1:
        raise ValueError(f"{name}: shape {array.shape}; expected one channel of shape (samples,)")
    if array.dtype in (np.int16, np.int32):
        array = array / 2.0 ** (8 * array.dtype.itemsize - 1)
    elif array.dtype.kind != "f":
        raise ValueError(f"{name}: dtype {array.dtype}; expected float32, float64, int16 or int32")
    with np.errstate(over="ignore"):  # What is too large becomes infinite, which the library refuses.
        return np.ascontiguousarray(array, dtype=np.float32)


def _array(values, name: str) -> np.ndarray:
    try:
        return np.asarray(values)
    except ValueError:
        raise ValueError(f"{name}: its rows differ in length") from None


#: Channels that one recording can have.
MAX_CHANNELS = 64


def channels(values, name: str) -> List[np.ndarray]:
    """A single channel, a list of them, or an array of shape (channels, samples)."""
    is_list_of_arrays = isinstance(values, (list, tuple)) and all(isinstance(one, np.ndarray) for one in values)
    if is_list_of_arrays:
        rows = list(values)
    else:
        array = _array(values, name)
        if array.ndim not in (1, 2):
            raise ValueError(f"{name}: shape {array.shape}; expected (samples,) or (channels, samples)")
        rows = list(np.atleast_2d(array))
    if not 1 <= len(rows) <= MAX_CHANNELS:
        raise ValueError(f"{name}: {len(rows)} channels; expected 1 to {MAX_CHANNELS}, in shape (channels, samples)")
    return [samples(row, name if len(rows) == 1 else f"{name}[{number}]") for number, row in enumerate(rows)]


def same_length(channels: Sequence[np.ndarray], names: Sequence[str]) -> None:
    """That channels of one measurement are as long as the first."""
    for channel, name in zip(channels, names):
        if len(channel) != len(channels[0]):
            raise ValueError(f"{name}: {len(channel)} samples; {names[0]} has {len(channels[0])}")


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


def table(values, name: str, shape: tuple) -> np.ndarray:
    """Numbers of this shape; None stands for any length."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: {values!r} are not numbers in rows of one length") from None
    if array.ndim != len(shape) or any(s not in (None, n) for s, n in zip(shape, array.shape)):
        expected = ", ".join("any" if s is None else str(s) for s in shape)
        raise ValueError(f"{name}: shape {array.shape}; expected ({expected})")
    return array


def position(values, name: str) -> list:
    """Three coordinates in metres."""
    return _triple(values, name, "3 coordinates in metres")


def place(values: Place, name: str) -> Union[str, list]:
    """A name of the room, or a position."""
    return values if isinstance(values, str) else position(values, name)


def axis(values, name: str) -> Union[list, None]:
    """The components of a direction, of any length; None stays."""
    return None if values is None else _triple(values, name, "the 3 components of a direction")


def _triple(values, name: str, expected: str) -> list:
    array = _array(values, name)
    if array.shape != (3,) or array.dtype.kind not in "fiu":
        raise ValueError(f"{name}: expected {expected}, found {values!r}")
    return array.tolist()


def document(values: Document, name: str, kind):
    """What ``kind`` reads of a path, or of text: a string that has a line break."""
    if isinstance(values, str) and "\n" in values:
        return kind.parse(values)
    if isinstance(values, (str, os.PathLike)):
        return kind.read(values)
    raise ValueError(f"{name}: expected a path or the text of a TOML file, found {values!r}")


def model(values):
    """An extended model: a document, or a diagnosis, which has one; None stays."""
    if values is None:
        return None
    return document(getattr(values, "extended_model", values), "model", _sabine.ExtendedModel)


def laws(values: Document | None):
    """Laws of a document; None stays."""
    return None if values is None else document(values, "laws", _sabine.Laws)


def count(value, name: str) -> int:
    """A whole number that is not negative."""
    if not isinstance(value, (int, np.integer)) or not 0 <= value < 2**64:
        raise ValueError(f"{name}: expected a whole number from 0 on, found {value!r}")
    return int(value)
