//! The whole line with an estimator of one's own, so that what is heard is known.

use sabine::acoustics::{
    Bands, Error, Estimate, NoReading, PerBand, RoomEstimator, RoomTargets, Signal, equalisation,
};
use sabine::paths::{PathSet, Propagator};
use sabine::propagate::{PathTracer, TracerConfig};
use sabine::scene::MeasuredRoom;
use sabine::{MatchConfig, MatchInput, MatchSummary, Recording, RoomMatch, Warning, match_room_with};
use std::ops::ControlFlow;

/// Hears the same in everything.
struct Told(RoomTargets);

impl RoomEstimator for Told {
    fn estimate(&self, _: &Signal) -> Result<RoomTargets, Error> {
        Ok(self.0.clone())
    }
}

const EQ_DB: [f64; 7] = [-3.0, 2.0, 1.0, 0.5, 0.0, -2.0, -5.0];

fn told(t60_s: [f64; 7]) -> Told {
    let t60 = PerBand::from_fn(Bands::T60, |i| Estimate::new(t60_s[i], 0.05));
    let eq = PerBand::from_fn(Bands::EQ, |i| Estimate::new(EQ_DB[i], 1.0));
    Told(RoomTargets::new(t60, eq).unwrap())
}

/// Two seconds of clicks: anything that is not silent will do.
fn clicks(rate: u32) -> Signal {
    let sample = |i: u32| if i % 4000 < 40 { 0.5 * (1.0 - (i % 4000) as f32 / 40.0) } else { 0.0 };
    Signal::new((0..2 * rate).map(sample).collect(), rate).unwrap()
}

fn room() -> MeasuredRoom {
    MeasuredRoom::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room")).unwrap()
}

fn place(t60_s: [f64; 7], observer: &dyn sabine::acoustics::Observer) -> Result<RoomMatch, sabine::Error> {
    let (room, speech, dry) = (room(), clicks(16_000), clicks(48_000));
    let input = MatchInput {
        speech: Recording { name: "speech", signal: &speech },
        dry: Recording { name: "dry", signal: &dry },
        room: &room,
        source: &room.sources()[0].id,
        receiver: &room.receivers()[0].id,
    };
    let tracer = |duration_s: f64| -> Result<Box<dyn Propagator>, sabine::Error> {
        Ok(Box::new(PathTracer::new(TracerConfig { duration_s, seed: 3, ..TracerConfig::default() })?))
    };
    match_room_with(&told(t60_s), &tracer, &input, &MatchConfig::default(), observer)
}

#[test]
fn targets_are_reached_and_the_equalisation_is_the_one_heard() {
    let wanted = [0.9, 0.85, 0.8, 0.7, 0.65, 0.6, 0.5];
    let matched = place(wanted, &()).unwrap();
    for (band, wanted) in wanted.iter().enumerate() {
        let reached = matched.t60_reached_s.values()[band].as_ref().unwrap().value;
        assert!((reached / wanted - 1.0).abs() < 0.05, "band {band}: {reached} s for {wanted} s");
    }
    // The response through the filter, up to 2 kHz: at 4 kHz the step to -50 dB at 8 kHz reaches into the octave.
    let through = sabine::eqfilter::convolve(matched.response.samples(), matched.eq_filter.taps());
    let through = Signal::new(through, matched.response.sample_rate_hz()).unwrap();
    let heard = equalisation(&through.into(), Bands::EQ).unwrap();
    for (band, wanted) in EQ_DB.iter().enumerate().take(6) {
        let level_db = heard.values()[band].as_ref().unwrap().value;
        assert!((level_db - wanted).abs() < 1.5, "band {band}: {level_db} dB for {wanted} dB");
    }
    let summary = MatchSummary::new(&matched);
    assert_eq!(summary.unreachable.len(), 0);
    assert_eq!(summary.materials.len(), 8);
}

#[test]
fn what_air_forbids_is_said_and_not_hidden() {
    let matched = place([1.2, 1.2, 1.2, 1.2, 1.2, 1.2, 2.6], &()).unwrap();
    let summary = MatchSummary::new(&matched);
    let at_8_khz =
        summary.unreachable.iter().find(|u| u.band_hz == 8000.0).expect("8 kHz cannot decay in 2.6 s");
    assert!(at_8_khz.reason.contains("air"), "{}", at_8_khz.reason);
    assert!(matched.warnings.iter().any(|w| matches!(w, Warning::Unreachable(u) if u.band_hz == 8000.0)));
    let reached = matched.t60_reached_s.at_hz(8000.0).unwrap().as_ref().map(|t| t.value);
    assert!(reached.is_err() || reached.is_ok_and(|t| t < 2.0), "{reached:?}");
}

#[test]
fn an_observer_stops_the_match() {
    let stop = |stage: &str, _: u64, _: u64| {
        if stage == "tracing" { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let error = place([0.6; 7], &stop).unwrap_err();
    assert!(error.to_string().contains("stopped on request"), "{error}");
}

/// A tracer that finds nothing.
struct Blind;

impl Propagator for Blind {
    fn trace(
        &self,
        scene: &sabine::scene::Scene,
        _: &sabine::scene::Source,
        _: &sabine::scene::Receiver,
        _: &sabine::acoustics::Air,
        _: &dyn sabine::acoustics::Observer,
    ) -> Result<PathSet, Error> {
        Ok(PathSet::new(scene.materials().len(), 100.0))
    }
}

#[test]
fn a_receiver_that_no_path_reaches_is_named() {
    let (room, speech) = (room(), clicks(48_000));
    let input = MatchInput {
        speech: Recording { name: "speech", signal: &speech },
        dry: Recording { name: "dry", signal: &speech },
        room: &room,
        source: &room.sources()[0].id,
        receiver: &room.receivers()[0].id,
    };
    let blind = |_: f64| -> Result<Box<dyn Propagator>, sabine::Error> { Ok(Box::new(Blind)) };
    let error = match_room_with(&told([0.6; 7]), &blind, &input, &MatchConfig::default(), &()).unwrap_err();
    assert!(matches!(&error, sabine::Error::NoPath { receiver, .. } if *receiver == room.receivers()[0].id));
    // The reasons for a missing number read as sentences.
    assert!(NoReading::NoOnset.to_string().contains("silent"));
}
