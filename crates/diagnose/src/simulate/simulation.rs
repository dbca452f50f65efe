//! What the simulated room predicts, expanded about a set of absorptions.

mod retracing;

use crate::config::DiagnoseConfig;
use crate::error::Error;
use crate::extend::applied_changes::Dimensions;
use crate::extend::box_object::BoxObject;
use crate::extend::displaced_surface::DisplacedSurface;
use crate::extend::moved_mesh::find_ranges;
use crate::extend::rigid_motion::RigidMotion;
use crate::observe::observations::Observations;
use crate::observe::observed_response::{Measured, PEAKS_S};
use crate::observe::stated_parameter::StatedParameter;
use crate::simulate::band_state::BandState;
use crate::simulate::edges::Edges;
use crate::simulate::met_surfaces::MetSurfaces;
use crate::simulate::monte_carlo_modes;
#[cfg(test)]
use crate::simulate::scene_tracer::Rays;
use crate::simulate::scene_tracer::{PreparedTracer, SceneTracer};
use crate::simulate::table_readings::{TimeAxis, readable};
use crate::simulate::tables::Tables;
use crate::simulate::traced_pair::{Arrival, IsolatedReflection, TracedPair};
use crate::simulate::traced_room::{trace, traced_s, traced_scene, traced_until_s};
#[cfg(test)]
use crate::survey::Place;
use crate::survey::Survey;
use crate::survey::surfaces::{Surfaces, count_reflections};
use rayon::prelude::*;
use sabine_acoustics::{Material, Observer, PerBand};
use sabine_scene::{MeasuredRoom, Receiver, Scene, Source};
use std::sync::Arc;

/// Early time over which the reference energy is the mean, in seconds after the direct sound.
const REFERENCE_S: f64 = 0.05;
/// Exact paths are kept as arrivals for this much longer than peaks are looked for.
const ARRIVALS_MARGIN: f64 = 1.2;
/// A table's values hang on so much more of the decay than is compared bin by bin, in dB: T30 on what comes after its 35 dB.
const TABLE_RANGE_DB: f64 = 15.0;
/// Bounds of absorption.
pub(crate) const ABSORPTION: (f64, f64) = (0.002, 0.98);

/// The room traced for every response, and the energies that follow at the materials of the expansion.
pub(crate) struct Simulation {
    /// Materials as stated.
    pub materials: Vec<Material>,
    pub pairs: Vec<TracedPair>,
    /// Absorption of the expansion, `[material][band]`.
    pub absorption: Vec<Vec<f64>>,
    /// Predictions, `[pair][band]`.
    pub states: Vec<Vec<BandState>>,
    /// First bin that the compared range leaves out, `[pair][band]`.
    pub ends: Vec<Vec<usize>>,
    /// End of the compared time of each band over all pairs, in seconds after the direct sound.
    pub compared_s: Vec<f64>,
    /// Tables of the terms, by slot.
    pub tables: Vec<Tables>,
    /// Early exact paths of each pair, and their energies by band.
    pub isolated_reflections: Vec<(Vec<IsolatedReflection>, Vec<BandState>)>,
    pub direct_s: Vec<f64>,
    pub speed_m_s: Vec<f64>,
    pub arrivals: Vec<Vec<Arrival>>,
    pub reference: Vec<f64>,
    range_db: f64,
    pub traced_s: f64,
    /// Paths are followed until so long after the emission.
    traced_until_s: f64,
    /// Kelvin by which the air was found to be warmer than stated.
    warmer_k: f64,
    /// What is traced: the mesh, with scattering spread over the bands.
    scene: Scene,
    /// The same at the size, and with its surfaces in the places, that were found.
    resized: Option<Scene>,
    /// The size that was found.
    dimensions: Option<Dimensions>,
    /// Surfaces that were found to stand elsewhere, by their number.
    pub displaced: Vec<(usize, DisplacedSurface)>,
    /// Objects that were found in the room.
    objects: Vec<BoxObject>,
    /// The motion of all places that was found: sources and receivers stand where it has brought them.
    coordinate_shift: Option<RigidMotion>,
    /// The surfaces of the mesh as stated.
    surfaces: Arc<Surfaces>,
    /// Which of them the paths meet in the mesh as it is traced.
    met: Arc<MetSurfaces>,
    tracer: Arc<dyn SceneTracer>,
    prepared: Arc<dyn PreparedTracer>,
    edges: Option<Arc<Edges>>,
    pub sources: Vec<Source>,
    pub receivers: Vec<Receiver>,
}

