//! Laws of several parameters, of delay and of added sound, as causes: hidden by physics that knows nothing of formulas.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use sabine_acoustics::Bands;
use sabine_diagnose::{Cause, DiagnoseConfig, Diagnoser, Diagnosis, Error};
use sabine_paths::laws::{Law, LawParameter, LawTarget};
use sabine_scene::MeasuredRoom;
use sabine_testkit::{Hidden, LabConfig, Laboratory, at_night};

/// The seat dip of the room in this file.
const DIP_DB: f64 = 20.0;
const DIP_HZ: f64 = 1000.0;
const DIP_Q: f64 = 0.5;

fn room(seed: u64, hidden: impl Fn(&Laboratory) -> Hidden) -> (tempfile::TempDir, MeasuredRoom, Hidden) {
    room_in(None, seed, hidden)
}

/// In a few octaves, recorded at 16 kHz, where these are given; at night in all.
fn room_in(
    few: Option<Bands>,
    seed: u64,
    hidden: impl Fn(&Laboratory) -> Hidden,
) -> (tempfile::TempDir, MeasuredRoom, Hidden) {
    let all = LabConfig { seed, receivers: 8, ..LabConfig::default() };
    let config = match few {
        Some(bands) if !at_night() => LabConfig { bands, sample_rate_hz: 16_000, ..all },
        _ => all,
    };
    let lab = Laboratory::new(config).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let hidden = hidden(&lab);
    let room = lab.write(std::slice::from_ref(&hidden), &folder.path().join("room"), None).unwrap();
    (folder, room, hidden)
}

fn p(value: f64, interval: [f64; 2], unit: &str) -> LawParameter {
    LawParameter::new(value, interval, unit)
}

/// What rows of seats take from sound that grazes them, about a frequency that is not known.
fn seat_dip(id: &str, surface: &str, f0_khz: [f64; 2]) -> Law {
    let formula = "-a * (1 - cos_incidence)^2 * resonance(frequency_hz, f0, q)";
    let f0 = p((f0_khz[0] * f0_khz[1]).sqrt(), f0_khz, "kHz");
    let parameters = [("a", p(10.0, [0.0, 30.0], "dB")), ("f0", f0), ("q", p(DIP_Q, [DIP_Q; 2], "1"))];
    Law::new(id, LawTarget::Reflection, Some(surface), formula, parameters).unwrap()
}

fn diagnose(room: &MeasuredRoom, laws: Vec<Law>, rivals: &[&str], rays: usize) -> Result<Diagnosis, Error> {
    let rivals: Vec<String> = rivals.iter().map(|id| (*id).to_owned()).collect();
    let config = DiagnoseConfig { rays, ..DiagnoseConfig::default() };
    Diagnoser::new(config)?.with_only(&rivals)?.with_laws(laws)?.diagnose(room, &[], &())
}

/// What else takes sound from some reflections.
const TAKERS: [&str; 4] =
    ["surface_absorption", "scattering", "angle_dependent_absorption", "transducer_response"];

fn only(found: &Diagnosis) -> &Cause {
    let names: Vec<&str> = found.causes.iter().map(|c| c.effect.as_str()).collect();
    assert_eq!(found.causes.len(), 1, "{names:?} {:?}", found.candidates);
    &found.causes[0]
}

