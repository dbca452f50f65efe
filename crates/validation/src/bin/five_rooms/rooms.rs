//! Real rooms with a geometry and measured responses.
//!
//! Sizes, places and tables are those of `docs/validation/real_rooms/make_rooms.py`; what their publishers do not say is assumed, as a
//! user would have to.

use crate::error::Error;
use sabine::acoustics::{Bands, Channel, ImpulseResponse, Material, PerBand, read_audio};
use sabine::scene::{
    Levels, MaterialPrior, MeasuredRoom, Measurement, NewRoom, PositionSd, Receiver, RoomModel, Scene,
    Source, TimeZero,
};
use std::path::{Path, PathBuf};

/// What the released estimator has had to do with a room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum History {
    /// Its responses, changed, are in the training set.
    Trained,
    /// It is a room of the test set, at which the project looked several times.
    Tested,
    /// Nothing.
    New,
}

impl History {
    /// In a table.
    pub fn word(self) -> &'static str {
        match self {
            Self::Trained => "trained on",
            Self::Tested => "test set",
            Self::New => "new",
        }
    }
}

/// A room and the responses that were measured in it.
pub struct Room {
    /// Name in the tables.
    pub name: &'static str,
    /// Number of its first recording, the same whichever rooms are wanted.
    pub first_recording: usize,
    /// Whether the estimator knows it.
    pub history: History,
    /// Its model; the responses are kept beside it.
    pub model: MeasuredRoom,
    /// Measured responses.
    pub pairs: Vec<Pair>,
}

/// A measured response.
pub struct Pair {
    /// Identifier of the source.
    pub source: String,
    /// Identifier of the receiver.
    pub receiver: String,
    /// What was measured.
    pub response: ImpulseResponse,
}

impl Pair {
    /// In a table.
    pub fn name(&self) -> String {
        format!("{}/{}", self.source, self.receiver)
    }
}

