"""What a simulation gets wrong against measured responses, and why."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import List, Sequence, Tuple

from . import _inputs, _plots, _sabine
from ._inputs import Document
from ._room import Room


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis:
    """What :func:`diagnose` found.

    Attributes:
        data: everything, as ``diagnosis.json`` of the command has it (docs/versioning.md says what stays).
        extended_model: the model with the causes at work, the text of ``extended_model.toml``.
    """

    data: dict
    extended_model: str

    @property
    def verdict(self) -> str:
        """The answer in one word: ``adequate``, ``explained``, ``incomplete``, ``unconfirmed``, ``law``, ``ambiguous`` or ``unexplained``."""
        return self.data["verdict"]

    @property
    def causes(self) -> List[dict]:
        """Named causes: ``effect``, ``explanation``, ``probability``, ``nats``, ``parameters`` with 90 % intervals, and more."""
        return self.data["causes"]

    @property
    def candidates(self) -> List[dict]:
        """Every effect that was weighed, the strongest first: ``effect``, ``subject``, ``nats``, ``d_prime``."""
        return self.data["candidates"]

    @property
    def would_decide(self) -> Tuple[str, ...]:
        """Measurements that would decide what is open."""
        return tuple(self.data["would_decide"])

    @property
    def notes(self) -> Tuple[str, ...]:
        """What must be said besides."""
        return tuple(self.data["notes"])

    def write(self, folder: str | os.PathLike) -> None:
        """Writes ``diagnosis.json`` and ``extended_model.toml`` into a folder, which is made if need be.

        :func:`diagnose` starts from the model; so do the commands ``sabine diagnose``, ``trace``, ``fit`` and others with ``--model``.

        Raises:
            OSError: the folder cannot be written to.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(self.data, indent=2, sort_keys=True, ensure_ascii=False)
        (folder / "diagnosis.json").write_text(text, encoding="utf-8")
        (folder / "extended_model.toml").write_text(self.extended_model, encoding="utf-8")

    def plot(self, ax=None):
        """Draws the evidence of each effect that was weighed, in nats; returns the axes (new ones by default)."""
        ax = _plots.new_axes(ax)
        strongest_last = self.candidates[::-1]
        ax.barh([c["effect"] for c in strongest_last], [c["nats"] for c in strongest_last])
        ax.set_xlabel("Evidence (nats)")
        ax.set_title(f"Verdict: {self.verdict}")
        ax.grid(True, axis="x", alpha=0.3)
        return ax

    def __repr__(self) -> str:
        lines = [f"Diagnosis(verdict={self.verdict!r})"]
        for cause in self.causes:
            lines.append(f"  {cause['effect']} (probability {cause['probability']:.3f}): {cause['explanation']}")
            for name, p in cause["parameters"].items():
                lines.append(f"    {name} {p['value']:.4g} {p['unit']} (90 %: {p['low']:.4g} to {p['high']:.4g})")
        lines += [f"  would decide: {measurement}" for measurement in self.would_decide]
        lines += [f"  note: {note}" for note in self.notes]
        return "\n".join(lines)


def diagnose(
    room: Room | str | os.PathLike,
    *,
    rays: int = 10_000,
    effects: Sequence[str] | None = None,
    also: Sequence[str] = (),
    hold_out: Sequence[str] = (),
    laws: Document | None = None,
    discover: str | None = None,
    model: Document | Diagnosis | None = None,
    seed: int = 0,
    allow_leaks: bool = False,
) -> Diagnosis:
    """Says what the simulation of a room gets wrong against the responses measured in it, and names the cause.

    Minutes for a room with many responses; Ctrl-C stops it. How a cause is weighed: docs/explanation/diagnosis.md; how often it is
    right: docs/validation/diagnose.md.

    Args:
        room: a room folder with measured responses, or what :meth:`Room.read` made of one.
        rays: rays for each pair of source and receiver, 100 to 10 million.
        effects: effects to weigh, by name (:func:`effects`); all by default.
        also: effects that are weighed on request alone, beside those: ``missing_object``, furniture that the mesh lacks.
        hold_out: names of receivers that are predicted and never fitted; by default each is held out in turn.
        laws: formulas that are weighed as causes beside the catalogue, ``[[laws]]`` in TOML: a file, a folder of such files, or the
            text of one (docs/how-to/own-law.md).
        discover: when a law is looked for beside the catalogue: ``always``, ``if_needed`` (where no cause explains the room, or a
            formula would explain it as well) or ``never``; by default ``if_needed``, with ``effects`` ``never``.
        model: an extended model to start from, a file, the text of one, or an earlier diagnosis: its causes are there from the start, fitted
            again, and the search goes on (docs/how-to/extended-model.md).
        seed: of rays and simulated measurements. The same seed gives the same diagnosis.
        allow_leaks: goes on although more than one ray in a thousand escapes through holes of the mesh.

    Raises:
        OSError: a file is missing or cannot be read.
        ValueError: the room has no responses, an effect or receiver is unknown, or a setting is out of range; a law or a model cannot
            be read or does not fit the room.
        KeyboardInterrupt: somebody pressed Ctrl-C.
    """
    room = room if isinstance(room, Room) else Room.read(room)
    settings = {
        "rays": _inputs.count(rays, "rays"),
        "effects": None if effects is None else _names(effects, "effects"),
        "also": _names(also, "also"),
        "hold_out": _names(hold_out, "hold_out"),
        "laws": _inputs.laws(laws),
        "discover": str(discover or ("if_needed" if effects is None else "never")),
        "model": _inputs.model(model),
        "seed": _inputs.count(seed, "seed"),
        "allow_leaks": allow_leaks,
    }
    found = _sabine.diagnose(room._handle, settings)
    return Diagnosis(data=json.loads(found[0]), extended_model=found[1])


def _names(names: Sequence[str], what: str) -> List[str]:
    if isinstance(names, str) or not all(isinstance(name, str) for name in names):
        raise ValueError(f"{what}: expected a list of names, found {names!r}")
    return list(names)


def effects() -> Tuple[str, ...]:
    """Names of the effects that :func:`diagnose` weighs."""
    return tuple(_sabine.effects())
