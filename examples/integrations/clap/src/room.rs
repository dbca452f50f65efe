//! Rooms to be heard: read from a file, traced from a folder, or built in.

use crate::LONGEST_S;
use sabine_acoustics::{
    Air, Bands, Channel, ImpulseResponse, Material, Orientation, library_material, probe_audio, read_audio,
    resample_response,
};
use sabine_diagnose::{ExtendedModel, ExtendedRoom};
use sabine_paths::{Conditions, PathSet, Propagator};
use sabine_propagate::{AmbisonicRenderer, PathTracer, RenderConfig, TracerConfig};
use sabine_scene::{MeasuredRoom, Receiver, Scene, Source};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// In words for the user, who sees them in the host's log.
pub type Failure = Box<dyn Error + Send + Sync>;

/// Rays of a trace: half a second of work, and decays that are right to some percent.
const RAYS: usize = 10_000;
/// Longest time that is traced of a room in a folder, in seconds.
const TRACE_S: f64 = 8.0;
/// The built-in hall: length, width and height in metres, and the time that is traced in seconds: until it is 60 dB below its start.
const HALL_M: [f64; 3] = [16.0, 11.0, 6.0];
const HALL_S: f64 = 2.8;
/// What `sabine diagnose` writes, if it lies in the folder of a room.
const MODEL: &str = "extended_model.toml";
/// Sample rate of traced responses in Hz.
const TRACE_HZ: u32 = 48_000;
/// Largest sample of a response: a measured one may be in pascal, beyond this it is no sound.
const LOUDEST: f32 = 1000.0;

/// Where a room is.
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// The hall that needs no file.
    BuiltIn,
    /// No room: only the sound as it came in is heard.
    Nothing,
    /// A sound file, or a folder with a `room.toml`.
    At(PathBuf),
}

/// A room: responses to the left and to the right.
#[derive(Debug)]
pub struct Room {
    /// One that serves both sides; one for each side; or from left to left, left to right, right to left, right to right.
    responses: Vec<ImpulseResponse>,
}

impl Room {
    /// Reads, traces or recalls a room. This may take seconds.
    ///
    /// # Errors
    /// A file or folder that cannot be read, is no sound or no room, or does not fit: the error names it.
    pub fn of(place: &Place) -> Result<Arc<Self>, Failure> {
        match place {
            Place::BuiltIn => hall(),
            Place::Nothing => Ok(Self::silent()),
            // What it is relative to, the host decides; a path of another system is none here.
            Place::At(path) if !path.is_absolute() => {
                Err(format!("{}: the path of a room must begin at the root", path.display()).into())
            }
            Place::At(path) if path.is_dir() => in_own_threads(|| folder(path)).map(Arc::new),
            Place::At(path) => file(path).map(Arc::new),
        }
    }

    /// A room of which nothing is heard.
    pub fn silent() -> Arc<Self> {
        Arc::new(Self { responses: Vec::new() })
    }

    /// Responses for the reverb: from each of `inputs` channels, 1 or 2, to left and right, at a sample rate in Hz.
    ///
    /// A single response, or one for each side, keeps the sides of a stereo input apart, as programs of this kind do: nothing is heard
    /// across. A mono input is heard as a stereo input with the same sound on both sides.
    ///
    /// # Errors
    /// A response that cannot be brought to the sample rate.
    pub fn at_rate(&self, rate_hz: u32, inputs: usize) -> Result<Vec<ImpulseResponse>, Failure> {
        let resampled = |response| resample_response(response, rate_hz);
        let responses = self.responses.iter().map(resampled).collect::<Result<Vec<_>, _>>()?;
        let none = ImpulseResponse::new(vec![0.0], rate_hz)?;
        let four = match <[ImpulseResponse; 4]>::try_from(responses) {
            Ok(four) => four,
            Err(fewer) => {
                let left = fewer.first().unwrap_or(&none).clone();
                let right = fewer.last().unwrap_or(&none).clone();
                [left, none.clone(), none, right]
            }
        };
        if inputs == 2 {
            return Ok(four.into());
        }
        let [left_left, left_right, right_left, right_right] = four;
        Ok(vec![sum(&left_left, &right_left)?, sum(&left_right, &right_right)?])
    }
}

