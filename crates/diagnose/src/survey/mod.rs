//! What was measured, as effects see it.

pub(crate) mod path_stops;
pub(crate) mod planes;
pub(crate) mod surfaces;

use crate::survey::planes::Plane;
use crate::survey::surfaces::Surface;
use sabine_acoustics::{Air, Bands};
use sabine_scene::{MaterialPrior, Measurement};

/// Recordings below which nothing is said of what goes with their order.
pub(crate) const LEAST_RECORDINGS: usize = 6;

/// One response of the survey.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SurveyedResponse {
    /// Index of its source.
    pub source: usize,
    /// Index of its receiver.
    pub receiver: usize,
    /// Its name: source and receiver.
    pub name: String,
    /// The air that the room file states for it.
    pub air: Air,
    /// Length in seconds.
    pub duration_s: f64,
    /// When the direct sound comes, in seconds from the first sample.
    pub direct_s: f64,
    /// When it is louder than at its end for the last time, in seconds from the first sample, to 20 ms.
    pub sounds_until_s: f64,
    /// A number that rises with the time of recording, where the room file states it.
    pub recorded_at: Option<f64>,
}

/// A source or a receiver.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Place {
    /// Its name.
    pub id: String,
    /// Metres.
    pub position_m: [f64; 3],
    /// Acoustic axis, where the room file states one.
    pub axis: Option<[f64; 3]>,
    /// How well the position is known: one standard deviation along each axis, in metres.
    pub position_sd_m: f64,
}

/// What the room file and the responses say, before any fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Survey {
    pub(crate) bands: Bands,
    pub(crate) air: Air,
    pub(crate) air_assumed: bool,
    pub(crate) measurement: Measurement,
    pub(crate) materials: Vec<String>,
    pub(crate) absorption_priors: Vec<MaterialPrior>,
    pub(crate) sources: Vec<Place>,
    pub(crate) receivers: Vec<Place>,
    pub(crate) responses: Vec<SurveyedResponse>,
    pub(crate) box_m: [[f64; 3]; 2],
    pub(crate) declared_scattering: f64,
    pub(crate) planes: Vec<Plane>,
    pub(crate) surfaces: Vec<Surface>,
    pub(crate) material_areas_m2: Vec<f64>,
    pub(crate) diffracted: Vec<usize>,
    /// Lowest bands for which there is a wave solution.
    pub(crate) bands_of_modes: usize,
}

impl Survey {
    /// Bands in which energies are compared.
    pub fn bands(&self) -> Bands {
        self.bands
    }

    /// The air of the room file.
    pub fn air(&self) -> Air {
        self.air
    }

    /// Whether the room file is silent about the air.
    pub fn air_assumed(&self) -> bool {
        self.air_assumed
    }

    /// What times and levels of the responses mean.
    pub fn measurement(&self) -> Measurement {
        self.measurement
    }

    /// Names of the materials.
    pub fn materials(&self) -> &[String] {
        &self.materials
    }

    /// What the room file says of a material's absorption.
    pub fn absorption_prior(&self, material: usize) -> &MaterialPrior {
        &self.absorption_priors[material]
    }

    /// Sources.
    pub fn sources(&self) -> &[Place] {
        &self.sources
    }

    /// Receivers.
    pub fn receivers(&self) -> &[Place] {
        &self.receivers
    }

    /// Responses.
    pub fn responses(&self) -> &[SurveyedResponse] {
        &self.responses
    }

    /// Two opposite corners of the mesh, in metres.
    pub fn box_m(&self) -> [[f64; 3]; 2] {
        self.box_m
    }

    /// The largest flat surfaces of the mesh, each of one material.
    pub fn planes(&self) -> &[Plane] {
        &self.planes
    }

    /// All planar surfaces of the mesh, whatever they are made of, in the order of their first triangles.
    pub fn surfaces(&self) -> &[Surface] {
        &self.surfaces
    }

    /// Responses (indices) whose source and receiver do not see each other, with an edge of the mesh between them.
    pub fn diffracted_responses(&self) -> &[usize] {
        &self.diffracted
    }

    /// Area of a material in square metres.
    pub fn material_area_m2(&self, material: usize) -> f64 {
        self.material_areas_m2[material]
    }

    /// Octaves from 1 kHz to a band: -3 for 125 Hz.
    pub fn octaves_from_1khz(&self, band: usize) -> f64 {
        (self.bands.exact_hz(band) / 1000.0).log2()
    }
}
