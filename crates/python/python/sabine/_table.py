"""Several quantities per band, as a table."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Dict

import numpy as np

from ._readings import Reading, Readings


@dataclass(frozen=True, eq=False, repr=False)
class Table:
    """Quantities in the same bands; it prints as a table."""

    bands_hz: np.ndarray

    @classmethod
    def _of(cls, found: dict):
        bands_hz = np.asarray(found["bands_hz"])

        def field(name: str):
            value = found[name]
            if name == "bands_hz":
                return bands_hz
            if name == "single_numbers":
                return {number: Reading(**reading) for number, reading in value}
            return Readings._of(bands_hz, value) if isinstance(value, dict) else value

        return cls(**{one.name: field(one.name) for one in fields(cls)})

    def __repr__(self) -> str:
        """The table; below it why numbers are missing, and single numbers."""
        quantities = [(f.name, getattr(self, f.name)) for f in fields(self)]
        quantities = [(name, value) for name, value in quantities if isinstance(value, Readings)]
        head = f"{type(self).__name__:<20}" + "".join(f"{hz:>9g}" for hz in self.bands_hz) + " Hz"
        rows = [
            f"{name:<20}" + "".join(f"{'-' if np.isnan(v) else format(v, '.3f'):>9}" for v in readings)
            for name, readings in quantities
        ]
        places: Dict[str, list] = {}
        for name, readings in quantities:
            for hz, why in readings.missing.items():
                places.setdefault(why, []).append(f"{name} {hz:g}")
        reasons = [f"- {why}: {', '.join(where)}" for why, where in places.items()]
        numbers: Dict[str, Reading] = getattr(self, "single_numbers", {})
        singles = [f"{name} {reading!r}" for name, reading in numbers.items()]
        return "\n".join([head, *rows, *reasons, *singles])

    def _plot(self, ax, names: Dict[str, str], label: str):
        """Draws some of its quantities with 95 % intervals over frequency."""
        for name, shown in names.items():
            readings = getattr(self, name)
            if readings is not None:
                ax = readings.plot(ax, label=shown)
        ax.set_ylabel(label)
        ax.legend()
        return ax