/// A room published as ears of a dummy head before a loudspeaker, in a box.
struct HeadRoom {
    name: &'static str,
    history: History,
    size_m: [f64; 3],
    /// The middle of the head.
    head_m: [f64; 3],
    distance_m: f64,
    /// Azimuths to the left from straight ahead (+y), in degrees, with the file of each.
    files: [(f64, &'static str); 2],
}

/// Two directions out of those that were measured, one on either side.
const HEAD_ROOMS: [HeadRoom; 4] = [
    // Size and distance: C. Hummersone, PhD thesis, University of Surrey, 2011. The head's place is assumed.
    HeadRoom {
        name: "Surrey A",
        history: History::Trained,
        size_m: [5.72, 6.64, 2.31],
        head_m: [2.86, 2.6, 1.3],
        distance_m: 1.5,
        files: [(45.0, "rir/surrey_roomA/brir_09.wav"), (-30.0, "rir/surrey_roomA/brir_24.wav")],
    },
    // The bounding box of a lecture theatre that is none; height of the head as published, its place assumed.
    HeadRoom {
        name: "Surrey C",
        history: History::New,
        size_m: [23.5, 18.8, 4.6],
        head_m: [11.2, 8.3, 1.93],
        distance_m: 1.5,
        files: [
            (45.0, "rir_more/surrey_rooms_cd/Room_C/CortexBRIR_0_68s_-45deg_16k.wav"),
            (-30.0, "rir_more/surrey_rooms_cd/Room_C/CortexBRIR_0_68s_30deg_16k.wav"),
        ],
    },
    HeadRoom {
        name: "Surrey D",
        history: History::New,
        size_m: [8.02, 8.72, 4.25],
        head_m: [3.8, 3.7, 1.7],
        distance_m: 1.5,
        files: [
            (45.0, "rir_more/surrey_rooms_cd/Room_D/CortexBRIR_0_89s_-45deg_16k.wav"),
            (-30.0, "rir_more/surrey_rooms_cd/Room_D/CortexBRIR_0_89s_30deg_16k.wav"),
        ],
    },
    // Height and distance: C. Pike and M. Romanov, AES 142nd convention, 2017. The size is that of a room by ITU-R BS.1116.
    HeadRoom {
        name: "BBC listening room",
        history: History::Tested,
        size_m: [5.6, 5.8, 2.9],
        head_m: [2.8, 2.9, 1.18],
        distance_m: 2.0,
        files: [
            (45.0, "rir/bbc_listening_room/BBCRD_LR_M+045.wav"),
            (-30.0, "rir/bbc_listening_room/BBCRD_LR_M-030.wav"),
        ],
    },
];

/// dEchorate's microphones hang in pairs: one of each.
const DECHORATE_MICROPHONES: [&str; 4] = ["m01", "m02", "m03", "m04"];
/// Ears are this far from the middle of the head, in metres.
const EAR_M: f64 = 0.09;

/// All rooms whose name contains `wanted`, with at most `most_pairs` responses each.
///
/// # Errors
/// [`Error::Missing`] for data that are not there; what cannot be read of them.
pub fn rooms(data: &Path, wanted: &str, most_pairs: usize) -> Result<Vec<Room>, Error> {
    let is_wanted = |name: &str| name.to_lowercase().contains(&wanted.to_lowercase());
    let mut rooms = Vec::new();
    if is_wanted("BRAS CR2") {
        rooms.push(bras(data)?);
    }
    if is_wanted("dEchorate") {
        rooms.push(dechorate(data)?);
    }
    for (i, room) in HEAD_ROOMS.iter().enumerate().filter(|(_, room)| is_wanted(room.name)) {
        rooms.push(room.read(data, 4 * (i + 2))?);
    }
    for room in &mut rooms {
        room.pairs.truncate(most_pairs);
    }
    if rooms.is_empty() { Err(Error::Nothing { what: format!("room \"{wanted}\"") }) } else { Ok(rooms) }
}

fn present(path: PathBuf) -> Result<PathBuf, Error> {
    if path.exists() { Ok(path) } else { Err(Error::Missing { path }) }
}

fn bras(data: &Path) -> Result<Room, Error> {
    let model = MeasuredRoom::read(present(data.join("rooms/bras_cr2"))?)?;
    let second = present(data.join("rooms_more/bras_cr2_second/LS2_MP2.wav"))?;
    let pair = |source: &str, receiver: &str, response| Pair {
        source: source.into(),
        receiver: receiver.into(),
        response,
    };
    let pairs = vec![
        pair("LS1", "MP1", model.load_response(0)?),
        pair("LS2", "MP2", read_audio(second, Channel::Mono)?.into()),
    ];
    Ok(Room { name: "BRAS CR2", first_recording: 0, history: History::Tested, model, pairs })
}

fn dechorate(data: &Path) -> Result<Room, Error> {
    let model = MeasuredRoom::read(present(data.join("rooms/dechorate_011111"))?)?;
    let mut pairs = Vec::new();
    for (index, entry) in model.responses().iter().enumerate() {
        let receiver = model.receivers()[entry.receiver].id.clone();
        if DECHORATE_MICROPHONES.contains(&receiver.as_str()) {
            let source = model.sources()[entry.source].id.clone();
            pairs.push(Pair { source, receiver, response: model.load_response(index)? });
        }
    }
    Ok(Room { name: "dEchorate", first_recording: 4, history: History::Trained, model, pairs })
}

impl HeadRoom {
    fn read(&self, data: &Path, first_recording: usize) -> Result<Room, Error> {
        let [x, y, z] = self.head_m;
        let receivers =
            vec![Receiver::omni("left", [x - EAR_M, y, z])?, Receiver::omni("right", [x + EAR_M, y, z])?];
        let (mut sources, mut pairs) = (Vec::new(), Vec::new());
        for (azimuth_deg, file) in self.files {
            let path = present(data.join(file))?;
            let source = format!("{azimuth_deg:+}deg");
            let (sin, cos) = azimuth_deg.to_radians().sin_cos();
            let place_m = [x - self.distance_m * sin, y + self.distance_m * cos, z];
            sources.push(Source { axis: Some([sin, -cos, 0.0]), ..Source::omni(source.clone(), place_m)? });
            for (channel, ear) in receivers.iter().enumerate() {
                let response = read_audio(&path, Channel::Index(channel))?.into();
                pairs.push(Pair { source: source.clone(), receiver: ear.id.clone(), response });
            }
        }
        let RoomModel { scene, priors } = box_of(self.size_m)?;
        let new = NewRoom {
            scene,
            priors,
            air: None,
            measurement: Measurement { time_zero: TimeZero::PerResponse, levels: Levels::PerResponse },
            position_sd: PositionSd::default(),
            sources,
            receivers,
            responses: Vec::new(),
        };
        let model = new.in_memory()?;
        Ok(Room { name: self.name, first_recording, history: self.history, model, pairs })
    }
}

/// A box of which nothing is known but that its surfaces are those of a furnished room.
fn box_of(size_m: [f64; 3]) -> Result<RoomModel, Error> {
    let model = RoomModel::of_box([[0.0; 3], size_m], None)?;
    let materials: Vec<Material> = (0..model.scene.materials().len())
        .map(|_| Material::uniform(Bands::T60, 0.2, 0.2))
        .collect::<Result<_, _>>()?;
    let priors = materials.iter().map(|material| MaterialPrior {
        absorption: Some(material.absorption().clone()),
        absorption_sd: PerBand::uniform(Bands::T60, 0.15),
    });
    let priors = priors.collect();
    let scene: Scene = model.scene.with_materials(materials)?;
    Ok(RoomModel { scene, priors })
}
