//! Random rooms, measured with effects at work that the room file does not tell of.
//!
//! Physics: image sources of a box as pressure pulses with an amplitude for each octave, octaves joined by filters of zero phase
//! whose crossovers are an eighth of an octave wide; air per octave at its exact centre (ISO 9613-1); a random sign for every image
//! of every pair but for the direct sound, the same in all octaves, so that energies add up and no standing waves arise
//! (unless [`LabConfig::positive_reflections`]). Where surfaces scatter, images
//! keep (1 - scattering) of each reflection, and particles (Lambert) carry the rest: their energy at the receivers is filled with Gaussian
//! noise. It shares no code with the tracer, nor with what fits or diagnoses.
//!
//! Always there, and not told: microphones differ by 0.3 dB, receivers are 5 mm (standard deviation along each axis) from where they
//! are said to be, materials differ from their tables by the stated standard deviation (0.03, of some 0.06) in each octave, and white
//! noise adds up over a response to -63 dB of the response's energy in the octave where it is worst. Responses end
//! when the slowest octave has fallen by 65 dB.
//!
//! What it does **not** do: phase at walls (nor angle, but where that is the effect), standing waves, diffraction, rooms other than boxes. The
//! particles' first passages are blurred by the time that sound takes across a sphere of 1 m. Only where [`Hidden::RoomModes`] is at work
//! are there standing waves, of the box alone, and then no second room is heard below their crossover.
//!
//! Order of events: the room, the source, the way, the microphone (noise joins here), the channel, the recorder. An effect changes the
//! truth ([`Truth`]) or acts on samples; a new one is a variant of [`Hidden`], a file for its physics, and a line where it acts.
//!
//! References: J. B. Allen and D. A. Berkley, JASA 65 (1979) 943 (image sources); H. Kuttruff, *Room Acoustics*, 6th ed., 4.1 and 4.2
//! (decay in a box of mirrors, density of images), 5.1 (scattering walls); ISO 9613-1:1993 (air).

mod at_work;
mod box_decay;
mod column_loudspeaker;
mod columns;
mod config;
mod coupled_tail;
mod distortion;
mod fog;
mod helmholtz;
mod hidden;
mod image_field;
mod layered_air;
mod limp_wall;
mod missing_surfaces;
mod modal_field;
mod noise;
mod octave_mean;
mod panel;
mod patch;
pub(crate) mod random_room;
mod recorder;
mod reflection_by_angle;
mod scattered_field;
mod screened_room;
pub(crate) mod steep_bands;
pub(crate) mod stream;
mod truth;
mod typical;
mod unfolded;
mod warming;

pub use config::LabConfig;
pub use hidden::{End, Fault, Gap, Hidden};
pub use screened_room::{ScreenedConfig, ScreenedRoom};
pub use truth::{TrueMaterial, TrueMicrophone, TrueSession, TrueSource, Truth};

use box_decay::BoxDecay;
use columns::Columns;
use noise::{BandEnergies, Noise};
use random_room::Declared;
use rayon::prelude::*;
use sabine_acoustics::{Air, Bands, Error, ImpulseResponse, Material, PerBand};
use sabine_scene::{
    MaterialPrior, MeasuredRoom, Measurement, NamedMaterial, NewResponse, NewRoom, PositionSd, Receiver,
    Scene, Source, Triangle,
};
use scattered_field::ScatteredField;
use std::io;
use std::path::Path;
use truth::Medium;

/// One random room, drawn from a seed.
///
/// ```
/// use sabine_testkit::{Hidden, LabConfig, Laboratory};
/// let lab = Laboratory::new(LabConfig { seed: 7, receivers: 2, ..LabConfig::default() })?;
/// let late = lab.responses(&[Hidden::TimeZero { latency_s: 0.01 }])?;
/// let onset = |r: &sabine_acoustics::ImpulseResponse| {
///     r.samples().iter().position(|s| s.abs() > 0.5 * r.peak()).unwrap()
/// };
/// assert_eq!(onset(&late[0]) - onset(&lab.responses(&[])?[0]), 480);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Laboratory {
    config: LabConfig,
    bands: Bands,
    scene: Scene,
    priors: Vec<MaterialPrior>,
    air: Air,
    sources: Vec<Source>,
    receivers: Vec<Receiver>,
    /// The room with nothing hidden but what always is.
    truth: Truth,
}

