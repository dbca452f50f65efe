//! Laws that come with the crate, held against the effects whose files they are, in the same hidden rooms.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use sabine_diagnose::{
    DiagnoseConfig, Diagnoser, Diagnosis, absorption_by_angle, channel_response, shipped_laws,
};
use sabine_paths::laws::{Law, LawSite};
use sabine_scene::{Levels, MeasuredRoom};
use sabine_testkit::{Hidden, LabConfig, Laboratory};

fn lab(config: LabConfig) -> Laboratory {
    Laboratory::new(LabConfig { seed: 25_111, receivers: 8, ..config }).unwrap()
}

fn law(id: &str) -> Law {
    shipped_laws().unwrap().into_iter().find(|law| law.id() == id).unwrap()
}

fn diagnose(room: &MeasuredRoom, effects: &[&str], laws: Vec<Law>) -> Diagnosis {
    let effects: Vec<String> = effects.iter().map(|id| (*id).to_owned()).collect();
    let config = DiagnoseConfig { rays: 1000, ..DiagnoseConfig::default() };
    let diagnoser = Diagnoser::new(config).unwrap().with_only(&effects).unwrap();
    diagnoser.with_laws(laws).unwrap().diagnose(room, &[], &()).unwrap()
}

/// What a law and an effect each find alone in one room.
struct Both {
    /// Evidence beside the baseline, in nats.
    nats: [f64; 2],
    /// Value and 90 % interval of the first parameter of the effect, and of those of the law by name.
    effect: (f64, f64, f64),
    law: Vec<(String, f64, f64, f64)>,
}

fn both(lab: &Laboratory, hidden: &Hidden, effect: &str, id: &str) -> Both {
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(std::slice::from_ref(hidden), &folder.path().join("room"), None).unwrap();
    let [by_effect, by_law] = [diagnose(&room, &[effect], Vec::new()), diagnose(&room, &[], vec![law(id)])];
    let cause = |found: &Diagnosis, id: &str| {
        assert_eq!(found.causes.len(), 1, "{id}: {:?}", found.candidates);
        assert_eq!(found.causes[0].effect, id);
        found.causes[0].clone()
    };
    let (own, more) = (cause(&by_effect, effect), cause(&by_law, id));
    let nats = [by_effect, by_law].map(|found| found.candidates[0].nats);
    let first = &own.parameters[0];
    let law = more.parameters.iter().map(|p| (p.name.clone(), p.value, p.low, p.high)).collect();
    let found = Both { nats, effect: (first.value, first.low, first.high), law };
    println!("{effect} {id}: nats {:?}, effect {:?}, law {:?}", found.nats, found.effect, found.law);
    found
}

impl Both {
    /// A law of another form than the effect, with fewer parameters, gives the data at least half of the evidence that the effect gives them:
    /// what it cannot say (levels of single octaves, a pattern of constant power) is left.
    fn explains_most(&self) {
        assert!(self.nats[1] > 0.5 * self.nats[0], "{:?}", self.nats);
    }

    fn law(&self, name: &str) -> (f64, f64, f64) {
        let found = self.law.iter().find(|p| p.0 == name).unwrap();
        (found.1, found.2, found.3)
    }
}

#[test]
#[ignore = "nightly: a minute and more, and the law of a clock is not ignored"]
fn laws_of_delay_find_what_clock_latency_and_temperature_find() {
    let lab = lab(LabConfig::default());
    // The same delays under the same priors: what differs is rounding, and of the temperature the second order (0.5 % at 3 K).
    let late = both(&lab, &Hidden::TimeZero { latency_s: 2e-3 }, "time_zero", "late_by_the_same");
    assert!((late.nats[0] - late.nats[1]).abs() < 0.1);
    assert!((late.law("d").0 - late.effect.0).abs() < 0.01);
    let warm = both(&lab, &Hidden::SoundSpeed { temperature_offset_k: 3.0 }, "sound_speed", "warmer_air");
    assert!((warm.nats[0] - warm.nats[1]).abs() < 0.5);
    assert!((warm.law("t").0 - 3.0).abs() < 0.3, "{:?}", warm.law);
}

