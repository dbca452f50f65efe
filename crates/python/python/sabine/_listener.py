"""What a listener has of a room beside its decay: strength, lateral energy, and the correlation of both ears."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, Sequence

import numpy as np

from . import _inputs, _sabine
from ._readings import OCTAVES, Reading, Readings
from ._table import Table


class FreeFieldReference:
    """What the source of a measurement makes in the free field at 10 m: the zero of sound strength and late lateral level.

    It holds for responses of one sample rate and one gain of the measuring chain. Made by :meth:`unit_source`, :meth:`measured` and
    :meth:`from_exposure_levels`.
    """

    def __init__(self, handle: _sabine.FreeFieldReference):
        self._handle = handle

    @staticmethod
    def unit_source(sample_rate: float, *, bands_hz: Sequence[float] = OCTAVES) -> FreeFieldReference:
        """The reference of responses in which a sample of 1 is the direct sound at 1 m: those that :meth:`Room.trace` makes.

        Raises:
            ValueError: a sample rate or bands out of range.
        """
        sample_rate, bands_hz = _inputs.number(sample_rate, "sample_rate"), _inputs.bands(bands_hz)
        return FreeFieldReference(_sabine.FreeFieldReference.unit_source(sample_rate, bands_hz))

    @staticmethod
    def measured(
        responses,
        sample_rate: float,
        *,
        distance_m: float = 10.0,
        bands_hz: Sequence[float] = OCTAVES,
    ) -> FreeFieldReference:
        """The reference from the free field: L_pE,10 = L_pE,d + 20 lg(d / 10 m) (ISO 3382-1:2009, A.2.1).

        Everything in the responses counts as direct sound: cut off reflections and noise before.

        Args:
            responses: one response, shape (samples,), or a list of them or an array of shape (directions, samples): directions from
                the source, whose energies are averaged.
            sample_rate: samples per second.
            distance_m: distance of the microphone from the source, 0.1 to 100 m.
            bands_hz: nominal centres of the bands.

        Raises:
            ValueError: responses are missing, silent in a band, or not finite; a number or bands out of range.
        """
        channels = _inputs.channels(responses, "responses")
        sample_rate, distance_m = _inputs.number(sample_rate, "sample_rate"), _inputs.number(distance_m, "distance_m")
        bands_hz = _inputs.bands(bands_hz)
        return FreeFieldReference(_sabine.FreeFieldReference.measured(channels, sample_rate, distance_m, bands_hz))

    @staticmethod
    def from_exposure_levels(
        levels_db: float | Sequence[float] | np.ndarray,
        sample_rate: float,
        *,
        bands_hz: Sequence[float] = OCTAVES,
    ) -> FreeFieldReference:
        """The reference from the sound exposure level that the source makes at 10 m in the free field.

        Args:
            levels_db: 10 lg of the time integral of the squared samples, in dB re 1 s, -300 to 300; one, or shape (bands,).
            sample_rate: samples per second of the responses that are measured against it.
            bands_hz: nominal centres of the bands.

        Raises:
            ValueError: a number or bands out of range.
        """
        bands_hz, sample_rate = _inputs.bands(bands_hz), _inputs.number(sample_rate, "sample_rate")
        levels = _inputs.numbers(levels_db, "levels_db", (len(bands_hz),)).tolist()
        return FreeFieldReference(_sabine.FreeFieldReference.from_exposure_levels(levels, sample_rate, bands_hz))

    @property
    def bands_hz(self) -> np.ndarray:
        """Nominal centres of its bands in Hz, shape (bands,)."""
        return np.asarray(self._handle.bands_hz)


@dataclass(frozen=True, eq=False, repr=False)
class SoundStrength(Table):
    """What :func:`sound_strength` reads, per band.

    Attributes:
        bands_hz: nominal centres in Hz, shape (bands,).
        g_db: sound strength G, the whole response against the free field at 10 m, in dB.
        g_early_db: the same of what arrives within 80 ms of the onset.
        g_late_db: the same of what arrives later.
        single_numbers: ``g_mid_db``, mean over 500 Hz and 1 kHz (ISO 3382-1:2009, table A.1).
    """

    g_db: Readings
    g_early_db: Readings
    g_late_db: Readings
    single_numbers: Dict[str, Reading]

    def plot(self, ax=None):
        """Draws all three with 95 % intervals over frequency; returns the axes (new ones by default)."""
        names = {"g_db": "G", "g_early_db": "early", "g_late_db": "late"}
        return self._plot(ax, names, "Sound strength (dB)")


def sound_strength(
    response,
    sample_rate: float,
    reference: FreeFieldReference | None = None,
    *,
    bands_hz: Sequence[float] = OCTAVES,
) -> SoundStrength:
    """Measures the sound strength G: how much louder the room makes the source than the free field (ISO 3382-1:2009, A.2.1).

    Standard errors are what background noise adds; the uncertainty of the reference is not in them.

    Args:
        response: the impulse response of an omnidirectional microphone, shape (samples,).
        sample_rate: samples per second, 1 kHz to 768 kHz.
        reference: the source in the free field, with the gain of the measurement; by default a source of which a sample of 1
            is the direct sound at 1 m, as in traced responses.
        bands_hz: nominal centres of the bands; those of a reference count instead.

    Raises:
        ValueError: samples, a sample rate or bands are refused; the reference has another sample rate.
    """
    samples, sample_rate = _inputs.samples(response, "response"), _inputs.number(sample_rate, "sample_rate")
    if reference is None:
        reference = FreeFieldReference.unit_source(sample_rate, bands_hz=bands_hz)
    return SoundStrength._of(_sabine.sound_strength(samples, sample_rate, _handle_of(reference)))


@dataclass(frozen=True, eq=False, repr=False)
class LateralEnergy(Table):
    """What :func:`lateral_energy` reads, per band.

    Attributes:
        bands_hz: nominal centres in Hz, shape (bands,).
        j_lf: early lateral energy fraction: figure of eight from 5 to 80 ms over omnidirectional from 0 to 80 ms; 0 to about 1.
        j_lfc: the same with the product of both channels, which weighs directions by the cosine in place of its square.
        l_j_db: late lateral level: figure of eight from 80 ms on against the free field at 10 m, in dB; None without a reference.
        single_numbers: ``j_lf_low`` and ``j_lfc_low``, means over 125 Hz to 1 kHz, and with a reference ``l_j_low_db``, the mean of
            energies there (ISO 3382-1:2009, table A.1).
    """

    j_lf: Readings
    j_lfc: Readings
    l_j_db: Readings | None
    single_numbers: Dict[str, Reading]

    def plot(self, ax=None):
        """Draws both fractions with 95 % intervals over frequency; returns the axes (new ones by default)."""
        return self._plot(ax, {"j_lf": "J_LF", "j_lfc": "J_LFC"}, "Early lateral energy fraction")


def lateral_energy(
    omnidirectional,
    figure_of_eight,
    sample_rate: float,
    *,
    normalisation: str = "equal",
    reference: FreeFieldReference | None = None,
    bands_hz: Sequence[float] = OCTAVES,
) -> LateralEnergy:
    """Measures how much sound comes from the sides (ISO 3382-1:2009, A.2.4 and A.2.5, equations A.14 to A.16).

    Both channels are of one measurement at one place; the null of the figure of eight points at the source.

    Args:
        omnidirectional: response of the omnidirectional channel, shape (samples,).
        figure_of_eight: that of the figure of eight, of the same length.
        sample_rate: samples per second, 1 kHz to 768 kHz.
        normalisation: how loud the figure of eight is on its axis beside the omnidirectional channel: ``equal`` (calibrated
            microphones, ambisonics in SN3D), ``n3d`` (louder by the root of three), ``fuma`` (louder by the root of two).
        reference: the source in the free field, of the same bands: then the late lateral level is read, too.
        bands_hz: nominal centres of the bands.

    Raises:
        ValueError: samples, a sample rate, bands or the normalisation are refused; channels differ in length; the reference has
            another sample rate or other bands.
    """
    channels = (
        _inputs.samples(omnidirectional, "omnidirectional"),
        _inputs.samples(figure_of_eight, "figure_of_eight"),
    )
    _inputs.same_length(channels, ("omnidirectional", "figure_of_eight"))
    handle = None if reference is None else _handle_of(reference)
    sample_rate, bands_hz = _inputs.number(sample_rate, "sample_rate"), _inputs.bands(bands_hz)
    if not isinstance(normalisation, str):
        raise ValueError(f"normalisation: expected a name, found {normalisation!r}")
    return LateralEnergy._of(_sabine.lateral_energy(channels, sample_rate, normalisation, bands_hz, handle))


@dataclass(frozen=True, eq=False, repr=False)
class InterauralCorrelation(Table):
    """What :func:`interaural_correlation` reads, per band.

    Attributes:
        bands_hz: nominal centres in Hz, shape (bands,).
        iacc_early: coefficient of the first 80 ms, 0 to 1.
        iacc_late: that of what comes later.
        iacc: that of all.
    """

    iacc_early: Readings
    iacc_late: Readings
    iacc: Readings

    def plot(self, ax=None):
        """Draws all three with 95 % intervals over frequency; returns the axes (new ones by default)."""
        names = {"iacc_early": "early", "iacc_late": "late", "iacc": "all"}
        return self._plot(ax, names, "Interaural cross-correlation")


def interaural_correlation(
    left, right, sample_rate: float, *, bands_hz: Sequence[float] = OCTAVES
) -> InterauralCorrelation:
    """Measures the interaural cross-correlation coefficient IACC (ISO 3382-1:2009, annex B, equations B.1 and B.2).

    The largest magnitude, over delays of up to 1 ms, of the correlation of both ears over the root of the product of their
    energies. Noise is taken out of the energies.

    Args:
        left: response at the left ear, shape (samples,).
        right: that at the right ear, of the same length.
        sample_rate: samples per second, 1 kHz to 768 kHz.
        bands_hz: nominal centres of the bands.

    Raises:
        ValueError: samples, a sample rate or bands are refused; the ears differ in length.
    """
    ears = _inputs.samples(left, "left"), _inputs.samples(right, "right")
    _inputs.same_length(ears, ("left", "right"))
    sample_rate = _inputs.number(sample_rate, "sample_rate")
    return InterauralCorrelation._of(_sabine.interaural_correlation(ears, sample_rate, _inputs.bands(bands_hz)))


def _handle_of(reference: FreeFieldReference) -> _sabine.FreeFieldReference:
    if not isinstance(reference, FreeFieldReference):
        raise ValueError(f"reference: expected a FreeFieldReference, found {reference!r}")
    return reference._handle
