//! The room of an extended model: what a tracer needs to render it.

use crate::config::CUBOID_PATHS;
use crate::error::Error;
use crate::extend::displaced_surface::DisplacedSurface;
use crate::extend::extended_model::{Dimensions, ExtendedModel, ThinPanel};
use crate::extend::laws_of_pairs::{bound_laws, check_laws};
use crate::extend::moved_mesh::{check_places, displaced};
use crate::extend::recording_chain::RecordingChain;
use crate::survey::planes::dot;
use crate::survey::surfaces::{minus, unit};
use sabine_acoustics::{
    Air, Bands, Directivity, Error as Cause, ImpulseResponse, Material, Orientation, OutOfRange, PerBand,
    write_atomically,
};
use sabine_paths::Conditions;
use sabine_paths::laws::BoundLaws;
use sabine_scene::{MeasuredRoom, NamedMaterial, Receiver, Scene, Source, Triangle};
use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::Path;

/// A sheet whose corners are no farther from a surface than this lies on it, in metres.
const ON_SURFACE_M: f64 = 0.02;

/// A field and what is wrong with it.
type Fault = (String, Cause);

/// A room with its named causes at work, ready to be traced; [`ExtendedRoom::finish`] then does to a rendered response what
/// happens after propagation.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ExtendedRoom {
    /// Mesh, absorption and scattering, in the bands of the room file.
    pub scene: Scene,
    /// The air that sets the speed of sound.
    pub air: Air,
    /// The air that attenuates.
    pub attenuation: Air,
    /// Sources where they stand, in the order of the room file.
    pub sources: Vec<Source>,
    /// Receivers where they stand, likewise.
    pub receivers: Vec<Receiver>,
    /// Whether sound bends around edges: for [`TracerConfig::diffraction`](sabine_propagate::TracerConfig::diffraction).
    pub diffraction: bool,
    /// Image sources of a cuboid that are to be rendered as pulses, their pressures added: for
    /// [`TracerConfig::cuboid_paths`](sabine_propagate::TracerConfig::cuboid_paths).
    pub cuboid_paths: usize,
    /// Below this frequency in Hz responses are those of the wave equation.
    pub wave_below_hz: Option<f64>,
    /// Pattern and axis of each source; `None` is omnidirectional.
    pub directivities: Vec<Option<(Directivity, Orientation)>>,
    /// The same of each receiver.
    pub receiver_directivities: Vec<Option<(Directivity, Orientation)>>,
    /// Laws of each source and receiver, `[source][receiver]`; empty where there are none.
    laws: Vec<Vec<BoundLaws>>,
    chain: RecordingChain,
}