/// A clock of a thousandth is less than thermometers leave open: evidence alone is compared.
#[test]
fn the_law_of_a_clock_is_as_probable_as_the_effect() {
    let lab = lab(LabConfig::default());
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(&[Hidden::SamplingClock { ppm: 600.0 }], &folder.path().join("room"), None).unwrap();
    let found = diagnose(&room, &["sampling_clock"], vec![law("clock_off")]);
    let nats = |id: &str| found.candidates.iter().find(|c| c.effect == id).unwrap().nats;
    assert!((nats("sampling_clock") - nats("clock_off")).abs() < 0.1, "{:?}", found.candidates);
}

#[test]
#[ignore = "nightly: a minute and more"]
fn the_law_of_air_finds_drier_air() {
    let lab = lab(LabConfig::default());
    let hidden = Hidden::random("air_absorption", 1.0, &lab, 1).unwrap();
    let found = both(&lab, &hidden, "air_absorption", "air_attenuation");
    found.explains_most();
    let Hidden::AirAbsorption { relative_humidity_percent } = hidden else { unreachable!() };
    let takes_more = relative_humidity_percent < lab.air().relative_humidity_percent();
    assert!((found.law("a").0 > 0.0) == takes_more, "{relative_humidity_percent} {:?}", found.law);
}

#[test]
fn the_law_of_a_loudspeaker_finds_one_that_falls() {
    let lab = lab(LabConfig::default());
    let gains_db = (0..lab.config().bands.len()).map(|b| -2.0 * b as f64).collect();
    let hidden = Hidden::TransducerResponse { gains_db };
    let found = both(&lab, &hidden, "transducer_response", "loudspeaker_response");
    // A straight line is all that this law says: it has fewer parameters to pay for.
    assert!(found.nats[1] > found.nats[0], "{:?}", found.nats);
    let ((a, low, high), (b, ..)) = (found.law("a"), found.law("b"));
    assert!((a + 2.0).abs() < 0.4 && low < high && b.abs() < 0.3, "{:?}", found.law);
}

#[test]
#[ignore = "nightly: a minute and more"]
fn the_law_of_noise_finds_noise() {
    let lab = lab(LabConfig::default());
    let levels_db = vec![-30.0; lab.config().bands.len()];
    let found = both(&lab, &Hidden::BackgroundNoise { levels_db }, "background_noise", "noise_floor");
    found.explains_most();
    assert!(found.law("l").1 > -80.0, "{:?}", found.law);
}

#[test]
#[ignore = "nightly: a minute and more"]
fn the_law_of_a_second_decay_finds_a_coupled_volume() {
    let lab = lab(LabConfig::default());
    let hidden = Hidden::random("coupled_volume", 1.0, &lab, 1).unwrap();
    let found = both(&lab, &hidden, "coupled_volume", "second_decay");
    found.explains_most();
    let Hidden::CoupledVolume { decay_s, .. } = hidden else { unreachable!() };
    let mean = decay_s.iter().sum::<f64>() / decay_s.len() as f64;
    assert!((found.law("t").0 / mean).ln().abs() < 0.4, "{decay_s:?} {:?}", found.law);
}

#[test]
#[ignore = "nightly: a minute and more"]
fn the_law_of_a_directional_loudspeaker_finds_one() {
    let lab = lab(LabConfig::default());
    let hidden = Hidden::random("source_directivity", 1.0, &lab, 1).unwrap();
    let found = both(&lab, &hidden, "source_directivity", "loudspeaker_to_the_front");
    found.explains_most();
    assert!(found.law("a").1 > 0.0, "{:?}", found.law);
}

#[test]
#[ignore = "nightly: a minute and more"]
fn the_law_of_directional_microphones_finds_them() {
    let lab = lab(LabConfig { microphone_axes: true, ..LabConfig::default() });
    let hidden = Hidden::random("receiver_directivity", 1.0, &lab, 1).unwrap();
    let found = both(&lab, &hidden, "receiver_directivity", "microphone_to_the_front");
    found.explains_most();
    assert!(found.law("a").1 > 0.0, "{:?}", found.law);
}

/// `absorption_by_angle` of each material of a room.
fn by_angle(room: &MeasuredRoom) -> Vec<Law> {
    let materials = room.scene().materials().iter().enumerate();
    materials.map(|(m, own)| absorption_by_angle(&format!("by_angle_{m}"), &own.name).unwrap()).collect()
}

