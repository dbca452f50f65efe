//! The whole line with an estimator of one's own, so that what is heard is known.

use sabine::acoustics::{
    Error, Estimate, MeasuredRoom, OctaveBands, PerBand, Propagator, RoomEstimator, RoomTargets, Signal,
};
use sabine::propagate::{PathTracer, TracerConfig};
use sabine::{MatchConfig, MatchInput, Recording, RoomMatch, match_room_with};

/// Hears the same in everything.
struct Told(RoomTargets);

impl RoomEstimator for Told {
    fn estimate(&self, _: &Signal) -> Result<RoomTargets, Error> {
        Ok(self.0.clone())
    }
}

fn told(t60_s: [f64; 7]) -> Told {
    let t60 = PerBand::from_fn(OctaveBands::T60, |i| Estimate::new(t60_s[i], 0.05));
    let eq =
        PerBand::from_fn(OctaveBands::EQ, |i| Estimate::new([-3.0, 2.0, 1.0, 0.5, 0.0, -2.0, -5.0][i], 1.0));
    Told(RoomTargets::new(t60, eq).unwrap())
}

/// A second of decaying clicks: anything that is not silent will do.
fn clicks(rate: u32) -> Signal {
    let samples =
        (0..2 * rate).map(|i| if i % 4000 < 40 { 0.5 * (1.0 - (i % 4000) as f32 / 40.0) } else { 0.0 });
    Signal::new(samples.collect(), rate).unwrap()
}

fn place(room: &MeasuredRoom, t60_s: [f64; 7], seed: u64) -> RoomMatch {
    let (speech, dry) = (clicks(16_000), clicks(32_000));
    let input = MatchInput {
        speech: Recording { name: "speech", signal: &speech },
        dry: Recording { name: "dry", signal: &dry },
        room,
        source: &room.sources()[0].id,
        receiver: &room.receivers()[0].id,
    };
    let tracer = |duration_s: f64| -> Result<Box<dyn Propagator>, sabine::Error> {
        Ok(Box::new(PathTracer::new(TracerConfig { duration_s, seed, ..TracerConfig::default() })?))
    };
    match_room_with(&told(t60_s), &tracer, &input, &MatchConfig { seed, ..MatchConfig::default() }, &())
        .unwrap()
}

#[test]
fn real() {
    let room = MeasuredRoom::read("/work/shared/data/rooms/bras_cr2").unwrap();
    let m = place(&room, [1.4, 1.5, 2.0, 1.9, 1.7, 1.6, 1.0], 1);
    println!("{:#?}", m.seconds);
    println!("{:?}", m.t60_reached_s.values());
    println!("{:?}", m.warnings);
    println!("{:?}", m.eq_simulated_db);
    println!("{:?}", m.fit.iterations);
}
