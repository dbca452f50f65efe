//! What an effect is shown of a prediction.

use crate::extend::displaced_surface::{DisplacedSurface, Mirror, longer_m, mirrors};
use crate::simulate::band_state::BandState;
use crate::simulate::reflection_reweighting::HitChanges;
use crate::simulate::tables::Tables;
use crate::survey::path_stops::path_stops;
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
    /// Tables of all terms, and which of them: the band whose bins these are, and whether they are single reflections.
    pub(crate) tables: &'a [Tables],
    pub(crate) own_band: usize,
    pub(crate) reflections: bool,
    pub(crate) table: Option<&'a (dyn std::any::Any + Send + Sync)>,
}

impl<'a> BandView<'a> {
    /// The same with the table of the case that has this slot.
    pub(crate) fn with_table(&self, slot: Option<usize>) -> BandView<'a> {
        let tables = slot.and_then(|slot| self.tables.get(slot));
        let table = tables.and_then(|tables| tables.of(self.pair, self.own_band, self.reflections));
        BandView { table, ..*self }
    }
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

    /// Index of that response.
    pub fn response(&self) -> usize {
        self.response
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

    /// Factor of the gains of the response on all energy of the room: for energy that a term adds beside that of the paths.
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// The table that the term has prepared for this band and pair, if it is of this type. Where energy of a neighbouring octave leaks in,
    /// it is still that of the band whose bins these are.
    pub fn table<T: std::any::Any>(&self) -> Option<&T> {
        self.table?.downcast_ref()
    }

    /// Energy-weighted mean of the unit vectors in which the paths of a bin leave the source, and of their products
    /// xx, yy, zz, xy, xz, yz.
    pub fn departures(&self, bin: usize) -> ([f64; 3], [f64; 6]) {
        (self.state.departure[bin], self.state.departure_products[bin])
    }

    /// The same of the unit vectors from the receiver towards where they come from.
    pub fn arrivals(&self, bin: usize) -> ([f64; 3], [f64; 6]) {
        (self.state.arrival[bin], self.state.arrival_products[bin])
    }

    /// Natural logarithm of the change of a bin's energy if each meeting with a material left less, by this logarithm of the share.
    pub fn reflection_reweighting(&self, bin: usize, material: usize, ln_kept: f64) -> f64 {
        self.hit_changes.of(self.state, bin, material, ln_kept)
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
    pub(crate) surfaces: &'a [usize],
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

    /// The surfaces (indices into [`Survey::surfaces`]) that mirror it, from the source on. Empty for the direct sound, and for a path that
    /// meets surfaces so near to their edges that it cannot be followed.
    pub fn surfaces(&self) -> &[usize] {
        self.surfaces
    }

    /// The places from each of which to the next it goes straight on, in metres: source, reflections, receiver. Empty where the surfaces that it
    /// meets are not known.
    pub fn stops(&self) -> Vec<[f64; 3]> {
        path_stops(self.survey, self.pair(), self.length_m, self.surfaces)
    }

    /// Seconds by which it comes later if surfaces (indices into [`Survey::surfaces`]) stand elsewhere: exact for a specular path, whose
    /// source has its image in the mirrors as they stand. Zero where it meets none of them.
    pub fn delay_by_displaced_s(&self, displaced: &[(usize, DisplacedSurface)]) -> f64 {
        self.delay_in_s(&mirrors(displaced))
    }

    /// The same of the planes in which they stand.
    pub(crate) fn delay_in_s(&self, moved: &[Mirror]) -> f64 {
        longer_m(self.survey, self.pair(), self.surfaces, moved) / self.speed_m_s
    }
}
