"""Room acoustics with numpy in and out: measure, estimate, trace, fit, diagnose.

    >>> import sabine
    >>> room = sabine.ShoeBox([5, 4, 2.6], absorption=0.2, scattering=0.5)
    >>> response = room.trace([1, 1, 1.5], [4, 3, 1.2], seed=1)
    >>> parameters = sabine.measure(response.samples, response.sample_rate)

Units: seconds, metres, Hz, dB; absorption and scattering are shares of energy at random incidence. A number that cannot be read
is NaN, and its reason stands beside it. Results have ``plot()`` (needs matplotlib); responses have ``to_pyfar()`` (needs pyfar).

Errors: ValueError for what cannot be computed, OSError for files, each with a message that names the field.
"""

from ._diagnosis import Diagnosis, diagnose, effects
from ._fit import Fit, fit
from ._parameters import MeasuredParameters, Parameters, measure
from ._readings import OCTAVES, THIRD_OCTAVES, Readings
from ._response import Response
from ._room import FACES, ROOM_OCTAVES, Room, ShoeBox, Surface, library
from ._speech import SpeechEstimate, estimate

__all__ = [
    "FACES",
    "OCTAVES",
    "ROOM_OCTAVES",
    "THIRD_OCTAVES",
    "Diagnosis",
    "Fit",
    "MeasuredParameters",
    "Parameters",
    "Readings",
    "Response",
    "Room",
    "ShoeBox",
    "SpeechEstimate",
    "Surface",
    "diagnose",
    "effects",
    "estimate",
    "fit",
    "library",
    "measure",
]