impl ExtendedRoom {
    /// Materials, air, laws and the patterns of a source and a receiver (indices). Energies are relative to the direct sound on both axes;
    /// [`ExtendedRoom::finish`] makes up for it, so that the source's power and the receiver's sensitivity in a diffuse field are those of
    /// omnidirectional ones.
    ///
    /// # Panics
    /// If there is no such source or receiver.
    pub fn conditions<'a>(
        &'a self,
        materials: &'a [Material],
        source: usize,
        receiver: usize,
    ) -> Conditions<'a> {
        let mut conditions = Conditions::new(materials, &self.air).with_attenuation(&self.attenuation);
        if let Some((pattern, orientation)) = &self.directivities[source] {
            conditions = conditions.with_source(pattern, *orientation);
        }
        if let Some((pattern, orientation)) = &self.receiver_directivities[receiver] {
            conditions = conditions.with_receiver(pattern, *orientation);
        }
        if let Some(laws) = self.laws.get(source) {
            conditions = conditions.with_laws(&laws[receiver]);
        }
        conditions
    }

    /// The measured room with this model of it in place of the stated one. Its air is [`ExtendedRoom::air`], in attenuation too;
    /// patterns of sources, and all that comes after propagation, are left out.
    ///
    /// # Errors
    /// [`Error::Acoustics`] for a room of other materials, sources or receivers than that of the model.
    pub fn measured_room(&self, stated: &MeasuredRoom) -> Result<MeasuredRoom, Error> {
        let (sources, receivers) = (self.sources.clone(), self.receivers.clone());
        Ok(stated.with_model(self.scene.clone(), self.air, sources, receivers)?)
    }

    /// What happens to a response after propagation, which begins at the emission and in which the direct sound at 1 m has
    /// amplitude 1: sound of a coupled volume joins, then gains by octave, noise, clock and latency, truncation, gain and
    /// polarity of the channel. Responses that were exchanged are a matter of names and stay as they are.
    ///
    /// Coupled sound and noise are Gaussian and depend on the seed and the names of source and receiver.
    /// Octaves that are not wholly below half the sample rate receive neither. Octave filters overlap: no octave of noise or of
    /// the gains comes out further below both its neighbours than the filters keep them apart, some 8 dB.
    ///
    /// # Errors
    /// [`Error::Acoustics`] with the cause [`Cause::UnknownId`] for a name that the room does not have, or for a sample rate that
    /// octave filters do not take.
    pub fn finish(
        &self,
        source: &str,
        receiver: &str,
        response: ImpulseResponse,
        seed: u64,
    ) -> Result<ImpulseResponse, Error> {
        let from = self.sources.iter().find(|s| s.id == source);
        let to = self.receivers.iter().find(|r| r.id == receiver);
        let unknown = |id: &str| Cause::UnknownId { id: id.to_owned() };
        let from = from.ok_or_else(|| unknown(source))?;
        let to = to.ok_or_else(|| unknown(receiver))?;
        let distance_m = (0..3).map(|k| (from.position_m[k] - to.position_m[k]).powi(2)).sum::<f64>().sqrt();
        let direct_s = distance_m / self.air.speed_of_sound_m_s();
        self.chain.apply([source, receiver], direct_s, to.position_m, response, seed)
    }
}

