//! What is hidden in a room.

use crate::kinds::KINDS;
use clap::ValueEnum;
use rand::{Rng, SeedableRng, rngs::SmallRng};
use sabine_testkit::{End, Hidden, LabConfig, Laboratory};
use sabine_validation::AnyError;
use serde::{Deserialize, Serialize};

/// Nuisances: standard deviations of a place along each axis in metres, and of a response in one octave in dB; level of stationary noise in
/// dB re the strongest 20 ms.
const PLACE_M: f64 = 0.005;
const OCTAVE_DB: f64 = 0.4;
const NOISE_DB: f64 = -50.0;
/// Effects of the catalogue that nuisances are: to name them is no fault.
pub const NUISANCES: [&str; 3] = ["position_error", "channel_response", "background_noise"];
/// Other causes, in turn.
const CAUSES: [&str; 4] = ["surface_absorption", "air_absorption", "transducer_response", "scattering"];
/// Humidity of the dry air among them, in percent.
const DRY_PERCENT: f64 = 12.0;
/// Numbers of seeds that belong to one kind in one round.
const SEEDS_EACH: u64 = 64;
/// Seeds of the parts of one room lie so far apart.
const SEED_STEP: u64 = 0x9E37_79B9;

/// A room without a law.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Null {
    /// Nothing is wrong.
    Nothing,
    /// An effect of the catalogue acts in the room.
    Cause,
    /// Places, levels and noise are off by a little.
    Nuisances,
    /// Both of these.
    Both,
}

/// What a room holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum World {
    /// A law of a size.
    Law(f64),
    /// None.
    Null(Null),
}

impl World {
    /// A size, in tenths from 0.1 to 5.
    ///
    /// # Errors
    /// A sentence, for another number.
    pub fn sized(text: &str) -> Result<f64, String> {
        let size: f64 = text.parse().map_err(|error| format!("{text}: {error}"))?;
        let tenths = 10.0 * size;
        let fits = (tenths - tenths.round()).abs() < 1e-6 && (1.0..=50.0).contains(&tenths.round());
        if fits { Ok(tenths.round() / 10.0) } else { Err("a size lies between 0.1 and 5, in tenths".into()) }
    }

    /// Seed of a room: the same whatever else is asked for.
    pub fn seed(self, first: u64, round: u64, kind: usize) -> u64 {
        let own = match self {
            Self::Null(null) => null as u64,
            Self::Law(size) => 4 + (10.0 * size).round() as u64,
        };
        let rooms_before = round.wrapping_mul(KINDS.len() as u64).wrapping_add(kind as u64);
        // Seeds of rooms lie below 2^63.
        first.wrapping_add(rooms_before.wrapping_mul(SEEDS_EACH)).wrapping_add(own) & (u64::MAX >> 1)
    }
}

/// All that is hidden: a law or another cause first, where there is one.
pub struct Contents {
    pub hidden: Vec<Hidden>,
    /// Whether the first of them is a law.
    pub law: bool,
    /// Identifier of the other cause.
    pub cause: Option<&'static str>,
}

/// The room of a kind: what is declared depends on it, in rooms without a law, too.
pub fn room(kind: usize, seed: u64, receivers: usize) -> LabConfig {
    let id = KINDS[kind].id;
    LabConfig {
        seed,
        receivers,
        microphone_axes: id == "directional_microphones",
        recording_order: id == "warming_loudspeaker",
        ..LabConfig::default()
    }
}

/// What a room holds, drawn from its seed.
///
/// # Errors
/// What does not fit the room.
pub fn contents(
    (kind, world): (usize, World),
    lab: &Laboratory,
    seed: u64,
    nuisances: bool,
) -> Result<Contents, AnyError> {
    let mut contents = Contents { hidden: Vec::new(), law: false, cause: None };
    let mut with_nuisances = nuisances;
    match world {
        World::Law(size) => {
            contents.hidden.push(KINDS[kind].hide(size, lab, seed)?);
            contents.law = true;
        }
        World::Null(null) => {
            with_nuisances |= matches!(null, Null::Nuisances | Null::Both);
            if matches!(null, Null::Cause | Null::Both) {
                let mut random = SmallRng::seed_from_u64(seed);
                let id = CAUSES[random.random_range(0..CAUSES.len())];
                contents.hidden.push(match id {
                    "air_absorption" => Hidden::AirAbsorption { relative_humidity_percent: DRY_PERCENT },
                    other => Hidden::random(other, 1.0, lab, seed)?,
                });
                contents.cause = Some(id);
            }
        }
    }
    if with_nuisances {
        contents.hidden.extend(all_nuisances(lab, seed.wrapping_add(SEED_STEP))?);
    }
    Ok(contents)
}

fn all_nuisances(lab: &Laboratory, seed: u64) -> Result<Vec<Hidden>, AnyError> {
    let mut random = SmallRng::seed_from_u64(seed);
    // The sum of twelve even numbers has a variance of 1.
    let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
    let truth = lab.truth(&[])?;
    let bands = truth.bands_hz.len();
    let mut all: Vec<Hidden> = (0..truth.receivers_m.len())
        .map(|index| {
            let offset_m = [(); 3].map(|()| PLACE_M * normal());
            Hidden::PositionError { end: End::Receiver, index, offset_m }
        })
        .collect();
    let mut channel = |_| (0..bands).map(|_| OCTAVE_DB * normal()).collect();
    all.push(Hidden::ChannelResponse { gains_db: (0..truth.responses()).map(&mut channel).collect() });
    all.push(Hidden::BackgroundNoise { levels_db: vec![NOISE_DB; bands] });
    Ok(all)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;

    #[test]
    fn no_two_rooms_share_a_seed() {
        let mut worlds: Vec<World> = (1..=50).map(|tenths| World::Law(0.1 * f64::from(tenths))).collect();
        worlds.extend([Null::Nothing, Null::Cause, Null::Nuisances, Null::Both].map(World::Null));
        let mut seeds: Vec<u64> = Vec::new();
        for round in 0..3 {
            for kind in 0..KINDS.len() {
                seeds.extend(worlds.iter().map(|world| world.seed(7, round, kind)));
            }
        }
        let count = seeds.len();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), count);
    }

    #[test]
    fn sizes_are_tenths() {
        assert_eq!(World::sized("0.5"), Ok(0.5));
        assert!(["0", "0.55", "9", "x", "NaN", "-1"].iter().all(|text| World::sized(text).is_err()));
    }

    #[test]
    fn rooms_hold_what_they_are_said_to() {
        let lab = Laboratory::new(room(2, 11, 6)).unwrap();
        let of = |world, nuisances| contents((2, world), &lab, 11, nuisances).unwrap();
        assert!(of(World::Null(Null::Nothing), false).hidden.is_empty());
        assert_eq!(of(World::Null(Null::Nuisances), false).hidden.len(), 8);
        let both = of(World::Null(Null::Both), false);
        assert!(both.cause.is_some() && !both.law && both.hidden.len() == 9);
        let law = of(World::Law(1.0), true);
        assert!(law.law && law.hidden.len() == 9 && law.hidden[0].name() == "fog");
        lab.truth(&law.hidden).unwrap();
    }
}
