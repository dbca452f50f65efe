"""The compiled half. Dictionaries hold what the classes of the Python files are made of."""

import os
from typing import Any, List, Optional, Tuple, Union

import numpy as np

_Place = Union[str, List[float]]
_NamedPlaces = List[Tuple[str, List[float]]]

class Directivity:
    @staticmethod
    def named(name: str) -> Directivity: ...
    @staticmethod
    def first_order(omni_share: List[float], bands_hz: Optional[List[float]]) -> Directivity: ...
    @staticmethod
    def axisymmetric(
        angles_deg: List[float], levels_db: List[List[float]], bands_hz: List[float]
    ) -> Directivity: ...
    @staticmethod
    def table(
        azimuths: int, elevations: int, levels_db: List[List[float]], bands_hz: List[float]
    ) -> Directivity: ...
    @property
    def bands_hz(self) -> Optional[List[float]]: ...
    def energy_gains(self, directions: List[List[float]]) -> np.ndarray: ...
    def index_db(self) -> List[float]: ...

class ExtendedModel:
    @staticmethod
    def read(path: Union[str, os.PathLike[str]]) -> ExtendedModel: ...
    @staticmethod
    def parse(text: str) -> ExtendedModel: ...

class FreeFieldReference:
    @staticmethod
    def unit_source(sample_rate: float, bands_hz: List[float]) -> FreeFieldReference: ...
    @staticmethod
    def measured(
        responses: List[np.ndarray], sample_rate: float, distance_m: float, bands_hz: List[float]
    ) -> FreeFieldReference: ...
    @staticmethod
    def from_exposure_levels(
        levels_db: List[float], sample_rate: float, bands_hz: List[float]
    ) -> FreeFieldReference: ...
    @property
    def bands_hz(self) -> List[float]: ...

class Laws:
    @staticmethod
    def read(path: Union[str, os.PathLike[str]]) -> Laws: ...
    @staticmethod
    def parse(text: str) -> Laws: ...

class Room:
    @staticmethod
    def shoebox(
        size_m: List[float],
        bands_hz: List[float],
        surfaces: List[Tuple[List[float], List[float]]],
        absorption_sd: float,
        air: List[float],
        sources: _NamedPlaces,
        receivers: _NamedPlaces,
    ) -> Room: ...
    @staticmethod
    def read(
        folder: Union[str, os.PathLike[str]],
        materials: Union[str, os.PathLike[str], None],
        allow_outside: bool,
    ) -> Room: ...
    @property
    def bands_hz(self) -> List[float]: ...
    @property
    def bounds_m(self) -> List[List[float]]: ...
    @property
    def volume_m3(self) -> float: ...
    @property
    def surfaces(self) -> List[dict[str, Any]]: ...
    @property
    def sources(self) -> _NamedPlaces: ...
    @property
    def receivers(self) -> _NamedPlaces: ...
    @property
    def responses(self) -> int: ...
    @property
    def notes(self) -> List[str]: ...
    def diffuse_t60_s(self) -> List[List[float]]: ...

class Sweep:
    def __new__(cls, settings: dict[str, Any]) -> Sweep: ...
    def samples(self) -> np.ndarray: ...
    def playback(self) -> np.ndarray: ...
    def deconvolve(
        self,
        channels: List[np.ndarray],
        sample_rate: float,
        leave_out_differing: bool,
        allow_clock_drift: bool,
    ) -> dict[str, Any]: ...

def measure(samples: np.ndarray, sample_rate: float, bands_hz: List[float]) -> dict[str, Any]: ...
def estimate(recordings: list[np.ndarray], sample_rate: float) -> dict[str, Any]: ...
def sound_strength(
    samples: np.ndarray, sample_rate: float, reference: FreeFieldReference
) -> dict[str, Any]: ...
def lateral_energy(
    channels: Tuple[np.ndarray, np.ndarray],
    sample_rate: float,
    normalisation: str,
    bands_hz: List[float],
    reference: Optional[FreeFieldReference],
) -> dict[str, Any]: ...
def interaural_correlation(
    ears: Tuple[np.ndarray, np.ndarray], sample_rate: float, bands_hz: List[float]
) -> dict[str, Any]: ...
def speech_transmission(
    samples: np.ndarray, sample_rate: float, disturbance: dict[str, Any]
) -> dict[str, Any]: ...
def speech_transmission_of(
    modulation_transfer: List[List[float]], disturbance: dict[str, Any]
) -> dict[str, Any]: ...
def spatial_mean(
    bands_hz: List[float], positions: List[Tuple[List[float], List[float]]]
) -> dict[str, Any]: ...
def trace(
    room: Room,
    source: dict[str, Any],
    receiver: dict[str, Any],
    beside: dict[str, Any],
    settings: dict[str, Any],
) -> dict[str, Any]: ...
def fit_t60(
    room: Room,
    targets: List[Tuple[float, float, float]],
    places: Tuple[_Place, _Place],
    settings: dict[str, Any],
) -> dict[str, Any]: ...
def fit_responses(
    room: Room,
    bands_hz: List[float],
    responses: Optional[List[Tuple[_Place, _Place, np.ndarray, float]]],
    meaning: Tuple[str, str],
    settings: dict[str, Any],
) -> dict[str, Any]: ...
def diagnose(room: Room, settings: dict[str, Any]) -> Tuple[str, str]: ...
def plan(
    room: Room,
    question: Optional[Tuple[list[Any], List[str], list[Any]]],
    settings: dict[str, Any],
) -> str: ...
def effects() -> List[str]: ...
def library_material(name: str, bands_hz: List[float]) -> Tuple[List[float], List[float]]: ...
def library() -> List[Tuple[str, str, str]]: ...
