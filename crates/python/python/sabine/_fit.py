"""Absorption fitted to reverberation times or to measured responses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, Sequence, Tuple

import numpy as np

from . import _inputs, _plots, _sabine
from ._inputs import Place
from ._readings import Readings
from ._room import ROOM_OCTAVES, Room, Surface


@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """What :func:`fit` found.

    Attributes:
        room: the room with the fitted absorption, on the bands of the fit, to be traced.
        before: the room as it was.
        t60_s: reverberation time of the fitted room in seconds, T30 of the decay curves of its paths; after a fit to reverberation
            times of rays that the fit has not seen.
        unconverged_hz: bands in which the solver has not converged: their absorption is no result.
        unreachable: targets that are not met, by band in Hz, and why.
        not_determined: absorptions, or differences between them, that the data leave open.
        notes: bounds that were reached, and warnings.
    """

    room: Room
    before: Room
    t60_s: Readings
    unconverged_hz: Tuple[float, ...]
    unreachable: Dict[float, str]
    not_determined: Tuple[str, ...]
    notes: Tuple[str, ...]

    @classmethod
    def _of(cls, before: Room, found: dict) -> Fit:
        return cls(
            room=Room(found["room"]),
            before=before,
            t60_s=Readings._of(found["bands_hz"], found["t60_s"]),
            unconverged_hz=tuple(found["unconverged_hz"]),
            unreachable=dict(found["unreachable"]),
            not_determined=tuple(found["not_determined"]),
            notes=tuple(found["notes"]),
        )

    @property
    def surfaces(self) -> Dict[str, Surface]:
        """Surfaces with the fitted absorption and its standard error, by name."""
        return self.room.surfaces

    def plot(self, ax=None):
        """Draws fitted absorption with its standard error, and what it was before (dashed); returns the axes."""
        ax = _plots.new_axes(ax)
        for after, before in zip(self.surfaces.values(), self.before.surfaces.values()):
            colour = _plots.absorption(ax, self.room.bands_hz, after)
            ax.plot(self.before.bands_hz, before.absorption, "--", color=colour, alpha=0.6)
        _plots.absorption_axes(ax, self.room.bands_hz)
        return ax

    def __repr__(self) -> str:
        def row(surface: Surface) -> str:
            cells = zip(surface.absorption, surface.absorption_sd)
            return f"  {surface.name}: " + ", ".join(f"{value:.2f} ± {sd:.2f}" for value, sd in cells)

        absorption = [row(surface) for surface in self.surfaces.values()]
        told = [f"  not reached at {hz:g} Hz: {why}" for hz, why in self.unreachable.items()]
        told += [f"  not determined: {what}" for what in self.not_determined]
        told += [f"  note: {note}" for note in self.notes]
        bands = ", ".join(f"{hz:g}" for hz in self.t60_s.bands_hz)
        return "\n".join([f"Fit(t60_s={self.t60_s})", f"  absorption at {bands} Hz", *absorption, *told])


def fit(
    room: Room,
    t60_s: float | Sequence[float] | np.ndarray | Readings | None = None,
    *,
    source: Place | None = None,
    receiver: Place | None = None,
    responses: Sequence[Tuple[Place, Place, np.ndarray, float]] | None = None,
    time_zero: str = "per_response",
    levels: str = "per_response",
    bands_hz: Sequence[float] = ROOM_OCTAVES,
    rays: int = 20_000,
    seed: int = 1,
    allow_leaks: bool = False,
) -> Fit:
    """Finds the absorption with which the simulated room decays like the real one.

    With ``t60_s`` it is fitted to reverberation times between ``source`` and ``receiver``; with ``responses`` to the decays of
    these; without either to the measured responses of the room's folder. What the data leave open is kept near what the room
    states, as near as its ``absorption_sd`` says. The same seed gives the same fit. Ctrl-C stops it.

    Args:
        room: the room.
        t60_s: reverberation times in seconds, one for all bands, one for each, shape (bands,), or readings of :func:`measure` or
            :func:`estimate`: then the bands that have a value, weighed by their standard errors.
        source: name or position (x, y, z) in metres; the room's first by default.
        receiver: the same.
        responses: (source, receiver, samples, sample rate) of each measured response.
        time_zero: what the first sample of ``responses`` is: ``emission``, ``common`` (one unknown latency), ``per_response``.
        levels: what their levels mean: ``absolute`` (1 is the direct sound at 1 m), ``common`` (one unknown gain),
            ``per_response``.
        bands_hz: nominal centres of the bands of the fit; those of readings count instead.
        rays: rays of the first trace, 1 to 100 million; a fit to reverberation times traces more where they are too few.
        seed: of rays and noise.
        allow_leaks: goes on although more than one ray in a thousand escapes through holes of the mesh.

    Raises:
        ValueError: a target, a place, a response or a setting is refused, or there is nothing to fit to.
        KeyboardInterrupt: somebody pressed Ctrl-C.
    """
    if not isinstance(room, Room):
        raise ValueError(f"room: expected a Room, found {room!r}")
    if t60_s is not None and responses is not None:
        raise ValueError("responses: give these or t60_s, not both")
    settings = {
        "rays": _inputs.count(rays, "rays"),
        "seed": _inputs.count(seed, "seed"),
        "allow_leaks": allow_leaks,
    }
    if t60_s is None:
        if responses is not None:
            responses = [_recorded(i, response) for i, response in enumerate(responses)]
        found = _sabine.fit_responses(room._handle, _inputs.bands(bands_hz), responses, (time_zero, levels), settings)
        return Fit._of(room, found)
    if isinstance(t60_s, Readings):
        known = ~np.isnan(t60_s.value)
        bands_hz, values, errors = t60_s.bands_hz[known], t60_s.value[known], t60_s.standard_error[known]
    else:
        bands_hz = _inputs.bands(bands_hz)
        values = _inputs.numbers(t60_s, "t60_s", (len(bands_hz),))
        errors = np.zeros(len(values))
    places = (
        _inputs.place(_or_first(source, room.sources, "source"), "source"),
        _inputs.place(_or_first(receiver, room.receivers, "receiver"), "receiver"),
    )
    targets = [(float(hz), float(t60), float(error)) for hz, t60, error in zip(bands_hz, values, errors)]
    found = _sabine.fit_t60(room._handle, targets, places, settings)
    return Fit._of(room, found)


def _recorded(index: int, response) -> tuple:
    name = f"responses[{index}]"
    if not isinstance(response, (tuple, list)) or len(response) != 4:
        raise ValueError(f"{name}: expected (source, receiver, samples, sample rate)")
    source, receiver, samples, sample_rate = response
    places = _inputs.place(source, f"{name} source"), _inputs.place(receiver, f"{name} receiver")
    return (*places, _inputs.samples(samples, name), _inputs.number(sample_rate, f"{name} sample rate"))


def _or_first(place: Place | None, named: Dict[str, np.ndarray], what: str) -> Place:
    if place is not None:
        return place
    if not named:
        raise ValueError(f"{what}: the room names none; give a position")
    return next(iter(named))
