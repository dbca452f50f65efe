"""Room acoustics with numpy in and out: measure, estimate, trace, fit, diagnose, plan.

    >>> import sabine
    >>> room = sabine.ShoeBox([5, 4, 2.6], absorption=0.2, scattering=0.5)
    >>> response = room.trace([1, 1, 1.5], [4, 3, 1.2], seed=1)
    >>> parameters = sabine.measure(response.samples, response.sample_rate)

Units: seconds, metres, Hz, dB; absorption and scattering are shares of energy at random incidence. A number that cannot be read
is NaN, and its reason stands beside it. Results have ``plot()`` (needs matplotlib); responses have ``to_pyfar()`` (needs pyfar).

Errors: ValueError for what cannot be computed, OSError for files, each with a message that names the field.
"""

from ._diagnosis import Diagnosis, diagnose, effects
from ._directivity import PATTERNS, Directivity
from ._fit import Fit, fit
from ._listener import (
    FreeFieldReference,
    InterauralCorrelation,
    LateralEnergy,
    SoundStrength,
    interaural_correlation,
    lateral_energy,
    sound_strength,
)
from ._parameters import MeasuredParameters, Parameters, measure
from ._plan import Plan, plan
from ._readings import OCTAVES, THIRD_OCTAVES, Reading, Readings, SpatialMean, spatial_mean
from ._response import Response
from ._room import FACES, ROOM_OCTAVES, Room, ShoeBox, Surface, library
from ._speech import SpeechEstimate, estimate
from ._speech_transmission import SpeechTransmission, speech_transmission, speech_transmission_of
from ._sweep import Sweep, SweepMeasurement

__all__ = [
    "FACES",
    "OCTAVES",
    "PATTERNS",
    "ROOM_OCTAVES",
    "THIRD_OCTAVES",
    "Diagnosis",
    "Directivity",
    "Fit",
    "FreeFieldReference",
    "InterauralCorrelation",
    "LateralEnergy",
    "MeasuredParameters",
    "Parameters",
    "Plan",
    "Reading",
    "Readings",
    "Response",
    "Room",
    "ShoeBox",
    "SoundStrength",
    "SpatialMean",
    "SpeechEstimate",
    "SpeechTransmission",
    "Surface",
    "Sweep",
    "SweepMeasurement",
    "diagnose",
    "effects",
    "estimate",
    "fit",
    "interaural_correlation",
    "lateral_energy",
    "library",
    "measure",
    "plan",
    "sound_strength",
    "spatial_mean",
    "speech_transmission",
    "speech_transmission_of",
]