impl Laboratory {
    /// Draws a room.
    ///
    /// Sides of 3 to 9 m, height 2.4 to 4 m, volume 35 to 200 m3, three to five materials with absorption 0.03 to 0.6 and no
    /// scattering, Eyring's reverberation time 0.25 to 0.9 s in every octave, 5 to 33 C, 15 to 85 %, places at least 0.6 m
    /// from walls and 0.8 m from each other.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a configuration outside what [`LabConfig`] says, or for which no room can be found.
    pub fn new(config: LabConfig) -> Result<Self, Error> {
        config.check()?;
        let (declared, truth) = random_room::draw(&config)?;
        let bands = config.bands;
        let scene = scene(bands, &declared, &truth)?;
        let priors = declared
            .absorption
            .iter()
            .zip(&declared.absorption_sd)
            .map(|(table, sd)| {
                let absorption = Some(PerBand::new(bands, table.clone())?);
                Ok(MaterialPrior { absorption, absorption_sd: PerBand::new(bands, sd.clone())? })
            })
            .collect::<Result<_, Error>>()?;
        let mut sources = Vec::new();
        for (i, (&place, source)) in declared.sources_m.iter().zip(&truth.sources).enumerate() {
            let axis = config.orientation.then_some(source.axis);
            sources.push(Source { axis, ..Source::omni(format!("s{}", i + 1), place)? });
        }
        let receivers = declared
            .receivers_m
            .iter()
            .enumerate()
            .map(|(i, &place)| {
                let axis = config.microphone_axes.then(|| truth.microphones[i].axis);
                Ok(Receiver { axis, ..Receiver::omni(format!("r{}", i + 1), place)? })
            })
            .collect::<Result<_, Error>>()?;
        let air = truth.air()?;
        Ok(Self { config, bands, scene, priors, air, sources, receivers, truth })
    }

    /// What was asked for.
    pub fn config(&self) -> &LabConfig {
        &self.config
    }

    /// Mesh and materials as declared.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// How far each material is trusted, as declared.
    pub fn priors(&self) -> &[MaterialPrior] {
        &self.priors
    }

    /// The air as declared.
    pub fn air(&self) -> Air {
        self.air
    }

    /// Sources as declared.
    pub fn sources(&self) -> &[Source] {
        &self.sources
    }

    /// Receivers as declared.
    pub fn receivers(&self) -> &[Receiver] {
        &self.receivers
    }

    /// The room as it is with these effects at work, one after another.
    ///
    /// # Errors
    /// [`Error::OutOfRange`], [`Error::BandCount`] or [`Error::Index`] for an effect that does not fit the room.
    pub fn truth(&self, effects: &[Hidden]) -> Result<Truth, Error> {
        let mut truth = self.truth.clone();
        for effect in effects {
            effect.apply(&mut truth)?;
        }
        truth.keep_inside();
        modal_field::check(&truth)?;
        truth.duration_s = (random_room::fallen_s(&truth)? + random_room::MARGIN_S)
            .max(truth.duration_s)
            .max(coupled_tail::tails_end_s(effects));
        truth.duration_s += truth.latencies_s.iter().copied().fold(0.0, f64::max);
        Ok(truth)
    }

    /// The true mesh and materials with these effects at work, in the coordinates of the declared room: what a simulation would have to
    /// know.
    ///
    /// # Errors
    /// As [`Laboratory::truth`].
    pub fn true_scene(&self, effects: &[Hidden]) -> Result<Scene, Error> {
        let truth = self.truth(effects)?;
        let materials = truth
            .materials
            .iter()
            .map(|m| {
                let column = |values: &Vec<f64>| PerBand::new(self.bands, values.clone());
                Material::new(column(&m.absorption)?, column(&m.scattering)?)
            })
            .collect::<Result<_, Error>>()?;
        let vertices = self.scene.vertices().iter().map(|v| {
            std::array::from_fn(|k| truth.origin_m[k] + v[k] * truth.size_m[k] / self.truth.size_m[k])
        });
        let scene = self.scene.with_materials(materials)?;
        Scene::new(vertices.collect(), scene.triangles().to_vec(), scene.materials().to_vec())
    }

    /// The responses with these effects at work, source by source. The same on any number of threads.
    ///
    /// # Errors
    /// As [`Laboratory::truth`].
    pub fn responses(&self, effects: &[Hidden]) -> Result<Vec<ImpulseResponse>, Error> {
        self.render(&self.truth(effects)?)
    }

    fn render(&self, truth: &Truth) -> Result<Vec<ImpulseResponse>, Error> {
        let rate_hz = f64::from(self.config.sample_rate_hz);
        let samples = (truth.duration_s * rate_hz).ceil() as usize;
        let sessions: Vec<Session> =
            (0..truth.sessions.len()).map(|i| Session::new(truth.in_session(i))).collect::<Result<_, _>>()?;
        let render = |index: usize| -> Result<(Vec<f64>, BandEnergies), Error> {
            let pair = (index / truth.receivers_m.len(), index % truth.receivers_m.len());
            let Session { truth, medium, decay, scattered } = &sessions[truth.session(pair.1)];
            let mut columns = Columns {
                samples: vec![vec![0.0; samples]; self.bands.len()],
                rate_hz: rate_hz * (1.0 + 1e-6 * truth.clock_ppm),
                start_s: -truth.latencies_s[index],
            };
            image_field::add_images(truth, medium, decay, pair, &mut columns);
            if let Some(field) = &scattered[pair.0] {
                field.add(truth, pair, &mut columns);
            }
            coupled_tail::add_tails(truth, medium, pair, &mut columns);
            let energies = BandEnergies::of(&columns.samples, rate_hz);
            let rate = self.config.sample_rate_hz;
            let joined = steep_bands::join_steeply(self.bands, columns.samples, rate);
            Ok((modal_field::join(truth, medium, self.bands, index, rate, joined)?, energies))
        };
        let rendered: Result<Vec<_>, Error> = (0..truth.responses()).into_par_iter().map(render).collect();
        let (mut responses, energies): (Vec<Vec<f64>>, Vec<BandEnergies>) = rendered?.into_iter().unzip();
        distortion::add_harmonics(truth, rate_hz, &mut responses);
        let noise = Noise::new(truth, &energies, samples);
        responses.par_iter_mut().enumerate().for_each(|(index, samples)| {
            noise.add(truth, index, self.bands, self.config.sample_rate_hz, samples);
            recorder::record(truth, index, self.bands, self.config.sample_rate_hz, samples);
        });
        recorder::swap(truth, &mut responses);
        responses
            .into_iter()
            .map(|r| {
                let samples = r.into_iter().map(|s| s as f32).collect();
                ImpulseResponse::new(samples, self.config.sample_rate_hz)
            })
            .collect()
    }