impl ExtendedModel {
    /// Reads a model from a TOML file. Names are checked by [`ExtendedModel::room`], which knows them.
    ///
    /// # Errors
    /// [`Error::Model`] for what is not such a file, [`Error::Acoustics`] if it cannot be read or, naming file and field, for a
    /// list that is not as long as `centres_hz` and a value out of range.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let text =
            std::fs::read_to_string(path).map_err(|source| Cause::Io { path: path.to_owned(), source })?;
        let model: Self = toml::from_str(&text)
            .map_err(|source| Error::Model { path: path.to_owned(), source: Box::new(source) })?;
        model.check().map_err(|(field, source)| Cause::InFile {
            path: path.to_owned(),
            field,
            source: Box::new(source),
        })?;
        Ok(model)
    }

    /// The model as TOML.
    ///
    /// # Errors
    /// [`Error::Acoustics`] with the cause [`Cause::Implementation`] if a value has no form in TOML, which none has that passes
    /// the checks of [`ExtendedModel::read`].
    pub fn to_toml(&self) -> Result<String, Error> {
        Ok(toml::to_string(self).map_err(|e| Cause::implementation("extended model as TOML", e))?)
    }

    /// Writes the model to a TOML file, whole or not at all.
    ///
    /// # Errors
    /// As [`ExtendedModel::to_toml`]; [`Error::Acoustics`] if it cannot be written.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let text = self.to_toml()?;
        Ok(write_atomically(path.as_ref(), |file| file.write_all(text.as_bytes()))?)
    }

    /// The room as the model has it. Octaves that the model lacks take the nearest one's values.
    ///
    /// # Errors
    /// [`Error::Displacement`] for surfaces that cannot stand where the model has them;
    /// [`Error::InModel`] naming the field, for a name that the room does not have, a list that is not as long as `centres_hz`, a
    /// value out of range, or a source whose axis neither the model nor the room file states.
    pub fn room(&self, room: &MeasuredRoom) -> Result<ExtendedRoom, Error> {
        let in_model = |(field, source): Fault| Error::InModel { field, source: Box::new(source) };
        let own = self.check().map_err(in_model)?;
        self.check_names(room).map_err(in_model)?;
        let moved = displaced(room.scene(), &self.surfaces)?;
        let built = self.build(room, own, &moved).map_err(in_model)?;
        if !self.surfaces.is_empty() {
            check_places(room.scene(), &moved, &built.sources, &built.receivers)?;
        }
        Ok(built)
    }

    /// The room of a mesh whose surfaces stand where the model has them.
    fn build(&self, room: &MeasuredRoom, own: Bands, moved: &Scene) -> Result<ExtendedRoom, Fault> {
        let bands = room.bands();
        let on_room = |values: &Vec<f64>| PerBand::new(own, values.clone()).map(|v| v.resampled(bands));
        let materials = room
            .scene()
            .materials()
            .iter()
            .map(|named| {
                let stated = &named.material;
                let column = |values: Option<&Vec<f64>>, stated: &PerBand<f64>| {
                    values.map_or_else(|| Ok(stated.clone()), on_room)
                };
                Material::new(
                    column(self.absorption.get(&named.name), stated.absorption())?,
                    column(self.scattering.get(&named.name), stated.scattering())?,
                )
            })
            .collect::<Result<Vec<_>, Cause>>()
            .map_err(|e| ("absorption".to_owned(), e))?;
        let scene = self.scene(room.scene(), moved, materials).map_err(|e| ("dimensions".to_owned(), e))?;
        let stated = room.air();
        let humidity = self.relative_humidity_percent.unwrap_or(stated.relative_humidity_percent());
        let attenuation = Air::new(stated.temperature_c(), humidity, stated.pressure_kpa())
            .map_err(|e| ("relative_humidity_percent".to_owned(), e))?;
        let temperature_c = self.temperature_c.unwrap_or(stated.temperature_c());
        let air = Air::new(temperature_c, humidity, stated.pressure_kpa())
            .map_err(|e| ("temperature_c".to_owned(), e))?;
        let at = |id: &str, stated: [f64; 3]| self.position_m.get(id).copied().unwrap_or(stated);
        let moved = |s: &Source| Source {
            position_m: at(&s.id, s.position_m),
            axis: self.axis.get(&s.id).copied().or(s.axis),
            ..s.clone()
        };
        let sources: Vec<Source> = room.sources().iter().map(moved).collect();
        let heard = |r: &Receiver| Receiver {
            position_m: at(&r.id, r.position_m),
            axis: self.receiver_axis.get(&r.id).copied().or(r.axis),
            ..r.clone()
        };
        let receivers: Vec<Receiver> = room.receivers().iter().map(heard).collect();
        let of_source = |s: &Source| {
            let share = Some(&self.directed_share).filter(|share| !share.is_empty());
            share.map(|share| {
                first_order(share, s.axis, own, bands).map_err(|e| e.of("directed_share", "axis", &s.id))
            })
        };
        let of_receiver = |r: &Receiver| {
            let share = self.receiver_directed_share.get(&r.id);
            share.map(|share| {
                let names = ("receiver_directed_share", "receiver_axis");
                first_order(share, r.axis, own, bands).map_err(|e| e.of(names.0, names.1, &r.id))
            })
        };
        let directivities = sources.iter().map(|s| of_source(s).transpose()).collect::<Result<_, Fault>>()?;
        let receiver_directivities =
            receivers.iter().map(|r| of_receiver(r).transpose()).collect::<Result<_, Fault>>()?;
        let chain = RecordingChain::new(self.clone(), own);
        let laws = bound_laws(&self.laws, &scene, (&sources, &receivers), &air)?;
        let diffraction = self.diffraction;
        let cuboid_paths = if self.coherent_reflections { CUBOID_PATHS } else { 0 };
        Ok(ExtendedRoom {
            scene,
            air,
            attenuation,
            sources,
            receivers,
            diffraction,
            cuboid_paths,
            wave_below_hz: self.wave_below_hz,
            directivities,
            receiver_directivities,
            laws,
            chain,
        })
    }

    fn scene(&self, stated: &Scene, moved: &Scene, materials: Vec<Material>) -> Result<Scene, Cause> {
        let scene = self.with_sheets(moved.with_materials(materials)?)?;
        let Some(change) = &self.dimensions else { return Ok(scene) };
        change.applied(stated, &scene)
    }

    /// Corners of a sheet. One that lies on a surface (a hole just before its wall) stands where that surface stands.
    fn corners_of(&self, sheet: &ThinPanel) -> [[f64; 3]; 4] {
        let lies_on = |surface: &&DisplacedSurface| {
            let normal = unit(surface.normal);
            sheet.corners_m.iter().all(|c| dot(normal, minus(*c, surface.point_m)).abs() < ON_SURFACE_M)
        };
        let Some(surface) = self.surfaces.iter().find(lies_on) else { return sheet.corners_m };
        let normal = unit(surface.normal);
        sheet.corners_m.map(|c| {
            let farther_m = surface.farther_m(c);
            std::array::from_fn(|k| c[k] + farther_m * normal[k])
        })
    }

    /// The scene with the sheets in it, each of a material of its own.
    fn with_sheets(&self, scene: Scene) -> Result<Scene, Cause> {
        if self.sheets.is_empty() {
            return Ok(scene);
        }
        let bands = scene.materials()[0].material.bands();
        let (mut vertices, mut triangles) = (scene.vertices().to_vec(), scene.triangles().to_vec());
        let mut materials = scene.materials().to_vec();
        for (number, sheet) in self.sheets.iter().enumerate() {
            let (first, material) = (vertices.len() as u32, materials.len() as u32);
            vertices.extend(self.corners_of(sheet));
            for corners in [[0, 1, 2], [0, 2, 3]] {
                triangles.push(Triangle { vertices: corners.map(|c| first + c), material });
            }
            materials.push(NamedMaterial {
                name: format!("sheet_{}", number + 1),
                material: Material::uniform(bands, sheet.absorption, 0.0)?,
            });
        }
        Scene::new(vertices, triangles, materials)
    }

    /// Everything that can be said without the room; the bands.
    fn check(&self) -> Result<Bands, Fault> {
        check_laws(&self.laws)?;
        let bands = Bands::from_centres_hz(&self.centres_hz).map_err(|e| ("centres_hz".to_owned(), e))?;
        let check = Checks { bands: bands.len() };
        let empty = Vec::new();
        let coupled = self.coupled.as_ref();
        for (table, columns) in [
            ("absorption", &self.absorption),
            ("scattering", &self.scattering),
            ("receiver_directed_share", &self.receiver_directed_share),
        ] {
            for (name, values) in columns {
                check.per_band(&format!("{table}.{name}"), values, (0.0, 1.0), "between 0 and 1")?;
            }
        }
        for (name, values) in &self.response_band_gain_db {
            let field = format!("response_band_gain_db.{name}");
            check.per_band(&field, values, (-200.0, 200.0), "within 200 dB")?;
        }
        for (field, values, limits, range) in [
            ("gain_db", &self.gain_db, (-200.0, 200.0), "within 200 dB"),
            ("directed_share", &self.directed_share, (0.0, 1.0), "between 0 and 1"),
            ("noise_per_s", &self.noise_per_s, (0.0, 1e6), "between 0 and a million per second"),
        ] {
            if !values.is_empty() {
                check.per_band(field, values, limits, range)?;
            }
        }
        if let Some(coupled) = coupled {
            let most = "between 0 and a million per second";
            check.per_band("coupled.energy_per_s", &coupled.energy_per_s, (0.0, 1e6), most)?;
            let range = "between 0.01 and 100 s";
            check.per_band("coupled.decay_time_s", &coupled.decay_time_s, (0.01, 100.0), range)?;
        }
        let (gradient, centre) =
            coupled.map_or((empty.clone(), empty), |c| (c.gradient_db_per_m.to_vec(), c.centre_m.to_vec()));
        let of_dimensions = |pick: fn(&Dimensions) -> [f64; 3]| {
            self.dimensions.as_ref().map_or(Vec::new(), |d| pick(d).to_vec())
        };
        let one = |value: Option<f64>| value.into_iter().collect::<Vec<f64>>();
        let places = self.position_m.iter().map(|(id, p)| (format!("position_m.{id}"), p));
        let axes = self.axis.iter().map(|(id, p)| (format!("axis.{id}"), p));
        let heard = self.receiver_axis.iter().map(|(id, p)| (format!("receiver_axis.{id}"), p));
        for (field, values) in places.chain(axes).chain(heard) {
            check.each(&field, values, (-1e5, 1e5), "a finite coordinate")?;
        }
        for (name, &gain) in &self.response_gain_db {
            check.each(&format!("response_gain_db.{name}"), &[gain], (-200.0, 200.0), "within 200 dB")?;
        }
        for surface in &self.surfaces {
            check.each("surfaces.point_m", &surface.point_m, (-1e5, 1e5), "a finite coordinate")?;
            let length = dot(surface.normal, surface.normal).sqrt();
            check.each("surfaces.normal", &[length], (0.99, 1.01), "a vector of length 1")?;
            check.each("surfaces.offset_m", &[surface.offset_m], (-2.0, 2.0), "within 2 m")?;
            check.each("surfaces.tilt_deg", &surface.tilt_deg, (-20.0, 20.0), "within 20 degrees")?;
        }
        for sheet in &self.sheets {
            let corners = sheet.corners_m.as_flattened();
            check.each("sheets.corners_m", corners, (-1e5, 1e5), "a finite coordinate")?;
            check.each("sheets.absorption", &[sheet.absorption], (0.0, 1.0), "between 0 and 1")?;
        }
        self.check_gain_over_time(&check)?;
        for (field, values, limits, range) in [
            (
                "relative_humidity_percent",
                one(self.relative_humidity_percent),
                (0.0, 100.0),
                "between 0 and 100 %",
            ),
            ("temperature_c", one(self.temperature_c), (-20.0, 50.0), "between -20 and 50 C"),
            ("clock_ppm", one(self.clock_ppm), (-2e4, 2e4), "within 20000 ppm"),
            ("wave_below_hz", one(self.wave_below_hz), (20.0, 3500.0), "between 20 and 3,500 Hz"),
            ("latency_s", one(self.latency_s), (-10.0, 10.0), "within 10 s"),
            (
                "truncation",
                self.truncation.map_or(Vec::new(), |t| t.to_vec()),
                (0.0, 1e3),
                "between 0 and 1000 s",
            ),
            ("coupled.gradient_db_per_m", gradient, (-100.0, 100.0), "within 100 dB/m"),
            ("coupled.centre_m", centre, (-1e5, 1e5), "a finite coordinate"),
            ("dimensions.scale", of_dimensions(|d| d.scale), (0.5, 2.0), "between 0.5 and 2"),
            ("dimensions.shift_m", of_dimensions(|d| d.shift_m), (-100.0, 100.0), "within 100 m"),
        ] {
            check.each(field, &values, limits, range)?;
        }
        Ok(bands)
    }

    fn check_gain_over_time(&self, check: &Checks) -> Result<(), Fault> {
        let Some(gain) = &self.gain_over_time else { return Ok(()) };
        let (times, gains) = (&gain.time_s, &gain.gain_db);
        if times.len() != gains.len() || times.is_empty() {
            let error = Cause::BandCount { expected: times.len().max(1), found: gains.len() };
            return Err(("gain_over_time.gain_db".to_owned(), error));
        }
        check.each("gain_over_time.time_s", times, (0.0, 1e4), "between 0 and 10000 s")?;
        check.each("gain_over_time.gain_db", gains, (-200.0, 200.0), "within 200 dB")?;
        let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        check.each("gain_over_time.time_s", &steps, (1e-9, 1e4), "rising")
    }

    fn check_names(&self, room: &MeasuredRoom) -> Result<(), Fault> {
        let materials: BTreeSet<&str> = room.scene().materials().iter().map(|m| m.name.as_str()).collect();
        let sources: BTreeSet<&str> = room.sources().iter().map(|s| s.id.as_str()).collect();
        let receivers: BTreeSet<&str> = room.receivers().iter().map(|r| r.id.as_str()).collect();
        let places: BTreeSet<&str> = sources.union(&receivers).copied().collect();
        let pairs: BTreeSet<String> =
            sources.iter().flat_map(|s| receivers.iter().map(move |r| format!("{s}-{r}"))).collect();
        let pairs: BTreeSet<&str> = pairs.iter().map(String::as_str).collect();
        let exchanged: Vec<String> = self.exchanged.iter().flatten().cloned().collect();
        for (field, names, known) in [
            ("absorption", keys(&self.absorption), &materials),
            ("scattering", keys(&self.scattering), &materials),
            ("axis", keys(&self.axis), &sources),
            ("receiver_directed_share", keys(&self.receiver_directed_share), &receivers),
            ("receiver_axis", keys(&self.receiver_axis), &receivers),
            ("position_m", keys(&self.position_m), &places),
            ("response_gain_db", keys(&self.response_gain_db), &pairs),
            ("response_band_gain_db", keys(&self.response_band_gain_db), &pairs),
            ("inverted", self.inverted.clone(), &pairs),
            ("exchanged", exchanged, &pairs),
        ] {
            if let Some(id) = names.into_iter().find(|name| !known.contains(name.as_str())) {
                return Err((field.to_owned(), Cause::UnknownId { id }));
            }
        }
        Ok(())
    }
}