#[test]
#[ignore = "nightly: minutes, and shipped laws of several parameters are not ignored"]
fn depth_and_frequency_of_a_hidden_seat_dip_are_found_together() {
    let dip = |_: &Laboratory| Hidden::SeatDip { material: 0, db: DIP_DB, f0_hz: DIP_HZ, q: DIP_Q };
    let (_folder, room, _) = room(24_110, dip);
    let materials: Vec<&str> = room.scene().materials().iter().map(|m| m.name.as_str()).collect();
    let of = |name: &&str| seat_dip(&format!("dip_{name}"), name, [0.25, 4.0]);
    let laws = materials.iter().take(3).map(of).collect();
    let found = diagnose(&room, laws, &TAKERS, 1000).unwrap();
    let cause = only(&found);
    assert_eq!(cause.effect, format!("dip_{}", materials[0]));
    let [a, f0] = &cause.parameters[..] else { panic!("{:?}", cause.parameters) };
    assert!(a.name == "a" && (a.value - DIP_DB).abs() < 7.0 && a.low > 0.0, "{a:?}");
    assert!(f0.name == "f0" && f0.unit == "kHz", "{f0:?}");
    assert!((1000.0 * f0.value / DIP_HZ).log2().abs() < 0.8, "{f0:?}");
    assert!(f0.low < f0.value && f0.value < f0.high && f0.high - f0.low < 2.0, "{f0:?}");
    // The model renders both, with their intervals, and what keeps its value.
    let law = found.model.causes[0].law().unwrap();
    let own: Vec<(f64, f64, f64)> = law.parameters().map(|(_, p)| (p.value, p.low, p.high)).collect();
    assert_eq!(own, [(a.value, a.low, a.high), (f0.value, f0.low, f0.high), (DIP_Q, DIP_Q, DIP_Q)]);
    assert!(found.model.room(&room).is_ok());
    // Both are in its covariance, so that draws have both.
    let text = found.model.to_toml().unwrap();
    for name in ["a", "f0"] {
        assert!(text.contains(&format!("/{name}/value")), "{text}");
    }
}

/// One amplitude alone is fitted on all paths; a second parameter, however narrow its interval, brings classes of paths. A tenth of what a
/// name needs is what both may differ by. The laws are the same in all octaves: what leaks in from a neighbouring octave is taken at its own
/// frequency by classes and at that of the band by the tables, which differs by more (0.6 nats of 10 for the seat dip of 10 dB).
#[test]
fn classes_of_paths_give_what_all_paths_give() {
    let dip = |_: &Laboratory| Hidden::SeatDip { material: 0, db: 10.0, f0_hz: DIP_HZ, q: DIP_Q };
    let (_folder, room, _) = room_in(Some(Bands::octaves(500.0, 4000.0).unwrap()), 24_110, dip);
    let name = room.scene().materials()[0].name.clone();
    let grazing = |n: [f64; 2]| {
        let parameters = [("a", p(1.0, [0.0, 6.0], "dB")), ("n", p(2.0, n, "1"))];
        Law::new("x", LawTarget::Reflection, Some(&name), "-a * (1 - cos_incidence)^n", parameters).unwrap()
    };
    let along = "-a * (1 - abs(cos(departure_azimuth_deg)))";
    let by_azimuth = |id: &str, formula: &str, more: Option<(&'static str, LawParameter)>| {
        let a = ("a", p(1.0, [-6.0, 6.0], "dB"));
        Law::new(id, LawTarget::Path, None, formula, more.into_iter().chain([a])).unwrap()
    };
    let narrow = ("k", p(1.0, [0.999, 1.001], "1"));
    let pairs = [
        [grazing([2.0, 2.0]), grazing([1.999, 2.001])],
        [by_azimuth("x", along, None), by_azimuth("x", &format!("{along}^k"), Some(narrow))],
    ];
    for [all_paths, classes] in pairs.into_iter().take(if at_night() { 2 } else { 1 }) {
        let of = |law: Law| {
            let found = diagnose(&room, vec![law], &[], 1000).unwrap();
            let score = found.candidates.iter().find(|c| c.effect == "x").unwrap();
            (score.nats, found.causes.first().map(|c| c.parameters[0].value))
        };
        let ((nats, value), (more_nats, near)) = (of(all_paths), of(classes));
        assert!((nats - more_nats).abs() < 0.3, "{nats} {more_nats}");
        assert_eq!(value.is_some(), near.is_some());
        if let (Some(value), Some(near)) = (value, near) {
            assert!((value - near).abs() < 0.15, "{value} {near}");
        }
    }
}

