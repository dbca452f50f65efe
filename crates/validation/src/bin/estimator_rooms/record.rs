//! Recordings, and what the estimator says of each.

use crate::error::Error;
use crate::rooms::{RATE_HZ, Response, Room, Use};
use crate::sounds::{Sounds, add_noise, clipped, music, quantised, telephone, through_rate};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use rayon::prelude::*;
use sabine::acoustics::Signal;
use sabine::eqfilter::convolve;
use sabine::estimator::{DetailedEstimate, Estimator, LABEL_COUNT};

/// One window, in seconds.
pub const SHORT_S: f64 = 4.0;
/// The longer recording, in seconds.
pub const LONG_S: f64 = 12.0;
/// Talkers heard in each response.
const TALKERS: usize = 5;

/// One recording as the estimator hears it.
pub struct Record {
    pub room: String,
    pub used: Use,
    /// Number of the response in its room.
    pub response: usize,
    /// What was done to it: [`PLAIN`] or one of [`DEFECTS`].
    pub condition: &'static str,
    pub duration_s: f64,
    pub middle_t60_s: f64,
    pub labels: [f64; LABEL_COUNT],
    pub estimate: DetailedEstimate,
}

/// Nothing is done to a recording.
pub const PLAIN: &str = "speech in a room";
/// What is done to a recording.
pub const DEFECTS: [&str; 11] = [
    "clipped at 50 %",
    "clipped at 25 %",
    "clipped at 12 %",
    "clipped at 25 %, resampled",
    "telephone",
    "11.025 kHz",
    "noise alone",
    "music",
    "two talkers",
    "three talkers",
    "no room",
];

/// Hears every room: five talkers in each response, by 4 s and by 12 s, and what is not plain speech; `plucked` as in [`music`].
///
/// # Errors
/// What making and hearing recordings refuse.
pub fn hear(
    estimator: &Estimator,
    rooms: &[Room],
    sounds: &Sounds,
    plucked: bool,
) -> Result<Vec<Record>, Error> {
    let jobs: Vec<(usize, &Room, usize)> = rooms
        .iter()
        .enumerate()
        .flat_map(|(index, room)| (0..room.responses.len()).map(move |response| (index, room, response)))
        .collect();
    let records: Vec<Vec<Record>> = jobs
        .par_iter()
        .map(|(index, room, response)| {
            let rng = &mut SmallRng::seed_from_u64((*index * 64 + response) as u64);
            let case = Case { estimator, room, response: *response, sounds, plucked };
            let mut found = Vec::new();
            for k in 0..TALKERS {
                let talker = (*index * 7 + response * 5 + k) % sounds.talkers.len();
                let snr_db = rng.random_range(0.0..40.0);
                let wet = case.speech(talker, LONG_S, snr_db, rng);
                let level = case.level(rng);
                for (duration_s, start) in [(SHORT_S, 4 * RATE_HZ as usize), (LONG_S, 0)] {
                    let length = (duration_s * f64::from(RATE_HZ)) as usize;
                    let sound = quantised(wet[start..start + length].to_vec(), level);
                    found.extend(case.record(PLAIN, sound)?);
                }
            }
            for condition in DEFECTS {
                let talker = rng.random_range(0..sounds.talkers.len());
                found.extend(case.defect(talker, condition, rng)?);
            }
            Ok(found)
        })
        .collect::<Result<_, Error>>()?;
    Ok(records.into_iter().flatten().collect())
}

struct Case<'a> {
    estimator: &'a Estimator,
    room: &'a Room,
    response: usize,
    sounds: &'a Sounds,
    plucked: bool,
}

impl Case<'_> {
    fn response(&self) -> &Response {
        &self.room.responses[self.response]
    }

    fn in_room(&self, dry: &[f32]) -> Vec<f32> {
        let mut wet = convolve(dry, &self.response().samples);
        wet.truncate(dry.len());
        wet
    }

    fn speech(&self, talker: usize, duration_s: f64, snr_db: f64, rng: &mut SmallRng) -> Vec<f32> {
        let length = (duration_s * f64::from(RATE_HZ)) as usize;
        let mut wet = self.in_room(&self.sounds.speech(talker, length, rng));
        add_noise(&mut wet, &self.sounds.noise(length, rng), snr_db);
        wet
    }

    /// A peak of -30 to -1 dB.
    fn level(&self, rng: &mut SmallRng) -> f32 {
        10f32.powf(rng.random_range(-30.0..-1.0) / 20.0)
    }

    fn defect(
        &self,
        talker: usize,
        condition: &'static str,
        rng: &mut SmallRng,
    ) -> Result<Option<Record>, Error> {
        let duration_s = rng.random_range(4.0..12.0);
        let length = (duration_s * f64::from(RATE_HZ)) as usize;
        let snr_db = rng.random_range(5.0..40.0);
        let plain = self.speech(talker, duration_s, snr_db, rng);
        let together = |others: usize, rng: &mut SmallRng| {
            let mut sum = plain.clone();
            for k in 1..=others {
                let gain = 10f32.powf(rng.random_range(-5.0..5.0) / 20.0);
                let other = self.speech(talker + k, duration_s, 60.0, rng);
                add_noise(&mut sum, &other, f64::from(-20.0 * gain.log10()));
            }
            sum
        };
        let sound = match condition {
            "clipped at 50 %" => clipped(plain, 0.5),
            "clipped at 25 %" => clipped(plain, 0.25),
            "clipped at 12 %" => clipped(plain, 0.12),
            "clipped at 25 %, resampled" => through_rate(&plain, 44_100, |sound| clipped(sound, 0.25))?,
            "telephone" => telephone(&plain)?,
            "11.025 kHz" => through_rate(&plain, 11_025, |sound| sound)?,
            "noise alone" => self.sounds.noise(length, rng),
            "music" => {
                let mut wet = self.in_room(&music(length, self.plucked, rng));
                add_noise(&mut wet, &self.sounds.noise(length, rng), snr_db);
                wet
            }
            "no room" => {
                let mut dry = self.sounds.speech(talker, length, rng);
                add_noise(&mut dry, &self.sounds.noise(length, rng), snr_db);
                dry
            }
            "two talkers" => together(1, rng),
            _ => together(2, rng),
        };
        let level = self.level(rng);
        self.record(condition, quantised(sound, level))
    }

    fn record(&self, condition: &'static str, sound: Vec<f32>) -> Result<Option<Record>, Error> {
        let sound = Signal::new(sound, RATE_HZ)?;
        let estimate = match self.estimator.estimate_detailed(&sound) {
            Err(sabine::estimator::Error::Silent { .. }) => return Ok(None),
            heard => heard?,
        };
        Ok(Some(Record {
            room: self.room.name.clone(),
            used: self.room.used,
            response: self.response,
            condition,
            duration_s: sound.duration_s(),
            middle_t60_s: self.response().middle_t60_s(),
            labels: self.response().labels,
            estimate,
        }))
    }
}
