"""The compiled half. Dictionaries hold what the classes of the Python files are made of."""

import os
from typing import Any, List, Optional, Tuple, Union

import numpy as np

_Place = Union[str, List[float]]
_NamedPlaces = List[Tuple[str, List[float]]]

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

def measure(samples: np.ndarray, sample_rate: float, bands_hz: List[float]) -> dict[str, Any]: ...
def estimate(recordings: list[np.ndarray], sample_rate: float) -> dict[str, Any]: ...
def trace(room: Room, source: _Place, receiver: _Place, settings: dict[str, Any]) -> dict[str, Any]: ...
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
def diagnose(
    room: Room,
    rays: int,
    effects: Optional[List[str]],
    hold_out: List[str],
    seed: int,
    allow_leaks: bool,
) -> Tuple[str, str]: ...
def effects() -> List[str]: ...
def library_material(name: str, bands_hz: List[float]) -> Tuple[List[float], List[float]]: ...
def library() -> List[Tuple[str, str, str]]: ...
