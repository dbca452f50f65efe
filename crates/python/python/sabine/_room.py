"""Rooms: a box from its size, a room folder, or a room of pyroomacoustics."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Dict, Mapping, Sequence, Tuple, Union

import numpy as np

from . import _inputs, _plots, _pyroomacoustics, _sabine
from ._directivity import Pattern, handle_of
from ._inputs import Document, Place
from ._response import Response

if TYPE_CHECKING:
    from ._diagnosis import Diagnosis

#: Octaves of a room's tables and of fits, 125 Hz to 8 kHz.
ROOM_OCTAVES = (125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0)
#: Faces of a box: x = 0, x = length, y = 0, y = width, z = 0, z = height.
FACES = ("x0", "x1", "y0", "y1", "floor", "ceiling")

#: A share of energy, 0 to 1: one number, or one for each band.
Share = Union[float, Sequence[float], np.ndarray]


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface of a room, all of one material.

    Attributes:
        name: its name.
        area_m2: its area in square metres.
        absorption: share of the incident energy that does not come back, random incidence (ISO 354), 0 to 1, shape (bands,).
        absorption_sd: one standard deviation of what is known of it: a prior before a fit, the standard error after it.
        scattering: share of the reflected energy that leaves away from the mirror direction (ISO 17497-1), 0 to 1, shape (bands,).
    """

    name: str
    area_m2: float
    absorption: np.ndarray
    absorption_sd: np.ndarray
    scattering: np.ndarray


