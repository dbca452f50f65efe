"""Signals of pyfar, which is asked for only when one is made."""

from __future__ import annotations

import numpy as np


def signal(samples: np.ndarray, sample_rate: int):
    """Samples, shape (..., samples), as ``pyfar.Signal``."""
    try:
        import pyfar
    except ImportError as error:
        raise ImportError("to_pyfar() needs pyfar: pip install pyfar") from error
    return pyfar.Signal(samples, sample_rate)