    /// Writes the measured room with the effects at work into a new folder, and the truth, if it is wanted, into a TOML file
    /// elsewhere.
    ///
    /// # Errors
    /// As [`Laboratory::truth`] and [`NewRoom::write`]; [`Error::Io`] if the truth cannot be written, or would lie within the
    /// folder. Neither is left behind if the other fails.
    pub fn write(
        &self,
        effects: &[Hidden],
        folder: &Path,
        truth_file: Option<&Path>,
    ) -> Result<MeasuredRoom, sabine_scene::Error> {
        let truth = self.truth(effects)?;
        // Two ways to say where something is must not hide that it is the same place.
        let full = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        if let Some(path) = truth_file.filter(|path| full(path).starts_with(full(folder))) {
            let source =
                io::Error::new(io::ErrorKind::InvalidInput, "the truth must not lie within the room");
            return Err(Error::Io { path: path.to_owned(), source }.into());
        }
        let room = self.new_room(self.render(&truth)?)?;
        if let Some(path) = truth_file {
            truth.write(path)?;
        }
        room.write(folder).inspect_err(|_| {
            if let Some(path) = truth_file {
                // The error that counts is the room's.
                let _ = std::fs::remove_file(path);
            }
        })
    }

    fn new_room(&self, responses: Vec<ImpulseResponse>) -> Result<NewRoom, Error> {
        let receivers = self.receivers.len();
        let several = self.config.sessions > 1;
        let entry = |(index, samples): (usize, ImpulseResponse)| -> Result<NewResponse, Error> {
            let (source, receiver) =
                (&self.sources[index / receivers].id, &self.receivers[index % receivers].id);
            let session = self.truth.session(index % receivers);
            Ok(NewResponse {
                source: source.clone(),
                receiver: receiver.clone(),
                name: format!("{source}_{receiver}"),
                air: several.then(|| self.truth.in_session(session).air()).transpose()?,
                session: several.then(|| format!("session {}", session + 1)),
                recorded_at: self.config.recording_order.then(|| self.truth.recorded_at[index]),
                samples,
            })
        };
        Ok(NewRoom {
            scene: self.scene.clone(),
            priors: self.priors.clone(),
            air: Some(self.air),
            measurement: Measurement { time_zero: self.config.time_zero, levels: self.config.levels },
            position_sd: PositionSd::default(),
            sources: self.sources.clone(),
            receivers: self.receivers.clone(),
            responses: responses.into_iter().enumerate().map(entry).collect::<Result<_, _>>()?,
        })
    }

    pub(crate) fn null(&self) -> &Truth {
        &self.truth
    }
}

/// What a session's responses have in common.
struct Session {
    truth: Truth,
    medium: Medium,
    decay: BoxDecay,
    scattered: Vec<Option<ScatteredField>>,
}

impl Session {
    fn new(truth: Truth) -> Result<Self, Error> {
        let medium = truth.medium()?;
        // A little longer, so that no image is missed at the end.
        let decay = BoxDecay::new(&truth, &medium, truth.duration_s + 0.2);
        let scattered = (0..truth.sources.len()).map(|s| ScatteredField::new(&truth, &medium, s)).collect();
        Ok(Self { truth, medium, decay, scattered })
    }
}

/// The declared box: as many materials as there are, each on its faces.
fn scene(bands: Bands, declared: &Declared, truth: &Truth) -> Result<Scene, Error> {
    let materials: Vec<NamedMaterial> = declared
        .absorption
        .iter()
        .zip(&truth.materials)
        .map(|(table, real)| {
            let absorption = PerBand::new(bands, table.clone())?;
            let material = Material::new(absorption, PerBand::uniform(bands, 0.0))?;
            Ok(NamedMaterial { name: real.name.clone(), material })
        })
        .collect::<Result<_, Error>>()?;
    let of_face = truth.faces.map(|m| materials[m].material.clone());
    let plain = Scene::shoebox(truth.size_m, of_face)?;
    let triangles = plain
        .triangles()
        .iter()
        .map(|t| Triangle { material: truth.faces[t.material as usize] as u32, ..*t })
        .collect();
    Scene::new(plain.vertices().to_vec(), triangles, materials)
}