class Room:
    """A room that can be traced, fitted and, if responses were measured in it, diagnosed.

    Made by :class:`ShoeBox`, :meth:`Room.read` and :meth:`Room.from_pyroomacoustics`. It does not change: a fit makes another.
    """

    def __init__(self, handle: _sabine.Room):
        self._handle = handle

    @staticmethod
    def read(
        folder: str | os.PathLike,
        *,
        materials: str | os.PathLike | None = None,
        allow_outside: bool = False,
    ) -> Room:
        """Reads a room folder: ``room.toml``, its mesh, and measured responses if it has any (docs/measured-room.md).

        Args:
            folder: the folder.
            materials: a ``materials.toml`` whose tables take the place of the folder's.
            allow_outside: read a mesh or responses outside the folder, too: only for rooms that you trust.

        Raises:
            OSError: a file is missing or cannot be read.
            ValueError: a file says something that cannot be; the message names file, line and field.
        """
        return Room(_sabine.Room.read(folder, materials, allow_outside))

    @staticmethod
    def from_pyroomacoustics(room) -> Room:
        """The same room as a ``pyroomacoustics.ShoeBox``: size, absorption, scattering, air, sources and microphones.

        Sources are named ``s1``, ``s2``, ..., microphones ``r1``, ``r2``, ... Octaves from 125 Hz to 8 kHz take the absorption
        of the nearest octave there, or the one value that there is. The air always absorbs here; where no humidity was stated
        there, it is 40 %.

        Raises:
            ValueError: the room is no box in three dimensions.
        """
        return ShoeBox(**_pyroomacoustics.shoebox(room, ROOM_OCTAVES, FACES))

    @property
    def bands_hz(self) -> np.ndarray:
        """Nominal centres of the bands of its materials in Hz, shape (bands,)."""
        return np.asarray(self._handle.bands_hz)

    @property
    def size_m(self) -> np.ndarray:
        """Extent along x, y and z in metres, shape (3,)."""
        low, high = self._handle.bounds_m
        return np.subtract(high, low)

    @property
    def volume_m3(self) -> float:
        """Volume in cubic metres."""
        return self._handle.volume_m3

    @property
    def surfaces(self) -> Dict[str, Surface]:
        """Surfaces by name."""
        return {surface["name"]: Surface(**surface) for surface in self._handle.surfaces}

    @property
    def sources(self) -> Dict[str, np.ndarray]:
        """Positions of the named sources in metres."""
        return {name: np.asarray(position) for name, position in self._handle.sources}

    @property
    def receivers(self) -> Dict[str, np.ndarray]:
        """Positions of the named receivers in metres."""
        return {name: np.asarray(position) for name, position in self._handle.receivers}

    @property
    def notes(self) -> Tuple[str, ...]:
        """What should be known before its numbers are believed: guessed materials, unusual size."""
        return tuple(self._handle.notes)

    @property
    def sabine_t60_s(self) -> np.ndarray:
        """Reverberation time in seconds by Sabine's formula, with the air, shape (bands,)."""
        return np.asarray(self._handle.diffuse_t60_s()[0])

    @property
    def eyring_t60_s(self) -> np.ndarray:
        """Reverberation time in seconds by Eyring's formula, with the air, shape (bands,)."""
        return np.asarray(self._handle.diffuse_t60_s()[1])

    def trace(
        self,
        source: Place,
        receiver: Place,
        *,
        source_directivity: Pattern | None = None,
        source_axis: Sequence[float] | None = None,
        receiver_directivity: Pattern | None = None,
        receiver_axis: Sequence[float] | None = None,
        laws: Document | None = None,
        model: Document | Diagnosis | None = None,
        rays: int = 20_000,
        seed: int = 0,
        sample_rate: float = 48_000,
        duration_s: float | None = None,
        image_order: int = 3,
        diffraction: bool = False,
        allow_leaks: bool = False,
    ) -> Response:
        """Traces the paths of sound between two places and renders the response.

        The same seed gives the same response on any number of threads. Ctrl-C stops it.

        Args:
            source: name, or position (x, y, z) in metres.
            receiver: the same.
            source_directivity: how it radiates: a :class:`Directivity`, or the name of a pattern of first order (``cardioid``
                and others); None radiates the same in all directions.
            source_axis: direction in which it faces, shape (3,), of any length; by default the one that the room file states, or else
                towards the receiver.
            receiver_directivity: how the receiver hears, likewise.
            receiver_axis: where it faces, likewise; by default as the room file states, or else towards the source.
            laws: formulas that change what paths carry, ``[[laws]]`` in TOML: a file, a folder of such files, or the text of one
                (docs/how-to/own-law.md). Response, parameters and decay are those under them.
            model: the extended model of a diagnosis of this room folder: a file, the text of one, or the diagnosis itself
                (docs/how-to/extended-model.md). The room is as it says; source and receiver are names, without directivity or axis of
                their own. Loudspeaker, noise and recorder are in ``samples`` alone; parameters and decay are those of the paths. A law
                of ``laws`` takes the place of one of the same ``id`` in it.
            rays: 1 to 100 million; the standard error falls with its square root.
            seed: of rays and noise.
            sample_rate: of the response, 8 to 96 kHz.
            duration_s: length of the response, 1 ms to 60 s; by default as long as T30 needs, at most 20 s.
            image_order: specular reflections up to this order, 0 to 10, are found exactly.
            diffraction: adds the ways around one edge into shadows.
            allow_leaks: goes on although more than one ray in a thousand escapes through holes of the mesh.

        Raises:
            ValueError: a place outside the room or on a surface, an axis without length, an unknown pattern, or a setting out of
                range; a law or a model that cannot be read or does not fit the room: the message names the law and the column of its
                formula, or the field; a model with waves.
            OSError: the file of laws or of the model is missing or cannot be read.
            KeyboardInterrupt: somebody pressed Ctrl-C.
        """
        settings = {
            "rays": _inputs.count(rays, "rays"),
            "seed": _inputs.count(seed, "seed"),
            "duration_s": None if duration_s is None else _inputs.number(duration_s, "duration_s"),
            "image_order": _inputs.count(image_order, "image_order"),
            "sample_rate": _inputs.number(sample_rate, "sample_rate"),
            "diffraction": diffraction,
            "allow_leaks": allow_leaks,
        }
        ends = (
            _end("source", source, source_directivity, source_axis),
            _end("receiver", receiver, receiver_directivity, receiver_axis),
        )
        beside = {"laws": _inputs.laws(laws), "model": _inputs.model(model)}
        return Response._of(_sabine.trace(self._handle, *ends, beside, settings))

    def plot(self, ax=None):
        """Draws the absorption of each surface over frequency, with its standard deviation; returns the axes (new ones by default)."""
        ax = _plots.new_axes(ax)
        for surface in self.surfaces.values():
            _plots.absorption(ax, self.bands_hz, surface)
        _plots.absorption_axes(ax, self.bands_hz)
        return ax

    def __repr__(self) -> str:
        size = " x ".join(f"{side:g}" for side in self.size_m)
        return (
            f"{type(self).__name__}({size} m, {self.volume_m3:.4g} m³, {len(self.surfaces)} surfaces, "
            f"{len(self.sources)} sources, {len(self.receivers)} receivers, {self._handle.responses} responses)"
        )