impl Simulation {
    /// Traces every pair of the observations.
    pub fn trace(
        room: &MeasuredRoom,
        observations: &Observations,
        tracer: &Arc<dyn SceneTracer>,
        config: &DiagnoseConfig,
        observer: &dyn Observer,
    ) -> Result<Self, Error> {
        let survey = &observations.survey;
        let materials: Vec<Material> = room.scene().materials().iter().map(|m| m.material.clone()).collect();
        let traced_s = traced_s(survey, &observations.measured, config.range_db);
        let traced_until_s = traced_until_s(survey, traced_s);
        let scene = traced_scene(room, survey, &materials)?;
        let source_m = room.sources()[survey.responses[0].source].position_m;
        let prepared: Arc<dyn PreparedTracer> = tracer.prepare(&scene, traced_until_s)?.into();
        prepared.check(source_m)?;
        let edges = Edges::find(&scene)?.map(Arc::new);
        let surfaces = Arc::new(Surfaces::of(&scene));
        let places = (room.sources(), room.receivers());
        let pairs = trace(places, survey, &materials, (&*prepared, edges.as_deref()), observer)?;
        let clamped = |m: &Material| {
            m.absorption().values().iter().map(|a| a.clamp(ABSORPTION.0, ABSORPTION.1)).collect()
        };
        Ok(Self {
            absorption: materials.iter().map(clamped).collect(),
            direct_s: pairs.iter().map(|p| p.direct_s).collect(),
            speed_m_s: pairs.iter().map(|p| p.speed_m_s).collect(),
            materials,
            pairs,
            states: Vec::new(),
            ends: Vec::new(),
            compared_s: Vec::new(),
            tables: Vec::new(),
            isolated_reflections: Vec::new(),
            arrivals: Vec::new(),
            reference: Vec::new(),
            range_db: config.range_db,
            traced_s,
            traced_until_s,
            warmer_k: 0.0,
            met: Arc::new(MetSurfaces::new(&scene, &surfaces)?),
            surfaces,
            scene,
            resized: None,
            dimensions: None,
            displaced: Vec::new(),
            objects: Vec::new(),
            coordinate_shift: None,
            tracer: Arc::clone(tracer),
            prepared,
            edges,
            sources: room.sources().to_vec(),
            receivers: room.receivers().to_vec(),
        })
    }

    /// Materials of the expansion.
    pub fn expanded_materials(&self) -> Result<Vec<Material>, Error> {
        let one = |(m, a): (&Material, &Vec<f64>)| {
            m.with_absorption(PerBand::from_fn(m.absorption().bands(), |b| a[b]))
        };
        Ok(self.materials.iter().zip(&self.absorption).map(one).collect::<Result<_, _>>()?)
    }

    /// The tracer of that mesh.
    pub fn prepared(&self) -> &dyn PreparedTracer {
        &*self.prepared
    }

    /// The mesh as it is traced, at the size that was found.
    pub fn traced_scene(&self) -> &Scene {
        self.resized.as_ref().unwrap_or(&self.scene)
    }

