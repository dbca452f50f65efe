//! What a term is shown of the traced room, for tables of its own.

use crate::error::Error;
use crate::observe::band_pulse::BandPulse;
use crate::simulate::band_state::BandState;
use crate::simulate::monte_carlo_modes::deviations;
use crate::simulate::simulation::Simulation;
use crate::simulate::traced_pair::TracedPair;
use crate::simulate::traced_pair::class_sums::ClassedPaths;
use crate::survey::{Survey, SurveyedResponse};
use rayon::prelude::*;
use sabine_acoustics::{Air, Material};
use sabine_paths::laws::{BoundLaws, LawSite};
use sabine_paths::{Conditions, PathSet};
use sabine_propagate::ImageSource;
use sabine_scene::{Receiver, Scene, Source};
use std::sync::OnceLock;

/// Energy of a bin without paths, as a share of the strongest: it counts as nothing.
const NOTHING: f64 = 1e-12;

/// The traced room at the materials about which predictions are expanded.
pub struct TracedRoomView<'a> {
    pub(crate) survey: &'a Survey,
    pub(crate) simulation: &'a Simulation,
    pub(crate) pulses: &'a [BandPulse],
    materials: Vec<Material>,
    /// Energies of the paths of each pair under these, once a term has asked for them.
    energies: Vec<OnceLock<Vec<Vec<f32>>>>,
}

impl<'a> TracedRoomView<'a> {
    pub(crate) fn new(
        survey: &'a Survey,
        simulation: &'a Simulation,
        pulses: &'a [BandPulse],
    ) -> Result<Self, Error> {
        let materials = simulation.expanded_materials()?;
        let energies = simulation.pairs.iter().map(|_| OnceLock::new()).collect();
        Ok(Self { survey, simulation, pulses, materials, energies })
    }

    /// The survey.
    pub fn survey(&self) -> &Survey {
        self.survey
    }

    /// Materials about which predictions are expanded. Scattering is as stated.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// The mesh as it is traced: at the size that was found, its materials' scattering spread over the bands.
    pub fn scene(&self) -> &Scene {
        self.simulation.traced_scene()
    }

    /// A source (index) where it was found to stand.
    pub fn source(&self, index: usize) -> &Source {
        &self.simulation.sources[index]
    }

    /// A receiver (index) where it was found to stand.
    pub fn receiver(&self, index: usize) -> &Receiver {
        &self.simulation.receivers[index]
    }

    /// The material (index) of each of the six faces, where the mesh is a cuboid and the tracer knows its images.
    pub fn cuboid_faces(&self) -> Option<[u32; 6]> {
        self.simulation.prepared().cuboid_faces()
    }

    /// Number of pairs.
    pub fn len(&self) -> usize {
        self.simulation.pairs.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A pair (index).
    pub fn pair(&self, index: usize) -> TracedPairView<'_> {
        TracedPairView { room: self, pair: &self.simulation.pairs[index], index }
    }

    /// Something of each pair, computed on all threads.
    ///
    /// # Errors
    /// The first that `one` gives.
    pub fn by_pair<T: Send>(
        &self,
        one: impl Fn(&TracedPairView<'_>) -> Result<T, Error> + Sync,
    ) -> Result<Vec<T>, Error> {
        (0..self.len()).into_par_iter().map(|index| one(&self.pair(index))).collect()
    }
}

/// What paths let expect in the bins of one band.
#[derive(Clone, Debug)]
pub struct ExpectedBins {
    /// Natural logarithm of the energy of each bin.
    pub ln_energy: Vec<f64>,
    /// Variance of it by the tracer's chance, from the scatter between batches of rays.
    pub variance: Vec<f64>,
    /// What each batch of rays moves it by, `[bin * batches + batch]`: the products of two such rows add up to a covariance.
    pub chance: Vec<f32>,
}

/// The traced paths of one pair, and the bins in which their energy is predicted.
#[derive(Clone, Copy)]
pub struct TracedPairView<'a> {
    room: &'a TracedRoomView<'a>,
    pair: &'a TracedPair,
    index: usize,
}