/// What is wrong with a pattern.
enum PatternFault {
    NoAxis,
    Axis(Cause),
    Share(Cause),
}

impl PatternFault {
    /// The fault of a source or receiver in the fields of its shares and its axis.
    fn of(self, share: &str, axis: &str, id: &str) -> Fault {
        match self {
            Self::NoAxis => (format!("{axis}.{id}"), Cause::UnknownId { id: id.to_owned() }),
            Self::Axis(cause) => (format!("{axis}.{id}"), cause),
            Self::Share(cause) => (share.to_owned(), cause),
        }
    }
}

/// A pattern of first order with its orientation.
fn first_order(
    directed_share: &[f64],
    axis: Option<[f64; 3]>,
    own: Bands,
    bands: Bands,
) -> Result<(Directivity, Orientation), PatternFault> {
    let orientation = Orientation::towards(axis.ok_or(PatternFault::NoAxis)?).map_err(PatternFault::Axis)?;
    let omni = directed_share.iter().map(|d| 1.0 - d).collect();
    let pattern = PerBand::new(own, omni)
        .and_then(|shares| Directivity::first_order_per_band(&shares.resampled(bands)))
        .map_err(PatternFault::Share)?;
    Ok((pattern, orientation))
}

fn keys<T>(table: &BTreeMap<String, T>) -> Vec<String> {
    table.keys().cloned().collect()
}

struct Checks {
    bands: usize,
}

impl Checks {
    fn per_band(
        &self,
        field: &str,
        values: &[f64],
        limits: (f64, f64),
        range: &'static str,
    ) -> Result<(), Fault> {
        if values.len() != self.bands {
            let error = Cause::BandCount { expected: self.bands, found: values.len() };
            return Err((field.to_owned(), error));
        }
        self.each(field, values, limits, range)
    }

    #[allow(clippy::unused_self)] // reads as the other check does
    fn each(
        &self,
        field: &str,
        values: &[f64],
        (low, high): (f64, f64),
        range: &'static str,
    ) -> Result<(), Fault> {
        match values.iter().find(|v| !(low..=high).contains(*v)) {
            Some(&value) => {
                Err((field.to_owned(), Cause::OutOfRange(OutOfRange { field: "value", value, range })))
            }
            None => Ok(()),
        }
    }
}
