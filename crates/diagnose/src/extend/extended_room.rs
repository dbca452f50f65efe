//! The room of an extended model: what a tracer needs to render it.

use crate::config::CUBOID_PATHS;
use crate::error::Error;
use crate::extend::applied_changes::{AppliedChanges, ThinPanel};
use crate::extend::displaced_surface::DisplacedSurface;
use crate::extend::laws_of_pairs::bound_laws;
use crate::extend::model_checks::Fault;
use crate::extend::moved_mesh::{check_places, displaced};
use crate::extend::recording_chain::RecordingChain;
use crate::survey::planes::dot;
use crate::survey::surfaces::{minus, unit};
use sabine_acoustics::{
    Air, Bands, Directivity, Error as Cause, ImpulseResponse, Material, Orientation, PerBand,
};
use sabine_paths::Conditions;
use sabine_paths::laws::BoundLaws;
use sabine_scene::{MeasuredRoom, NamedMaterial, Receiver, Scene, Source, Triangle};

/// A sheet whose corners are no farther from a surface than this lies on it, in metres.
const ON_SURFACE_M: f64 = 0.02;

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
    /// By which share all walls react locally: 0 is absorption that is the same at all angles.
    pub locally_reacting_share: f64,
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
        if self.locally_reacting_share != 0.0 {
            conditions = conditions.with_local_reaction(self.locally_reacting_share, materials);
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

impl AppliedChanges {
    /// [`ExtendedModel::room`](crate::ExtendedModel::room).
    pub(super) fn room(&self, room: &MeasuredRoom) -> Result<ExtendedRoom, Error> {
        let in_model = |(field, source): Fault| Error::InModel { field, source: Box::new(source) };
        let own = self.check().map_err(in_model)?;
        self.check_names(room).map_err(in_model)?;
        let moved = displaced(room.scene(), &self.surfaces)?;
        let built = self.build(room, own, &moved).map_err(in_model)?;
        if !self.surfaces.is_empty() {
            check_places(room.scene(), &moved, &built.sources, &built.receivers)?;
        }
        if !self.objects.is_empty() {
            check_places(room.scene(), &built.scene, &built.sources, &built.receivers)?;
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
        let (sources, receivers) = self.placed(room);
        let of_source = |s: &Source| {
            let share = Some(&self.directed_share).filter(|share| !share.is_empty());
            share.map(|share| {
                first_order(share, s.axis, own, bands).map_err(|e| e.of("source_pattern", &s.id))
            })
        };
        let of_receiver = |r: &Receiver| {
            let share = self.receiver_directed_share.get(&r.id);
            share.map(|share| {
                first_order(share, r.axis, own, bands).map_err(|e| e.of("receiver_pattern", &r.id))
            })
        };
        let directivities = sources.iter().map(|s| of_source(s).transpose()).collect::<Result<_, Fault>>()?;
        let receiver_directivities =
            receivers.iter().map(|r| of_receiver(r).transpose()).collect::<Result<_, Fault>>()?;
        let chain = RecordingChain::new(self.clone(), own);
        let laws = bound_laws(&self.laws, &scene, (&sources, &receivers), (&air, room))?;
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
            locally_reacting_share: self.locally_reacting_share.unwrap_or(0.0),
            laws,
            chain,
        })
    }

    /// Sources and receivers where they stand, with their axes.
    fn placed(&self, room: &MeasuredRoom) -> (Vec<Source>, Vec<Receiver>) {
        let motion = self.coordinate_shift;
        let at = |id: &str, stated: [f64; 3]| {
            let place_m = self.position_m.get(id).copied().unwrap_or(stated);
            motion.map_or(place_m, |m| m.moved(place_m))
        };
        let turned = |stated: Option<[f64; 3]>| match motion {
            Some(m) => stated.map(|axis| m.turned(axis)),
            None => stated,
        };
        let moved = |s: &Source| Source {
            position_m: at(&s.id, s.position_m),
            axis: self.axis.get(&s.id).copied().or_else(|| turned(s.axis)),
            ..s.clone()
        };
        let heard = |r: &Receiver| Receiver {
            position_m: at(&r.id, r.position_m),
            axis: self.receiver_axis.get(&r.id).copied().or_else(|| turned(r.axis)),
            ..r.clone()
        };
        (room.sources().iter().map(moved).collect(), room.receivers().iter().map(heard).collect())
    }

    fn scene(&self, stated: &Scene, moved: &Scene, materials: Vec<Material>) -> Result<Scene, Cause> {
        let scene = self.with_sheets(moved.with_materials(materials)?)?;
        let scene = match &self.dimensions {
            Some(change) => change.applied(stated, &scene)?,
            None => scene,
        };
        self.objects.iter().try_fold(scene, |scene, object| object.added_to(&scene))
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
}

/// What is wrong with a pattern.
enum PatternFault {
    NoAxis,
    Axis(Cause),
    Share(Cause),
}

impl PatternFault {
    /// The fault of a source or receiver in a change of that name.
    fn of(self, change: &str, id: &str) -> Fault {
        let axis = || format!("{change}.axis.{id}");
        match self {
            Self::NoAxis => (axis(), Cause::UnknownId { id: id.to_owned() }),
            Self::Axis(cause) => (axis(), cause),
            Self::Share(cause) => (format!("{change}.directed_share"), cause),
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
