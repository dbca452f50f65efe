"""Reverberation time and equalisation heard in speech."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Tuple

import numpy as np

from . import _inputs, _plots, _sabine
from ._readings import Readings


@dataclass(frozen=True, eq=False)
class SpeechEstimate:
    """What :func:`estimate` hears.

    Attributes:
        t60_s: reverberation time in seconds, octaves from 125 Hz to 8 kHz.
        eq_db: equalisation in dB relative to 1 kHz, octaves from 62.5 Hz to 4 kHz.
        warnings: reasons to trust it less.
    """

    t60_s: Readings
    eq_db: Readings
    warnings: Tuple[str, ...]

    def plot(self, ax=None):
        """Draws T60 with its 95 % interval over frequency; returns the axes (new ones by default)."""
        ax = self.t60_s.plot(_plots.new_axes(ax))
        ax.set_ylabel("T60 heard in speech (s)")
        return ax


def estimate(speech, sample_rate: float) -> SpeechEstimate:
    """Estimates reverberation time and equalisation from reverberant speech, with the network that the package brings along.

    How far it can be trusted: its model card, docs/model_card.md. The method: Z. Tang et al., Scene-aware audio rendering via
    deep acoustic analysis, IEEE TVCG 26 (5), 2020.

    Args:
        speech: the recording, shape (samples,), 1 s or longer; full scale is 1. A list or tuple of recordings is taken for one place in one
            room, best with another talker in each, and answered together.
        sample_rate: samples per second, 16 kHz or more.

    Raises:
        ValueError: the recording is empty, too short, silent, too loud, not finite, or of another shape or type; the sample rate
            is too low.
    """
    # A list of numbers is one recording.
    several = isinstance(speech, (list, tuple)) and len(speech) > 0 and isinstance(speech[0], np.ndarray)
    recordings = [_inputs.samples(one, "speech") for one in (speech if several else [speech])]
    heard = _sabine.estimate(recordings, _inputs.number(sample_rate, "sample_rate"))
    return SpeechEstimate(
        t60_s=Readings._of(heard["t60_bands_hz"], heard["t60_s"]),
        eq_db=Readings._of(heard["eq_bands_hz"], heard["eq_db"]),
        warnings=tuple(heard["warnings"]),
    )
