"""Which measurement decides, before it is made."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import List, Mapping, Sequence

import numpy as np

from . import _inputs, _plots, _sabine
from ._diagnosis import Diagnosis
from ._inputs import Document
from ._room import Room

#: Measurements that are printed.
_PRINTED = 5


@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """What :func:`plan` found.

    A nat is a unit of evidence: three nats are odds of 20 to 1.

    Attributes:
        data: everything, as ``plan.json`` of the command has it, and ``words`` for each of ``candidates``.
    """

    data: dict

    @property
    def candidates(self) -> List[dict]:
        """Measurements that were weighed, the most nats first: ``words``, ``measurement``, ``nats``, ``minutes``, ``decides`` ..."""
        return self.data["candidates"]

    @property
    def chosen(self) -> List[dict]:
        """Those that together decide most, one after the other: as in ``candidates``, and what each adds, ``adds_nats``."""
        return [{**self.candidates[one["candidate"]], **one} for one in self.data["chosen"]]

    @property
    def effects(self) -> List[dict]:
        """How large each effect must be to be named: ``effect``, ``subject``, ``parameter``, ``unit``, ``named_from`` as the room file
        stands and with the chosen measurements (None where no size is) ..."""
        return self.data["effects"]

    @property
    def most_per_minute(self) -> dict | None:
        """The measurement with the most nats for each minute; None without measurements."""
        return max(self.candidates, key=lambda one: one["nats_per_minute"], default=None)

    def plot(self, ax=None):
        """Draws places for microphones and sources from above, coloured by nats, those chosen with a ring and a number."""
        ax = _plots.new_axes(ax)

        def places(weighed: List[dict]) -> np.ndarray:
            return np.array([one["measurement"].get("position_m", [np.nan] * 3) for one in weighed]).reshape(-1, 3)

        at = places(self.candidates)
        drawn = ax.scatter(at[:, 0], at[:, 1], c=[one["nats"] for one in self.candidates])
        ax.figure.colorbar(drawn, ax=ax, label="nats")
        for number, (x, y, _) in enumerate(places(self.chosen), start=1):
            if np.isfinite(x):
                ax.plot(x, y, "o", markersize=14, markerfacecolor="none", color="black")
                ax.annotate(str(number), (x, y), xytext=(8, 8), textcoords="offset points")
        ax.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
        return ax

    def __repr__(self) -> str:
        lines = ["Plan"]
        for number, one in enumerate(self.chosen, start=1):
            lines.append(f"  {number}. {one['words']}: {one['adds_nats']:.1f} nats more")
        for one in self.candidates[:_PRINTED]:
            lines.append(f"  {one['words']}: {one['nats']:.1f} nats, {one['minutes']:g} minutes")
        return "\n".join(lines)


def plan(
    room: Room | str | os.PathLike,
    diagnosis: Diagnosis | None = None,
    *,
    laws: Document | None = None,
    microphones: int = 3,
    sources: int = 0,
    candidates: int = 60,
    clearance_m: float = 0.5,
    places_m: Sequence[Sequence[float]] | np.ndarray | None = None,
    minutes: Mapping[str, float] | None = None,
    rays: int = 2_000,
    seed: int = 0,
    allow_leaks: bool = False,
) -> Plan:
    """Plans the next measurement of a room: which one decides, and by how much.

    After a diagnosis nats are evidence between its leading causes; without one, what is learned of the size of each effect of the
    catalogue by itself, added up. Ctrl-C stops it.

    Args:
        room: a room folder with sources, or what :meth:`Room.read` made of one; measured responses are not needed without ``diagnosis``.
        diagnosis: a diagnosis of this room. A law that it found is a hypothesis; effects that are not in the catalogue and no law given
            here are passed over.
        laws: laws that are causes beside the catalogue, as in :func:`diagnose`.
        microphones: places for microphones to choose, 0 to 20.
        sources: places for the first source to choose, 0 to 5.
        candidates: measurements that are weighed, about: 4 to 1000.
        clearance_m: least distance of a new place from surfaces, sources and receivers, 0.05 to 10 m.
        places_m: places that microphones can take, shape (places, 3), in place of those of a grid.
        minutes: what measurements take: ``microphone`` (2 by default), ``source`` (5), ``source_turned`` (3), ``climate`` (120).
        rays: rays for each pair of source and receiver, 100 to 10 million.
        seed: of the rays. The same seed gives the same plan.
        allow_leaks: goes on although more than one ray in a thousand escapes through holes of the mesh.

    Raises:
        OSError: a file is missing or cannot be read.
        ValueError: the room is no folder or has no source, the diagnosis is of another room or leaves nothing open, a law cannot
            be weighed, or a setting is out of range.
        KeyboardInterrupt: somebody pressed Ctrl-C.
    """
    room = room if isinstance(room, Room) else Room.read(room)
    minutes = {} if minutes is None else minutes
    if not isinstance(minutes, Mapping):
        raise ValueError(f"minutes: expected a mapping from kinds to minutes, found {minutes!r}")
    settings = {
        "laws": _inputs.laws(laws),
        "microphones": _inputs.count(microphones, "microphones"),
        "sources": _inputs.count(sources, "sources"),
        "candidates": _inputs.count(candidates, "candidates"),
        "clearance_m": _inputs.number(clearance_m, "clearance_m"),
        "places_m": [] if places_m is None else _inputs.table(places_m, "places_m", (None, 3)).tolist(),
        "minutes": {str(kind): _inputs.number(value, f"minutes of {kind}") for kind, value in minutes.items()},
        "rays": _inputs.count(rays, "rays"),
        "seed": _inputs.count(seed, "seed"),
        "allow_leaks": allow_leaks,
    }
    if diagnosis is not None and not isinstance(diagnosis, Diagnosis):
        raise ValueError(f"diagnosis: expected a Diagnosis, found {diagnosis!r}")
    document = None if diagnosis is None else json.dumps(diagnosis.data)
    return Plan(json.loads(_sabine.plan(room._handle, document, settings)))
