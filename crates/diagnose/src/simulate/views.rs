//! What an effect is shown of a prediction.

use crate::simulate::reflection_reweighting::HitChanges;
use crate::simulate::traced_pair::BandState;
use crate::survey::{Survey, SurveyedResponse};

/// One band of the predicted energy of one source-receiver pair.
#[derive(Clone, Copy)]
pub struct BandView<'a> {
    pub(crate) survey: &'a Survey,
    pub(crate) pair: usize,
    pub(crate) response: usize,
    pub(crate) band: usize,
    pub(crate) state: &'a BandState,
    pub(crate) direct_s: f64,
    pub(crate) reference: f64,
    /// Factor of the gains on all energy of the room.
    pub(crate) gain: f64,
    pub(crate) hit_changes: &'a HitChanges,
}

impl BandView<'_> {
    /// The survey.
    pub fn survey(&self) -> &Survey {
        self.survey
    }

    /// Index of the band.
    pub fn band(&self) -> usize {
        self.band
    }

    /// The pair that is predicted; which file holds it is [`BandView::recorded`].
    pub fn pair(&self) -> &SurveyedResponse {
        &self.survey.responses[self.pair]
    }

    /// The response that it is compared with: another one than the pair's where two were exchanged.
    pub fn recorded(&self) -> &SurveyedResponse {
        &self.survey.responses[self.response]
    }

    /// Number of time bins.
    pub fn len(&self) -> usize {
        self.state.ln_energy.len()
    }

    /// Whether there is no bin.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Mean arrival of the energy in a bin, in seconds after the emission.
    pub fn time_s(&self, bin: usize) -> f64 {
        self.direct_s + self.state.time_s[bin]
    }

    /// The same in seconds after the direct sound.
    pub fn after_direct_s(&self, bin: usize) -> f64 {
        self.state.time_s[bin]
    }

    /// Width of the bins in seconds.
    pub fn bin_s(&self) -> f64 {
        self.state.bins.width_s
    }

    /// Middle of a bin, in seconds from the first sample of the file.
    pub fn file_time_s(&self, bin: usize) -> f64 {
        self.recorded().direct_s + self.state.bins.centre_s(bin)
    }

    /// Energy of a typical early bin of this band, the mean over all pairs: what levels of added sound refer to.
    pub fn reference_energy(&self) -> f64 {
        self.reference
    }

    /// Energy that bends around edges of the mesh into a bin, by theory; none of it is in the prediction as traced.
    pub fn diffracted_energy(&self, bin: usize) -> f64 {
        self.gain * self.state.diffracted.of(self.band, bin)
    }

    /// Energy-weighted mean of the unit vectors in which the paths of a bin leave the source, and of their products
    /// xx, yy, zz, xy, xz, yz.
    pub fn departures(&self, bin: usize) -> ([f64; 3], [f64; 6]) {
        (self.state.departure[bin], self.state.departure_products[bin])
    }

    /// Natural logarithm of the change of a bin's energy if each meeting with a material left less, by this logarithm of the share.
    pub fn reflection_reweighting(&self, bin: usize, material: usize, ln_kept: f64) -> f64 {
        let materials = self.survey.materials.len();
        self.hit_changes.of(self.state, materials, bin, material, ln_kept)
    }

    /// Natural logarithm of the change of a bin's energy if the walls reacted locally by a share (-0.5 to 1.3; 1 is all of it): each
    /// reflection's logarithm moves by so much from that of random-incidence absorption towards that of a real impedance.
    pub fn local_reaction_change(&self, bin: usize, share: f64) -> f64 {
        self.state.local_reaction_change(bin, share)
    }

    /// Natural logarithm of the change of a bin's energy if the surfaces scattered more by `extra` (0 to 0.9, share of what
    /// they now reflect specularly) or less (-1 to 0, share of what they now scatter).
    pub fn scattering_change(&self, bin: usize, extra: f64) -> f64 {
        self.state.scattering_change(bin, extra)
    }

    /// By how much the tracer's own variance of a bin, as a share of its energy squared, is more if the surfaces scattered by `extra` more: what
    /// scatters is found by chance.
    pub fn scattering_variance(&self, bin: usize, extra: f64) -> f64 {
        self.state.scattering_variance(bin, extra)
    }

    /// Natural logarithm of a bin's energy in the solution of the wave equation over that of the paths, both behind the octave's
    /// filter; 0 where there is no solution.
    pub fn wave_change(&self, bin: usize) -> f64 {
        self.state.waves.get(bin).copied().unwrap_or(0.0)
    }

    /// Whether there is a solution of the wave equation in this octave.
    pub fn has_waves(&self) -> bool {
        !self.state.waves.is_empty()
    }
}

/// One predicted arrival: the direct sound or a specular reflection.
#[derive(Clone, Copy)]
pub struct ArrivalView<'a> {
    pub(crate) survey: &'a Survey,
    pub(crate) pair: usize,
    pub(crate) length_m: f64,
    pub(crate) speed_m_s: f64,
    pub(crate) departure: [f64; 3],
    pub(crate) arrival: [f64; 3],
}

impl ArrivalView<'_> {
    /// The survey.
    pub fn survey(&self) -> &Survey {
        self.survey
    }

    /// Its source-receiver pair.
    pub fn pair(&self) -> &SurveyedResponse {
        &self.survey.responses[self.pair]
    }

    /// Length of the path in metres.
    pub fn length_m(&self) -> f64 {
        self.length_m
    }

    /// Time of flight in seconds, at the stated temperature.
    pub fn time_s(&self) -> f64 {
        self.length_m / self.speed_m_s
    }

    /// Speed of sound at the stated temperature, in m/s.
    pub fn speed_m_s(&self) -> f64 {
        self.speed_m_s
    }

    /// Unit vector in which the path leaves the source.
    pub fn departure(&self) -> [f64; 3] {
        self.departure
    }

    /// Unit vector from the receiver towards where the path comes from.
    pub fn arrival(&self) -> [f64; 3] {
        self.arrival
    }
}
