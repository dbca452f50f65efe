"""Axes to draw on. matplotlib is asked for only when something is drawn."""

from __future__ import annotations

import numpy as np


def new_axes(ax):
    """The axes given, or new ones."""
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("plot() needs matplotlib: pip install matplotlib") from error
    return pyplot.subplots()[1]


def band_axis(ax, bands_hz: np.ndarray) -> None:
    """Bands side by side, each under its nominal centre."""
    ax.set_xscale("log")
    ax.set_xticks(bands_hz, [f"{hz:g}" if hz < 1000 else f"{hz / 1000:g}k" for hz in bands_hz])
    ax.minorticks_off()
    ax.set_xlabel("Frequency (Hz)")
    ax.grid(True, alpha=0.3)