    /// Energies of all bins at the present absorption; early reflections one by one, too, where wanted.
    pub fn expand(&mut self, observations: &Observations, reflections: bool) -> Result<(), Error> {
        let materials = self.expanded_materials()?;
        let bands = observations.survey.bands;
        let one = |(index, pair): (usize, &TracedPair)| -> Result<_, Error> {
            let energies = pair.energies(&materials)?;
            let states = pair.expand(&energies, bands, &observations.pulses, self.traced_s);
            let isolated = reflections.then(|| {
                let (mut found, states) = pair.isolated_reflections(&energies, bands, PEAKS_S);
                let places_m = self.places_m(&observations.survey, index);
                for r in &mut found {
                    let met = self.met.of(places_m, r.length_m, [r.departure, r.arrival]);
                    r.surfaces = met.unwrap_or_default();
                }
                (found, states)
            });
            Ok((states, isolated))
        };
        let expanded: Vec<_> = self.pairs.par_iter().enumerate().map(one).collect::<Result<_, Error>>()?;
        let isolated: Vec<Option<_>>;
        (self.states, isolated) = expanded.into_iter().unzip();
        if reflections {
            self.isolated_reflections = isolated.into_iter().flatten().collect();
        }
        let range_db = self.range_db + if observations.are_tables() { TABLE_RANGE_DB } else { 0.0 };
        let ends = |s: &Vec<BandState>| s.iter().map(|b| range_end(b, range_db)).collect();
        self.ends = self.states.iter().map(ends).collect();
        self.compared_s =
            (0..observations.survey.bands.len()).map(|b| compared_s(&self.states, &self.ends, b)).collect();
        self.states.par_iter_mut().zip(&self.ends).for_each(|(s, ends)| monte_carlo_modes::find(s, ends));
        self.find_table_chances(&observations.measured);
        self.reference = (0..observations.survey.bands.len())
            .map(|band| {
                let early: Vec<f64> = self
                    .states
                    .iter()
                    .flat_map(|s| {
                        let count = s[band].bins.count(REFERENCE_S).clamp(1, s[band].ln_energy.len().max(1));
                        s[band].ln_energy.iter().take(count).map(|l| l.exp())
                    })
                    .collect();
                (early.iter().sum::<f64>() / early.len().max(1) as f64).max(1e-30)
            })
            .collect();
        Ok(())
    }

    /// How chance moves what tables state, where they take the place of responses.
    pub fn find_table_chances(&mut self, measured: &[Measured]) {
        self.states.par_iter_mut().zip(measured).for_each(|(states, measured)| {
            let stated = measured.table.iter().flatten();
            states.iter_mut().zip(stated).for_each(|(state, own)| state.find_table_chance(own));
        });
    }

    /// Which values of tables the predictions have, `[pair][band][value]`.
    pub fn readable(&self, measured: &[Measured]) -> Vec<Vec<Vec<bool>>> {
        let of_band = |(state, stated): (&BandState, &Vec<StatedParameter>)| {
            readable(stated, TimeAxis { bins: state.bins, time_s: &state.time_s }, &state.ln_energy)
        };
        let of_pair = |(states, measured): (&Vec<BandState>, &Measured)| {
            states.iter().zip(measured.table.iter().flatten()).map(of_band).collect()
        };
        self.states.iter().zip(measured).map(of_pair).collect()
    }

    /// Predicts the arrivals of all pairs; none where the direct line is blocked, nor of tables, which hold no times. The survey learns which
    /// surfaces they meet, and how far these can be moved.
    pub fn predict_arrivals(&mut self, observations: &mut Observations) -> Result<(), Error> {
        let are_timed = !observations.are_tables();
        let survey = &mut observations.survey;
        let materials = self.expanded_materials()?;
        let one = |(index, pair): (usize, &TracedPair)| -> Result<Vec<Arrival>, Error> {
            if !pair.has_direct() || !are_timed {
                return Ok(Vec::new());
            }
            let mut found = pair.arrivals(&materials, PEAKS_S * ARRIVALS_MARGIN)?;
            let places_m = self.places_m(survey, index);
            for a in &mut found {
                a.surfaces = self.met.of(places_m, a.length_m, [a.departure, a.arrival]).unwrap_or_default();
            }
            Ok(found)
        };
        self.arrivals = self.pairs.par_iter().enumerate().map(one).collect::<Result<_, _>>()?;
        let paths = self.arrivals.iter().flatten().map(|a| (a.departure, &a.surfaces[..]));
        count_reflections(&mut survey.surfaces, paths);
        find_ranges(&self.scene, &self.surfaces, survey);
        Ok(())
    }