#[test]
fn the_law_of_absorption_by_angle_finds_the_material_and_how_much_it_takes() {
    const HIDDEN_DB: f64 = 10.0;
    let lab = lab(LabConfig::default());
    let from_hz = lab.config().bands.nominal_hz(0);
    let hidden = Hidden::GrazingAbsorption { material: 0, db: HIDDEN_DB, from_hz };
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(&[hidden], &folder.path().join("room"), None).unwrap();
    let rivals = ["surface_absorption", "scattering", "angle_dependent_absorption", "air_absorption"];
    let found = diagnose(&room, &rivals, by_angle(&room));
    let named: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!(named, ["by_angle_0"], "{:?}", found.candidates);
    let parameters = &found.causes[0].parameters;
    println!("{:.1} nats {parameters:?}", found.causes[0].nats);
    assert!(parameters.iter().any(|p| p.name == "a" && p.low > 0.0), "{parameters:?}");
    let own = found.model.causes[0].law().unwrap();
    assert_eq!(own.surface(), Some(room.scene().materials()[0].name.as_str()));
    // At 60 and at 73 degrees, the same in all octaves. What is taken comes out low, by up to a quarter (docs/validation/laws.md).
    for cosine in [0.5, 0.3] {
        for hz in [500.0, 1000.0, 4000.0] {
            let taken_db = -own.value(|name| Some(if name == "frequency_hz" { hz } else { cosine })).unwrap();
            let expected_db = HIDDEN_DB * (1.0 - cosine).powi(2);
            assert!((taken_db / expected_db - 1.0).abs() < 0.25, "{cosine} {hz}: {taken_db} {expected_db}");
        }
    }
}

/// `channel_response` of each receiver of a room.
fn of_channels(room: &MeasuredRoom) -> Vec<Law> {
    let receivers = room.receivers().iter().enumerate();
    receivers.map(|(r, own)| channel_response(&format!("channel_{r}"), &own.id).unwrap()).collect()
}

#[test]
fn the_law_of_a_channel_finds_the_microphone_and_its_slope() {
    const SLOPE_DB: f64 = 2.5;
    const WHICH: usize = 5;
    let lab = lab(LabConfig::default());
    let bands = lab.config().bands;
    let flat = vec![0.0; bands.len()];
    let sloped = bands.iter_hz().map(|hz| SLOPE_DB * (hz / 1000.0).log2()).collect();
    let mut gains_db = vec![flat; lab.config().receivers];
    gains_db[WHICH] = sloped;
    let folder = tempfile::tempdir().unwrap();
    let hidden = [Hidden::ChannelResponse { gains_db }];
    let room = lab.write(&hidden, &folder.path().join("room"), None).unwrap();
    let found = diagnose(&room, &["transducer_response", "air_absorption"], of_channels(&room));
    let named: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!(named, [format!("channel_{WHICH}")], "{:?}", found.candidates);
    let own = &found.causes[0];
    println!("{:.1} nats {:?}", own.nats, own.parameters);
    let slope = own.parameters.iter().find(|p| p.name == "a").unwrap();
    assert!(
        (slope.value - SLOPE_DB).abs() < 0.5 && slope.low < SLOPE_DB && slope.high > SLOPE_DB,
        "{slope:?}"
    );
    // What is named renders: at that microphone, and at no other one.
    let law = found.model.causes[0].law().unwrap();
    for (r, receiver) in room.receivers().iter().enumerate() {
        let site = LawSite::new(room.scene(), &room.sources()[0], receiver, &room.air());
        let ask = |name: &str| if name == "frequency_hz" { Some(4000.0) } else { site.variable(name) };
        assert_eq!(law.value(ask).unwrap().abs() > 1.0, r == WHICH, "{}", receiver.id);
    }
}

#[test]
fn no_shipped_law_is_named_where_nothing_is_hidden() {
    let lab = lab(LabConfig { microphone_axes: true, levels: Levels::Absolute, ..LabConfig::default() });
    let folder = tempfile::tempdir().unwrap();
    let room = lab.write(&[], &folder.path().join("room"), None).unwrap();
    let found = diagnose(
        &room,
        &[],
        [shipped_laws().unwrap(), by_angle(&room), of_channels(&room)[..2].to_vec()].concat(),
    );
    assert!(found.causes.is_empty(), "{:?}", found.causes);
}