def _end(name: str, place: Place, directivity: Pattern | None, axis) -> dict:
    """A source or a receiver, as the compiled half takes it."""
    return {
        "place": _inputs.place(place, name),
        "directivity": handle_of(directivity, f"{name}_directivity"),
        "axis": _inputs.axis(axis, f"{name}_axis"),
    }


class ShoeBox(Room):
    """A box with one corner at the origin: x from 0 to length, y from 0 to width, z from 0 (floor) to height.

    Args:
        size_m: length, width and height in metres, shape (3,).
        absorption: one for all faces, or a mapping from face (``x0 x1 y0 y1 floor ceiling``) to its own; each a number or
            one number for each band.
        scattering: the same for scattering.
        materials: name of a surface of the library (:func:`library`) for all faces, or a mapping from face to name; these faces
            take absorption and scattering from there.
        absorption_sd: how far the absorption is trusted, one standard deviation, 0.0001 to 1: the prior of a fit.
        bands_hz: nominal centres of the bands, octaves or third octaves; octaves from 125 Hz to 8 kHz by default.
        sources: mapping from name to position (x, y, z) in metres.
        receivers: the same for receivers.
        temperature_c: of the air in Celsius; its humidity in percent, its pressure in kPa (ISO 9613-1).

    Raises:
        ValueError: a face without absorption, an unknown face or surface, a value out of range.
    """

    def __init__(
        self,
        size_m: Sequence[float],
        absorption: Share | Mapping[str, Share] | None = None,
        *,
        scattering: Share | Mapping[str, Share] = 0.1,
        materials: str | Mapping[str, str] | None = None,
        absorption_sd: float = 0.1,
        bands_hz: Sequence[float] = ROOM_OCTAVES,
        sources: Mapping[str, Sequence[float]] | None = None,
        receivers: Mapping[str, Sequence[float]] | None = None,
        temperature_c: float = 20.0,
        humidity_percent: float = 50.0,
        pressure_kpa: float = 101.325,
    ):
        absorption_sd = _inputs.number(absorption_sd, "absorption_sd")
        if not 1e-4 <= absorption_sd <= 1.0:
            raise ValueError(f"absorption_sd: {absorption_sd} is not between 0.0001 and 1")
        air = {"temperature_c": temperature_c, "humidity_percent": humidity_percent, "pressure_kpa": pressure_kpa}
        bands_hz = _inputs.bands(bands_hz)
        named = _by_face(materials, "materials")
        absorptions, scatterings = _by_face(absorption, "absorption"), _by_face(scattering, "scattering")

        def surface(face: str) -> Tuple[list, list]:
            if face in named:
                return _sabine.library_material(named[face], bands_hz)
            if face not in absorptions:
                raise ValueError(f"absorption: the face {face} has none, and no material")
            if face not in scatterings:
                raise ValueError(f"scattering: the face {face} has none")
            shape = (len(bands_hz),)
            return (
                _inputs.numbers(absorptions[face], f"absorption of {face}", shape).tolist(),
                _inputs.numbers(scatterings[face], f"scattering of {face}", shape).tolist(),
            )

        super().__init__(
            _sabine.Room.shoebox(
                _inputs.position(size_m, "size_m"),
                bands_hz,
                [surface(face) for face in FACES],
                absorption_sd,
                [_inputs.number(value, name) for name, value in air.items()],
                [(name, _inputs.position(at, f"source {name}")) for name, at in (sources or {}).items()],
                [(name, _inputs.position(at, f"receiver {name}")) for name, at in (receivers or {}).items()],
            )
        )


def _by_face(values, name: str) -> dict:
    """What each face has; one value stands for all."""
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        return dict.fromkeys(FACES, values)
    unknown = [face for face in values if face not in FACES]
    if unknown:
        raise ValueError(f"{name}: a box has no face {unknown[0]!r}; it has {', '.join(FACES)}")
    return dict(values)


def library() -> Dict[str, str]:
    """Surfaces of the library: name, and what was measured with its source."""
    return {name: f"{description} ({source})" for name, description, source in _sabine.library()}
