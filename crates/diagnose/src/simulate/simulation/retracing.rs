//! Re-tracing after a position, the air, the dimensions or a surface change; and what fewer rays predict.

use super::Simulation;
use crate::effect::Nuisance;
use crate::error::Error;
use crate::extend::applied_changes::Dimensions;
use crate::extend::box_object::BoxObject;
use crate::extend::displaced_surface::DisplacedSurface;
use crate::extend::model_change::ModelChange;
use crate::extend::moved_mesh::{DisplacementError, check_places, displaced_among};
use crate::extend::rigid_motion::RigidMotion;
use crate::simulate::edges::Edges;
use crate::simulate::met_surfaces::MetSurfaces;
use crate::simulate::traced_pair::TracedPair;
use crate::survey::Survey;
use rayon::prelude::*;
use sabine_acoustics::Air;
use std::sync::Arc;

/// How the room differs from the mesh as stated.
struct Shape {
    dimensions: Option<Dimensions>,
    displaced: Vec<(usize, DisplacedSurface)>,
    objects: Vec<BoxObject>,
}

impl Simulation {
    /// Takes a change into all paths that it moves, and says whether there are any. Energies follow with the next expansion; arrival times
    /// stay relative to what is stated.
    pub fn apply(&mut self, change: &ModelChange, survey: &Survey) -> Result<bool, Error> {
        match change {
            ModelChange::Position { id, position_m } => {
                let position_m = self.coordinate_shift.map_or(*position_m, |m| m.moved(*position_m));
                if let Some(i) = self.sources.iter().position(|s| s.id == *id) {
                    self.sources[i].position_m = position_m;
                    self.retrace(Nuisance::SourcePosition(i), survey)?;
                } else if let Some(i) = self.receivers.iter().position(|r| r.id == *id) {
                    self.receivers[i].position_m = position_m;
                    self.retrace(Nuisance::ReceiverPosition(i), survey)?;
                }
            }
            ModelChange::CoordinateShift(motion) => self.shift(motion, survey)?,
            ModelChange::Temperature(celsius) => {
                let warmer_k = celsius - survey.air.temperature_c();
                if warmer_k == 0.0 {
                    return Ok(false);
                }
                self.warmer_k = warmer_k;
                (0..self.pairs.len()).try_for_each(|pair| self.set_air(pair, survey))?;
            }
            ModelChange::Dimensions(dimensions) => {
                let shape = Shape { dimensions: Some(dimensions.clone()), ..self.shape() };
                self.reshape(shape, survey)?;
            }
            ModelChange::SurfaceDisplacement(surface) => {
                let mut displaced = self.displaced.clone();
                displaced.retain(|(_, other)| !other.is_same_surface(surface));
                let number = survey.surfaces.iter().position(|s| s.centre_m == surface.point_m);
                let unknown = || DisplacementError::NoSurface { point_m: surface.point_m };
                displaced.push((number.ok_or_else(unknown)?, surface.clone()));
                self.reshape(Shape { displaced, ..self.shape() }, survey)?;
            }
            ModelChange::Object(object) => {
                let objects = [&self.objects[..], std::slice::from_ref(object)].concat();
                self.reshape(Shape { objects, ..self.shape() }, survey)?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Moves all places from the coordinates of the room file, and traces all pairs again.
    fn shift(&mut self, motion: &RigidMotion, survey: &Survey) -> Result<(), Error> {
        let before = self.coordinate_shift.replace(*motion);
        let in_file = |place_m: [f64; 3]| before.map_or(place_m, |m| m.before(place_m));
        let turn_deg = motion.turn_deg - before.map_or(0.0, |m| m.turn_deg);
        let turn = RigidMotion::new([0.0; 3], turn_deg, [0.0; 3]);
        let sources = self.sources.iter_mut().map(|s| (&mut s.position_m, &mut s.axis));
        let receivers = self.receivers.iter_mut().map(|r| (&mut r.position_m, &mut r.axis));
        for (place_m, axis) in sources.chain(receivers) {
            *place_m = motion.moved(in_file(*place_m));
            *axis = axis.map(|a| turn.turned(a));
        }
        (0..self.sources.len()).try_for_each(|source| self.retrace(Nuisance::SourcePosition(source), survey))
    }

    fn shape(&self) -> Shape {
        Shape {
            dimensions: self.dimensions.clone(),
            displaced: self.displaced.clone(),
            objects: self.objects.clone(),
        }
    }

    /// Traces all pairs in the room of another shape. Nothing changes if there is no such room.
    fn reshape(&mut self, shape: Shape, survey: &Survey) -> Result<(), Error> {
        let all: Vec<DisplacedSurface> = shape.displaced.iter().map(|(_, surface)| surface.clone()).collect();
        let moved = displaced_among(&self.scene, &self.surfaces, &all)?;
        if !all.is_empty() {
            check_places(&self.scene, &moved, &self.sources, &self.receivers)?;
        }
        let resized = match &shape.dimensions {
            Some(dimensions) => dimensions.applied(&self.scene, &moved)?,
            None => moved,
        };
        let resized = shape.objects.iter().try_fold(resized, |scene, object| object.added_to(&scene))?;
        if !shape.objects.is_empty() {
            check_places(&self.scene, &resized, &self.sources, &self.receivers)?;
        }
        self.met = Arc::new(MetSurfaces::new(&resized, &self.surfaces)?);
        self.prepared = self.tracer.prepare(&resized, self.traced_until_s)?.into();
        self.edges = Edges::find(&resized)?.map(Arc::new);
        self.resized = Some(resized);
        (self.dimensions, self.displaced, self.objects) = (shape.dimensions, shape.displaced, shape.objects);
        (0..self.sources.len()).try_for_each(|source| self.retrace(Nuisance::SourcePosition(source), survey))
    }

    /// Whether rays were drawn, and each of so many parts of them found paths wherever they did.
    pub fn can_be_parted(&self, parts: u8) -> bool {
        let found: Vec<u8> = self.pairs.iter().map(|pair| pair.parts_with_paths(parts)).collect();
        found.contains(&parts) && found.iter().all(|&found| found == 0 || found == parts)
    }

    /// The same room as it stands, as one of `parts` equal parts of the rays predicts it; nothing is expanded yet.
    pub fn part_of_rays(&self, part: u8, parts: u8) -> Result<Self, Error> {
        let of_pair = |pair: &TracedPair| pair.part_of_rays(part, parts, &self.materials);
        Ok(Self {
            pairs: self.pairs.par_iter().map(of_pair).collect::<Result<_, _>>()?,
            materials: self.materials.clone(),
            absorption: self.absorption.clone(),
            states: Vec::new(),
            ends: Vec::new(),
            compared_s: Vec::new(),
            tables: Vec::new(),
            isolated_reflections: Vec::new(),
            direct_s: self.direct_s.clone(),
            speed_m_s: self.speed_m_s.clone(),
            arrivals: self.arrivals.clone(),
            reference: Vec::new(),
            scene: self.scene.clone(),
            resized: self.resized.clone(),
            dimensions: self.dimensions.clone(),
            displaced: self.displaced.clone(),
            objects: self.objects.clone(),
            surfaces: Arc::clone(&self.surfaces),
            met: Arc::clone(&self.met),
            tracer: Arc::clone(&self.tracer),
            prepared: Arc::clone(&self.prepared),
            edges: self.edges.clone(),
            sources: self.sources.clone(),
            receivers: self.receivers.clone(),
            ..*self
        })
    }

    /// Traces the pairs of a place again. If the fitted position lies outside the room, the paths from the stated one are kept.
    fn retrace(&mut self, place: Nuisance, survey: &Survey) -> Result<(), Error> {
        for pair in 0..survey.responses.len() {
            let response = &survey.responses[pair];
            let concerned = place == Nuisance::SourcePosition(response.source)
                || place == Nuisance::ReceiverPosition(response.receiver);
            if !concerned {
                continue;
            }
            let ends = (&self.sources[response.source], &self.receivers[response.receiver]);
            if let Ok(paths) = self.prepared.trace(ends.0, ends.1, &response.air) {
                let places_m = [ends.0.position_m, ends.1.position_m];
                let diffracted = Edges::paths(self.edges.as_deref(), places_m, paths.max_length_m());
                self.pairs[pair] = TracedPair::new(paths, diffracted, response.air, &self.materials)?;
                self.direct_s[pair] = self.pairs[pair].direct_s;
                self.set_air(pair, survey)?;
            }
        }
        Ok(())
    }

    /// The air of a pair, as it was found.
    fn set_air(&mut self, pair: usize, survey: &Survey) -> Result<(), Error> {
        if self.warmer_k == 0.0 {
            return Ok(());
        }
        let stated = survey.responses[pair].air;
        let temperature_c = (stated.temperature_c() + self.warmer_k).clamp(-40.0, 60.0);
        let air = Air::new(temperature_c, stated.relative_humidity_percent(), stated.pressure_kpa())?;
        self.pairs[pair].set_air(air);
        self.direct_s[pair] = self.pairs[pair].direct_s;
        Ok(())
    }
}