impl<'a> TracedPairView<'a> {
    fn state(&self, band: usize) -> &'a BandState {
        &self.room.simulation.states[self.index][band]
    }

    /// The room.
    pub fn room(&self) -> &'a TracedRoomView<'a> {
        self.room
    }

    /// Its index.
    pub(crate) fn index(&self) -> usize {
        self.index
    }

    /// What the survey says of it.
    pub fn response(&self) -> &'a SurveyedResponse {
        &self.room.survey.responses[self.index]
    }

    /// Its paths.
    pub fn paths(&self) -> &'a PathSet {
        self.pair.paths()
    }

    /// Whether source and receiver see each other.
    pub fn has_direct(&self) -> bool {
        self.pair.has_direct()
    }

    /// Shows all image sources no farther away than this, where [`TracedRoomView::cuboid_faces`] has the faces.
    pub fn for_each_image(&self, max_length_m: f64, visit: &mut dyn FnMut(&ImageSource)) {
        let response = self.response();
        let ends_m =
            [self.room.source(response.source).position_m, self.room.receiver(response.receiver).position_m];
        self.room.simulation.prepared().for_each_image(ends_m, max_length_m, visit);
    }

    /// Paths around edges of the mesh, where source and receiver do not see each other; no part of [`TracedPairView::paths`].
    pub fn diffracted_paths(&self) -> Option<&'a PathSet> {
        self.pair.diffracted_paths()
    }

    /// The air, as it was found.
    pub fn air(&self) -> Air {
        self.pair.air
    }

    /// When the first path arrives, in seconds after the emission.
    pub fn direct_s(&self) -> f64 {
        self.pair.direct_s
    }

    /// Energies of its paths under [`TracedRoomView::materials`], `[band][path]`; computed once.
    ///
    /// # Errors
    /// [`Error::Acoustics`] from the paths.
    pub fn expanded_energies(&self) -> Result<&'a [Vec<f32>], Error> {
        let once = &self.room.energies[self.index];
        if let Some(known) = once.get() {
            return Ok(known);
        }
        let found = self.energies(self.room.materials())?;
        Ok(once.get_or_init(|| found))
    }

    /// Energies of its paths under other materials, `[band][path]`.
    ///
    /// # Errors
    /// [`Error::Acoustics`] for materials of other bands.
    pub fn energies(&self, materials: &[Material]) -> Result<Vec<Vec<f32>>, Error> {
        Ok(self.pair.paths().energies(&Conditions::new(materials, &self.pair.air))?)
    }

    /// Natural logarithm of the predicted energy in the bins of a band, without what its filter lets in of others.
    pub fn ln_energy(&self, band: usize) -> &'a [f64] {
        &self.state(band).ln_energy
    }

    /// Predicted energy in a bin as the band's filter lets it pass, with what leaks in from its neighbours.
    pub fn filtered_energy(&self, band: usize, bin: usize) -> f64 {
        let state = self.state(band);
        let leaks = state.leaks.iter().map(|(_, share, ln)| share * ln[bin].exp());
        state.own_share * state.ln_energy[bin].exp() + leaks.sum::<f64>()
    }

    /// Gathers energies of the paths, one each, in the bins of a band.
    pub fn bin_energies(&self, band: usize, energies: &[f32]) -> Vec<f64> {
        let (bins, pulse) = (self.state(band).bins, &self.room.pulses[band]);
        self.pair.sums(energies, bins, pulse, self.room.simulation.traced_s)
    }

    /// Natural logarithm of the change of the energy in the bins of a band if its paths had these energies, one each.
    pub fn ln_changes(&self, band: usize, energies: &[f32]) -> Vec<f64> {
        let sums = self.bin_energies(band, energies);
        let floor = NOTHING * sums.iter().copied().fold(0.0, f64::max).max(1e-30);
        sums.iter().zip(self.ln_energy(band)).map(|(s, ln)| s.max(floor).ln() - ln).collect()
    }

    /// Energies of the paths (one each) in the bins of a band by class of path, and the mean of what these paths have.
    pub(crate) fn class_sums(&self, band: usize, energies: &[f32], paths: &ClassedPaths) -> Vec<Vec<f64>> {
        let into = (self.state(band).bins, &self.room.pulses[band]);
        self.pair.class_sums(energies, paths, into, self.room.simulation.traced_s)
    }

    /// What laws know of it, at the places and in the air that were found.
    pub(crate) fn law_site(&self) -> LawSite {
        let (room, response) = (self.room, self.response());
        let (source, receiver) = (room.source(response.source), room.receiver(response.receiver));
        LawSite::new(room.scene(), source, receiver, &self.pair.air)
            .with_recording_order(response.recorded_at)
    }

    /// Energies of its paths under laws, `[band][path]`, at the materials of the room.
    pub(crate) fn energies_under(&self, laws: &BoundLaws) -> Result<Vec<Vec<f32>>, Error> {
        let conditions = Conditions::new(self.room.materials(), &self.pair.air).with_laws(laws);
        Ok(self.pair.paths().energies(&conditions)?)
    }

    /// Energies of the paths (one each) that are to be expected in the bins of a band: sampled ones are smoothed over time as far as chance
    /// explains their scatter.
    pub fn expected_energies(&self, band: usize, energies: &[f32]) -> ExpectedBins {
        let (bins, pulse) = (self.state(band).bins, &self.room.pulses[band]);
        let expected = self.pair.expected(energies, bins, pulse, self.room.simulation.traced_s);
        let all: Vec<f64> = (0..expected.len()).map(|bin| expected.sum(bin)).collect();
        let floor = NOTHING * all.iter().copied().fold(0.0, f64::max).max(1e-30);
        let energies = || all.iter().map(|e| e.max(floor));
        let chance: Vec<f64> =
            energies().enumerate().flat_map(|(bin, e)| deviations(expected.batches(bin), e)).collect();
        let batches = usize::from(self.pair.paths().batch_count());
        ExpectedBins {
            ln_energy: energies().map(f64::ln).collect(),
            variance: chance.chunks_exact(batches).map(|own| own.iter().map(|d| d * d).sum()).collect(),
            chance: chance.iter().map(|d| *d as f32).collect(),
        }
    }

    /// Spreads a pulse of energy 1 that arrives so long after the first path over the bins of a band, as the band's filter does; returns one
    /// share for each bin that there is.
    pub fn spread_pulse(&self, band: usize, after_direct_s: f64, add: impl FnMut(usize, f64)) {
        let (bins, pulse) = (self.state(band).bins, &self.room.pulses[band]);
        TracedPair::shares(after_direct_s, bins, pulse, self.state(band).ln_energy.len(), add);
    }

    /// Share of an octave's energy that the filter of a band lets pass; none where it is too little to count.
    pub fn filter_share(&self, band: usize, octave: usize) -> Option<f64> {
        let share = self.room.pulses[band].shares[octave];
        (octave == band || share > TracedPair::MIN_LEAK).then_some(share)
    }

    /// Numbers of reflections of the early exact paths, in the order in which tables of reflections hold them.
    pub fn reflection_orders(&self) -> impl Iterator<Item = usize> + 'a {
        let reflections = &self.room.simulation.isolated_reflections;
        reflections.get(self.index).into_iter().flat_map(|(all, _)| all.iter().map(|r| r.order))
    }

    /// End of the compared time of a band, in seconds after the first path.
    pub fn compared_s(&self, band: usize) -> f64 {
        self.state(band).bins.edge_s(self.room.simulation.ends[self.index][band])
    }
}