#[test]
fn what_cannot_be_fitted_names_law_and_parameter() {
    let two = Bands::octaves(1000.0, 2000.0).unwrap();
    let (_folder, room, _) = room_in(Some(two), 24_110, |_| Hidden::SamplingClock { ppm: 0.0 });
    let said = |law: Law| diagnose(&room, vec![law], &[], 500).unwrap_err().to_string();
    let of = |target: LawTarget, formula: &str, parameters: Vec<(&str, LawParameter)>| {
        Law::new("mine", target, None, formula, parameters).unwrap()
    };
    let a = ("a", p(1.0, [0.0, 2.0], "dB"));
    // An end of an interval at which the law has no value, or is too loud.
    let zero = ("f0", p(1.0, [0.0, 2.0], "kHz"));
    let said_zero =
        said(of(LawTarget::Path, "a * length_m / length_m * frequency_hz / f0", vec![a.clone(), zero]));
    assert!(said_zero.starts_with("law `mine`: with a = 0, f0 = 0 it has no value at "), "{said_zero}");
    let steep = ("n", p(1.0, [0.0, 9.0], "1"));
    let said_loud = said(of(LawTarget::Path, "a * (reflections + 1)^n", vec![a.clone(), steep]));
    assert!(said_loud.starts_with("law `mine`: with a = 2, n = 9 it adds "), "{said_loud}");
    // Names are looked for before anything is traced, in laws of delay and of added sound, too.
    let elsewhere = of(LawTarget::Delay, "d * recording_order", vec![("d", p(1.0, [0.0, 2.0], "ms"))]);
    assert!(said(elsewhere).contains("`mine`, column 5 of its formula: `recording_order` is not known"));
    let still = of(LawTarget::Added, "l", vec![("l", p(-20.0, [-20.0, -20.0], "dB"))]);
    assert_eq!(said(still), "law `mine`: no parameter has an interval: nothing is left to fit");
    let many: Vec<(String, LawParameter)> =
        (0..11).map(|i| (format!("c{i}"), p(1.0, [0.0, 2.0], "1"))).collect();
    let formula: Vec<String> = many.iter().map(|(name, _)| name.clone()).collect();
    let formula = format!("a * ({})", formula.join(" + "));
    let parameters = many.into_iter().chain([("a".to_owned(), p(1.0, [0.0, 2.0], "dB"))]);
    let many = Law::new("mine", LawTarget::Path, None, &formula, parameters).unwrap();
    assert!(said(many).starts_with("law `mine`: 12 parameters have an interval (a, c0, c1, c10, c2,"));
}

/// Rooms that nobody has looked at before: `SABINE_ROOMS=6 SABINE_SEED=N cargo test -p sabine-diagnose --test it seat_dips_in_rooms -- --ignored
/// --nocapture` prints a row for each.
#[test]
#[ignore = "nightly: minutes; prints the table of docs/validation/laws.md"]
fn seat_dips_in_rooms_of_any_seed() {
    let number =
        |name: &str, other: u64| std::env::var(name).ok().map_or(other, |text| text.parse().unwrap());
    let (rooms, first) = (number("SABINE_ROOMS", 2), number("SABINE_SEED", 24_111));
    let mut wrong = 0;
    for seed in first..first + rooms {
        let (_folder, room, hidden) = room(seed, |lab| Hidden::random("seat_dip", 1.0, lab, seed).unwrap());
        let Hidden::SeatDip { material, db, f0_hz, .. } = hidden else { unreachable!() };
        let materials: Vec<&str> = room.scene().materials().iter().map(|m| m.name.as_str()).collect();
        // Its own material and two others.
        let others = materials.iter().filter(|name| **name != materials[material]).take(2);
        let of = |name: &&str| seat_dip(&format!("dip_{name}"), name, [0.25, 4.0]);
        let laws = others.chain([&materials[material]]).map(of).collect();
        let found = diagnose(&room, laws, &TAKERS, 1000).unwrap();
        let named: Vec<String> = found.causes.iter().map(|c| c.effect.clone()).collect();
        let values: Vec<String> = found
            .causes
            .iter()
            .flat_map(|c| &c.parameters)
            .map(|p| format!("{} {:.2} [{:.2}, {:.2}]", p.name, p.value, p.low, p.high))
            .collect();
        let best = &found.candidates[0];
        println!(
            "| {seed} | dip_{} {db:.1} dB at {f0_hz:.0} Hz | {} | {} | {} {:.1} nats |",
            materials[material],
            named.join(", "),
            values.join("; "),
            best.effect,
            best.nats
        );
        wrong += usize::from(named.iter().any(|name| *name != format!("dip_{}", materials[material])));
    }
    assert_eq!(wrong, 0, "rooms with another name");
}
