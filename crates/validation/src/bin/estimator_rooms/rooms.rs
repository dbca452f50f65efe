//! Rooms: those that the prior, the likelihood and the warnings are fitted in, and those reserved for the test.

use crate::error::Error;
use rayon::prelude::*;
use sabine::acoustics::{Channel, ImpulseResponse, probe_audio, read_audio, resample_response};
use sabine::augment::{Labels, SyntheticRoomConfig, SyntheticRooms};
use sabine::estimator::{LABEL_COUNT, T60_COUNT, label_hz};
use std::path::{Path, PathBuf};

/// What the estimator hears, in Hz.
pub const RATE_HZ: u32 = 16_000;
/// Responses of a measured room that are used, spread over its files.
const MOST_RESPONSES: usize = 6;

/// What a room is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Use {
    /// Its labels enter the prior alone: the network was trained in it.
    Prior,
    /// Prior, likelihood and warnings are fitted in it.
    Fit,
    /// Simulated; likelihood and warnings are fitted in it.
    Simulated,
    /// Reserved: no part of the project had looked at it.
    Test,
    /// Simulated with other seeds; nothing is fitted in it.
    SimulatedTest,
}

/// A measured room: its name, its files (below the data folder, by the beginning of their paths), and its use.
struct Measured(&'static str, &'static [&'static str], Use);

const MEASURED: [Measured; 31] = [
    Measured("dEchorate", &["rooms/dechorate_011111/"], Use::Prior),
    Measured("DecayFitNet double", &["rir/decayfitnet/double"], Use::Prior),
    Measured("DecayFitNet single", &["rir/decayfitnet/single"], Use::Prior),
    Measured("Surrey A", &["rir/surrey_roomA/"], Use::Prior),
    Measured("Surrey C", &["rir_more/surrey_rooms_cd/Room_C/"], Use::Prior),
    Measured("Surrey D", &["rir_more/surrey_rooms_cd/Room_D/"], Use::Prior),
    Measured("Arni", &["rir/flamo_arni/"], Use::Fit),
    Measured("BinauralSDM", &["rir/binauralsdm/"], Use::Fit),
    Measured("Clothworkers Hall", &["rir_more/hisstools/Clothworkers"], Use::Fit),
    Measured("Huddersfield Town Hall", &["rir_more/hisstools/Huddersfield"], Use::Fit),
    Measured("Temple Works", &["rir_more/hisstools/Templeworks"], Use::Fit),
    Measured("Rymer Auditorium", &["rir_more/hisstools/York", "rir_more/openair_toob/Arthur"], Use::Fit),
    Measured("Genesis 6 Studio", &["rir_more/openair_toob/Genesis"], Use::Fit),
    Measured("Jack Lyons Hall", &["rir_more/openair_toob/Jack"], Use::Fit),
    Measured("Phipps Hall", &["rir_more/hisstools/Phipps"], Use::Test),
    Measured("St Pauls Hall", &["rir_more/hisstools/St Pauls"], Use::Test),
    Measured("Studio 2", &["rir_more/hisstools/Studio"], Use::Test),
    Measured("atrium", &["rir_more/hisstools/atrium"], Use::Test),
    Measured("St. Margaret's Church", &["rir_more/openair_toob/St."], Use::Test),
    Measured("empty bedroom", &["rir_more/openair_reverbjs/Empty"], Use::Test),
    Measured("Royal Tennis Court", &["rir_more/openair_reverbjs/Falkland"], Use::Test),
    Measured("Lady Chapel", &["rir_more/openair_reverbjs/Lady"], Use::Test),
    Measured("Maes Howe", &["rir_more/openair_reverbjs/Maes"], Use::Test),
    Measured("railroad tunnel", &["rir_more/openair_reverbjs/Purnodes"], Use::Test),
    Measured("Saint Lawrence Church", &["rir_more/openair_reverbjs/Saint"], Use::Test),
    Measured("St Andrew's Church", &["rir_more/openair_reverbjs/StAndrews"], Use::Test),
    Measured("St Patrick's Church", &["rir_more/openair_reverbjs/StPatricks"], Use::Test),
    Measured("Terry's typing room", &["rir_more/openair_reverbjs/Terrys"], Use::Test),
    Measured("Tyndall Bruce Monument", &["rir_more/openair_reverbjs/Tyndall"], Use::Test),
    Measured("underground car park", &["rir_more/openair_reverbjs/Underground"], Use::Test),
    Measured("York Minster", &["rir_more/openair_reverbjs/York"], Use::Test),
];

/// A room with its responses.
pub struct Room {
    pub name: String,
    pub used: Use,
    pub responses: Vec<Response>,
}

/// A response at [`RATE_HZ`] and what is read from it.
pub struct Response {
    pub samples: Vec<f32>,
    /// Seconds, then dB; NaN where it cannot be read.
    pub labels: [f64; LABEL_COUNT],
}

impl Response {
    fn new(response: &ImpulseResponse) -> Result<Self, Error> {
        let measured = Labels::measure(response)?;
        let labels = std::array::from_fn(|label| {
            let readings = if label < T60_COUNT { measured.t60_s() } else { measured.eq_db() };
            let reading = readings.at_hz(label_hz(label)).and_then(|reading| reading.as_ref().ok());
            // A level 30 dB down is a loudspeaker that does not radiate.
            reading
                .map_or(f64::NAN, |e| if label < T60_COUNT || e.value > -30.0 { e.value } else { f64::NAN })
        });
        Ok(Self { samples: response.samples().to_vec(), labels })
    }

    /// Geometric mean of the reverberation times at 500 Hz, 1 and 2 kHz that can be read.
    pub fn middle_t60_s(&self) -> f64 {
        let known: Vec<f64> = self.labels[2..5].iter().copied().filter(|t| !t.is_nan()).collect();
        (known.iter().map(|t| t.ln()).sum::<f64>() / known.len() as f64).exp()
    }
}

/// Measured rooms of these uses.
///
/// # Errors
/// [`Error::Missing`]; what cannot be read.
pub fn measured(data: &Path, uses: &[Use]) -> Result<Vec<Room>, Error> {
    let files = sound_files(data)?;
    let wanted: Vec<&Measured> = MEASURED.iter().filter(|room| uses.contains(&room.2)).collect();
    wanted
        .into_par_iter()
        .map(|Measured(name, beginnings, used)| {
            let own: Vec<(PathBuf, usize)> = files
                .iter()
                .filter(|(relative, _)| beginnings.iter().any(|b| relative.starts_with(b)))
                .map(|(_, path)| Ok((path.clone(), probe_audio(path)?.channels)))
                .collect::<Result<Vec<_>, Error>>()?
                .into_iter()
                .flat_map(|(path, channels)| {
                    // Two channels are two microphones; of more the first one.
                    (0..if channels == 2 { 2 } else { 1 }).map(move |channel| (path.clone(), channel))
                })
                .collect();
            if own.is_empty() {
                return Err(Error::Missing { path: data.join(beginnings[0]) });
            }
            let count = own.len().min(MOST_RESPONSES);
            let responses = (0..count)
                .map(|k| {
                    let (path, channel) = &own[k * own.len() / count];
                    let native = ImpulseResponse::from(read_audio(path, Channel::Index(*channel))?);
                    Response::new(&resample_response(&native, RATE_HZ)?)
                })
                .collect::<Result<Vec<_>, Error>>()?
                .into_iter()
                .filter(|response| response.middle_t60_s().is_finite())
                .collect();
            Ok(Room { name: (*name).to_owned(), used: *used, responses })
        })
        .collect()
}

/// Simulated rooms, one response each, with the reverberation times of the training set and beyond it, to 6 s.
///
/// # Errors
/// What drawing and measuring refuse.
pub fn simulated(first_seed: u64, count: usize, used: Use) -> Result<Vec<Room>, Error> {
    let config = SyntheticRoomConfig {
        sample_rate_hz: RATE_HZ,
        longest_t60_s: 6.0,
        long_fraction: 0.35,
        longest_s: 7.0,
        ..SyntheticRoomConfig::default()
    };
    let rooms = SyntheticRooms::new(config)?;
    (first_seed..first_seed + count as u64)
        .into_par_iter()
        .map(|seed| {
            let response = Response::new(&rooms.draw(seed)?)?;
            Ok(Room { name: format!("simulated {seed}"), used, responses: vec![response] })
        })
        .filter(|room: &Result<Room, Error>| {
            room.as_ref().map_or(true, |room| room.responses[0].middle_t60_s().is_finite())
        })
        .collect()
}

/// Sound files below a folder with their paths relative to it, in order.
fn sound_files(folder: &Path) -> Result<Vec<(String, PathBuf)>, Error> {
    let (mut found, mut open) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(next) = open.pop() {
        let io = |source| Error::Io { path: next.clone(), source };
        for entry in std::fs::read_dir(&next).map_err(io)? {
            let path = entry.map_err(io)?.path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| ["wav", "flac", "aif"].iter().any(|known| e == *known))
            {
                let relative = path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().into_owned();
                found.push((relative, path));
            }
        }
    }
    found.sort();
    Ok(found)
}