fn sum(a: &ImpulseResponse, b: &ImpulseResponse) -> Result<ImpulseResponse, Failure> {
    let (long, short) = if a.samples().len() < b.samples().len() { (b, a) } else { (a, b) };
    let mut samples = long.samples().to_vec();
    samples.iter_mut().zip(short.samples()).for_each(|(sum, more)| *sum += more);
    Ok(ImpulseResponse::new(samples, a.sample_rate_hz())?)
}

/// A response of one, two or four channels.
fn file(path: &Path) -> Result<Room, Failure> {
    let info = probe_audio(path)?;
    let refused = |why: String| Failure::from(format!("{}: {why}", path.display()));
    if !matches!(info.channels, 1 | 2 | 4) {
        return Err(refused(format!("{} channels; a room has 1, 2 or 4", info.channels)));
    }
    let seconds = info.frames as f64 / f64::from(info.sample_rate_hz);
    if seconds > LONGEST_S {
        return Err(refused(format!("{seconds:.1} s long; a room may last {LONGEST_S} s")));
    }
    let channel = |index| -> Result<ImpulseResponse, Failure> {
        let response: ImpulseResponse = read_audio(path, Channel::Index(index))?.into();
        match response.peak() {
            peak if peak > LOUDEST => {
                Err(refused(format!("a sample of {peak}; {LOUDEST} is the most that a room may have")))
            }
            _ => Ok(response),
        }
    };
    Ok(Room { responses: (0..info.channels).map(channel).collect::<Result<_, _>>()? })
}

/// What a folder says of its room, traced from its first source to its first receiver. What a diagnosis found is in force where its
/// file lies beside `room.toml`, as far as it bears on paths.
fn folder(path: &Path) -> Result<Room, Failure> {
    let room = MeasuredRoom::read(path)?;
    if room.sources().is_empty() || room.receivers().is_empty() {
        return Err(format!("{}: the room has no source or no receiver", path.display()).into());
    }
    let surfaces = |scene: &Scene| -> Vec<Material> {
        scene.materials().iter().map(|named| named.material.clone()).collect()
    };
    let model = path.join(MODEL);
    if !model.is_file() {
        let (materials, air) = (surfaces(room.scene()), room.air());
        let ends = (&room.sources()[0], &room.receivers()[0]);
        return traced(room.scene(), &Conditions::new(&materials, &air), ends, TracerConfig::default());
    }
    let extended = ExtendedModel::read(model)?.room(&room)?;
    let materials = surfaces(&extended.scene);
    let ExtendedRoom { diffraction, cuboid_paths, .. } = extended;
    let tracer = TracerConfig { diffraction, cuboid_paths, ..TracerConfig::default() };
    let ends = (&extended.sources[0], &extended.receivers[0]);
    traced(&extended.scene, &extended.conditions(&materials, 0, 0), ends, tracer)
}

/// A hall of plaster and wood with upholstered seats, traced once for all instances.
fn hall() -> Result<Arc<Room>, Failure> {
    static HALL: OnceLock<Result<Arc<Room>, String>> = OnceLock::new();
    let trace = || -> Result<Room, Failure> {
        let surface = |name| library_material(name)?.material(Bands::SIMULATION);
        let (wall, wood) = (surface("stucco_rough")?, surface("wood_16mm")?);
        let [floor, ceiling] = [surface("seats_upholstered")?, surface("plasterboard_ceiling")?];
        let materials = [wall.clone(), wood.clone(), wall, wood, floor, ceiling];
        let scene = Scene::shoebox(HALL_M, materials.clone())?;
        let source = Source::omni("stage", [4.0, 5.0, 1.6])?;
        let receiver = Receiver::omni("seat", [10.5, 6.2, 1.4])?;
        let air = Air::default();
        let conditions = Conditions::new(&materials, &air);
        let tracer = TracerConfig { rays: RAYS, duration_s: HALL_S, ..TracerConfig::default() };
        in_own_threads(|| {
            let paths = PathTracer::new(tracer)?.trace(&scene, &source, &receiver, &air, &())?;
            rendered(&paths, &conditions, &source, &receiver)
        })
    };
    HALL.get_or_init(|| trace().map(Arc::new).map_err(|error| error.to_string()))
        .clone()
        .map_err(Failure::from)
}