    /// Where the source and the receiver of a pair stand.
    fn places_m(&self, survey: &Survey, pair: usize) -> [[f64; 3]; 2] {
        let response = &survey.responses[pair];
        [self.sources[response.source].position_m, self.receivers[response.receiver].position_m]
    }
}

#[cfg(test)]
impl Simulation {
    /// Predictions without any path, in a box that could be traced. Energies cannot be expanded again.
    pub fn by_hand(
        survey: &Survey,
        materials: Vec<Material>,
        states: Vec<Vec<BandState>>,
        arrivals: Vec<Vec<Arrival>>,
    ) -> Result<Self, Error> {
        let faces = std::array::from_fn(|face| materials[face % materials.len()].clone());
        let scene = Scene::shoebox([5.0, 4.0, 2.5], faces)?;
        let tracer: Arc<dyn SceneTracer> = Arc::new(Rays { config: DiagnoseConfig::default().tracer() });
        let ends: Vec<Vec<usize>> =
            states.iter().map(|bands| bands.iter().map(|b| b.ln_energy.len()).collect()).collect();
        let source = |p: &Place| Source::omni(p.id.clone(), p.position_m);
        let receiver = |p: &Place| Receiver::omni(p.id.clone(), p.position_m);
        Ok(Self {
            absorption: materials.iter().map(|m| m.absorption().values().to_vec()).collect(),
            compared_s: (0..survey.bands.len()).map(|b| compared_s(&states, &ends, b)).collect(),
            ends,
            tables: Vec::new(),
            isolated_reflections: Vec::new(),
            direct_s: survey.responses.iter().map(|r| r.direct_s).collect(),
            speed_m_s: survey.responses.iter().map(|r| r.air.speed_of_sound_m_s()).collect(),
            reference: vec![0.05; survey.bands.len()],
            pairs: Vec::new(),
            materials,
            states,
            arrivals,
            range_db: 35.0,
            traced_s: 0.3,
            traced_until_s: 0.3,
            warmer_k: 0.0,
            prepared: tracer.prepare(&scene, 0.3)?.into(),
            met: Arc::new(MetSurfaces::new(&scene, &Surfaces::of(&scene))?),
            surfaces: Arc::new(Surfaces::of(&scene)),
            tracer,
            scene,
            resized: None,
            dimensions: None,
            displaced: Vec::new(),
            objects: Vec::new(),
            coordinate_shift: None,
            edges: None,
            sources: survey.sources.iter().map(source).collect::<Result<_, _>>()?,
            receivers: survey.receivers.iter().map(receiver).collect::<Result<_, _>>()?,
        })
    }
}

/// End of the compared time of a band over all pairs, in seconds after the direct sound.
fn compared_s(states: &[Vec<BandState>], ends: &[Vec<usize>], band: usize) -> f64 {
    states.iter().zip(ends).map(|(s, ends)| s[band].bins.edge_s(ends[band])).fold(0.02, f64::max)
}

/// First bin that the compared range leaves out.
fn range_end(state: &BandState, range_db: f64) -> usize {
    let energies: Vec<f64> = state.ln_energy.iter().map(|l| l.exp()).collect();
    let total: f64 = energies.iter().sum();
    let floor = total * 10f64.powf(-range_db / 10.0);
    let mut left = total;
    for (bin, e) in energies.iter().enumerate() {
        if left < floor {
            return bin;
        }
        left -= e;
    }
    energies.len()
}
