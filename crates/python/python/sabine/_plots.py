"""Axes to draw on. matplotlib is asked for only when something is drawn."""

from __future__ import annotations

import numpy as np


def new_axes(ax, polar: bool = False):
    """The axes given, or new ones."""
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise ImportError("plot() needs matplotlib: pip install matplotlib") from error
    return pyplot.subplots(layout="constrained", subplot_kw={"polar": polar})[1]


def band_axis(ax, bands_hz: np.ndarray) -> None:
    """Bands side by side, each under its nominal centre."""
    ax.set_xscale("log")
    ax.set_xticks(bands_hz, [f"{hz:g}" if hz < 1000 else f"{hz / 1000:g}k" for hz in bands_hz])
    ax.minorticks_off()
    ax.set_xlabel("Frequency (Hz)")
    ax.grid(True, alpha=0.3)


def absorption(ax, bands_hz: np.ndarray, surface):
    """Draws the absorption of a surface with its standard deviation; returns the colour."""
    label = f"{surface.name} ({surface.area_m2:.1f} m²)"
    drawn = ax.errorbar(bands_hz, surface.absorption, surface.absorption_sd, fmt="o-", capsize=3, label=label)
    return drawn[0].get_color()


def absorption_axes(ax, bands_hz: np.ndarray) -> None:
    """Axes and legend of absorption over frequency."""
    band_axis(ax, bands_hz)
    ax.set(ylabel="Absorption", ylim=(0, 1))
    ax.legend()