/// Traced until T30 can be read in every band, as the command does.
fn traced(
    scene: &Scene,
    conditions: &Conditions,
    (source, receiver): (&Source, &Receiver),
    tracer: TracerConfig,
) -> Result<Room, Failure> {
    let tracer = PathTracer::new(TracerConfig { rays: RAYS, duration_s: TRACE_S, ..tracer })?;
    let (paths, _) = tracer.trace_until_t30(scene, source, receiver, conditions, &())?;
    rendered(&paths, conditions, source, receiver)
}

/// The response at two coincident cardioids that point to the left and to the right of someone who looks as the receiver does or, if
/// that is not stated, faces the source. A source 1 m away has a direct sound of amplitude 1, of which each cardioid hears half.
fn rendered(
    paths: &PathSet,
    conditions: &Conditions,
    source: &Source,
    receiver: &Receiver,
) -> Result<Room, Failure> {
    let to_source = [0, 1, 2].map(|axis| source.position_m[axis] - receiver.position_m[axis]);
    let facing = Orientation::towards(receiver.axis.unwrap_or(to_source))?;
    let render = RenderConfig { sample_rate_hz: TRACE_HZ, ..RenderConfig::default() };
    let heard = AmbisonicRenderer::new(1, render)?.render(paths, conditions, facing)?;
    let (w, y) = (heard.channel(0), heard.channel(1));
    let cardioid = |side: f32| {
        let samples = w.iter().zip(y).map(|(w, y)| 0.5 * (w + side * y)).collect();
        ImpulseResponse::new(samples, TRACE_HZ)
    };
    Ok(Room { responses: vec![cardioid(1.0)?, cardioid(-1.0)?] })
}

/// Works on threads that end with the work. Those that rayon keeps for later would still be there when the host unloads the library.
fn in_own_threads<T: Send>(work: impl FnOnce() -> Result<T, Failure> + Send) -> Result<T, Failure> {
    rayon::ThreadPoolBuilder::new().build_scoped(|thread| thread.run(), |pool| pool.install(work))?
}

#[cfg(test)]
mod tests {
    use super::*;
    use sabine_acoustics::RoomParameters;

    fn response(samples: &[f32]) -> ImpulseResponse {
        ImpulseResponse::new(samples.to_vec(), 48_000).unwrap()
    }

    fn arranged(responses: &[&[f32]], inputs: usize) -> Vec<Vec<f32>> {
        let room = Room { responses: responses.iter().map(|samples| response(samples)).collect() };
        room.at_rate(48_000, inputs).unwrap().into_iter().map(ImpulseResponse::into_samples).collect()
    }

    #[test]
    fn channels_of_a_file_become_pairs_of_input_and_output() {
        let (a, b, c, d) = (&[1.0][..], &[0.0, 2.0][..], &[0.5, 0.25][..], &[4.0][..]);
        assert_eq!(arranged(&[], 2), [[0.0], [0.0], [0.0], [0.0]]);
        assert_eq!(arranged(&[b], 2), [b, &[0.0], &[0.0], b]);
        assert_eq!(arranged(&[a, b], 2), [a, &[0.0], &[0.0], b]);
        assert_eq!(arranged(&[a, b, c, d], 2), [a, b, c, d]);
        assert_eq!(arranged(&[], 1), [[0.0], [0.0]]);
        assert_eq!(arranged(&[b], 1), [b, b]);
        assert_eq!(arranged(&[a, b], 1), [a, b]);
        assert_eq!(arranged(&[a, b, c, d], 1), [&[1.5, 0.25][..], &[4.0, 2.0]]);
    }

    #[test]
    fn the_hall_reaches_both_sides_and_dies_away() {
        let hall = Room::of(&Place::BuiltIn).unwrap();
        for side in hall.at_rate(48_000, 1).unwrap() {
            // 6.613 m at 343.2 m/s.
            let onset = side.samples().iter().position(|s| s.abs() > 0.1 * side.peak()).unwrap();
            assert!(onset.abs_diff(925) <= 5, "{onset}");
            let energy: f32 = side.samples().iter().map(|s| s * s).sum();
            assert!((0.02..0.1).contains(&energy), "{energy}");
            let t30_s = RoomParameters::measure(&side, Bands::T60).unwrap().t30_s;
            let at_1_khz = t30_s.at_hz(1000.0).unwrap().as_ref().unwrap().value;
            assert!((1.7..2.3).contains(&at_1_khz), "{at_1_khz} s");
        }
        assert!(Arc::ptr_eq(&hall, &Room::of(&Place::BuiltIn).unwrap()), "traced once");
    }
}
