//! What laws do to paths, against a plain loop over contributions that knows nothing of laws.

use proptest::prelude::*;
use sabine_acoustics::{Air, Bands, Material};
use sabine_paths::laws::{BoundLaws, Law, LawParameter, LawSite, LawTarget};
use sabine_paths::{Conditions, Contribution, Incidence, PathParameters, PathSet, Reflection};
use sabine_scene::{Receiver, Scene, Source};

const HZ: [f64; 6] = [125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0];
/// Materials of a box in the order of its faces.
const FLOOR: u32 = 4;

pub fn bands() -> Bands {
    Bands::octaves(125.0, 4000.0).unwrap()
}

/// A path as this test knows it.
#[derive(Clone, Debug)]
pub struct Known {
    length_m: f64,
    departure: [f64; 3],
    arrival: [f64; 3],
    /// Material, whether it scatters, cosine.
    pub meetings: Vec<(u32, bool, f64)>,
    /// How many of them are listed from the receiver backwards.
    back: usize,
}

pub fn known_paths() -> impl Strategy<Value = Vec<Known>> {
    let unit = |z: f64, azimuth: f64| {
        let r = (1.0 - z * z).sqrt();
        [r * azimuth.cos(), r * azimuth.sin(), z]
    };
    let direction = (-0.99f64..0.99, -3.1f64..3.1).prop_map(move |(z, azimuth)| unit(z, azimuth));
    // Cosines in the middle of what is told apart, so that the set keeps them.
    let meeting =
        (0u32..6, any::<bool>(), 0usize..252).prop_map(|(m, s, c)| (m, s, (c as f64 + 0.5) / 252.0));
    let path =
        (2.0f64..300.0, direction.clone(), direction, prop::collection::vec(meeting, 0..12), 0usize..12);
    let path = path.prop_map(|(length_m, departure, arrival, meetings, back)| {
        let back = back.min(meetings.len());
        Known { length_m, departure, arrival, meetings, back }
    });
    // More than a block.
    prop::collection::vec(path, 1..600)
}

pub fn path_set(known: &[Known]) -> PathSet {
    let mut paths = PathSet::new(6, 400.0);
    for (i, path) in known.iter().enumerate() {
        let mut chain = |meetings: &mut dyn Iterator<Item = &(u32, bool, f64)>| {
            meetings.fold(PathSet::DIRECT, |chain, &(material, scattered, cosine)| {
                let kind = if scattered { Reflection::Scattered } else { Reflection::Specular };
                paths.reflect_at(chain, material, kind, Incidence::Cosine(cosine))
            })
        };
        let front = path.meetings.len() - path.back;
        let (chain, tail) =
            (chain(&mut path.meetings[..front].iter()), chain(&mut path.meetings[front..].iter().rev()));
        paths.push(Contribution {
            length_m: path.length_m,
            log_weight: -0.02 * path.length_m,
            chain,
            tail,
            departure: path.departure,
            arrival: path.arrival,
            batch: Some((i % 32) as u8),
        });
    }
    paths
}

fn site() -> (LawSite, [f64; 3]) {
    let wall = Material::uniform(bands(), 0.1, 0.1).unwrap();
    let scene = Scene::shoebox([5.0, 4.0, 3.0], std::array::from_fn(|_| wall.clone())).unwrap();
    assert_eq!(scene.materials()[FLOOR as usize].name, "floor");
    let axis = [0.6, 0.0, 0.8];
    let source = Source { axis: Some(axis), ..Source::omni("s", [1.0, 1.0, 1.0]).unwrap() };
    let receiver = Receiver::omni("r", [3.0, 2.0, 1.0]).unwrap();
    (LawSite::new(&scene, &source, &receiver, &Air::default()), axis)
}

fn law(target: LawTarget, surface: Option<&str>, formula: &str, parameters: &[(&str, f64, &str)]) -> Law {
    let parameter = |&(name, value, unit): &(&str, f64, &str)| {
        (name.to_owned(), LawParameter::new(value, [value - 1.0, value + 1.0], unit))
    };
    let id = format!("l{}", formula.len());
    Law::new(id, target, surface, formula, parameters.iter().map(parameter)).unwrap()
}

/// A law and what the test's own loop says that it does to a path in a band, in dB.
type OwnRule = Box<dyn Fn(&Known, f64) -> f64>;

fn laws_and_rules() -> Vec<(Law, OwnRule)> {
    let (path, reflection) = (LawTarget::Path, LawTarget::Reflection);
    let speed = Air::default().speed_of_sound_m_s();
    let (_, axis) = site();
    let hits = |k: &Known, m: u32| k.meetings.iter().filter(|(material, ..)| *material == m).count() as f64;
    let azimuth = |d: [f64; 3]| d[1].atan2(d[0]);
    let grazing = |k: &Known, hz: f64| -> f64 {
        let step = if hz >= 2000.0 { -4.1 } else { 0.0 };
        k.meetings.iter().filter(|(m, ..)| *m == FLOOR).map(|(.., c)| step * (1.0 - c) * (1.0 - c)).sum()
    };
    vec![
        (
            law(
                path,
                None,
                "-a * length_m * (frequency_hz / f)^2",
                &[("a", 0.01, "dB/m"), ("f", 2.0, "kHz")],
            ),
            Box::new(|k, hz| -0.01 * k.length_m * (hz / 2000.0) * (hz / 2000.0)),
        ),
        (
            law(
                path,
                None,
                "a * resonance(frequency_hz, f, q)",
                &[("a", 6.0, "dB"), ("f", 700.0, "Hz"), ("q", 3.0, "1")],
            ),
            Box::new(|_, hz| 6.0 / (1.0 + 9.0 * (hz / 700.0 - 700.0 / hz).powi(2))),
        ),
        (
            law(
                path,
                None,
                "a * hits(floor) - b * reflections + c * scatterings",
                &[("a", 1.0, "dB"), ("b", 0.5, "dB"), ("c", 0.2, "dB")],
            ),
            Box::new(move |k, _| {
                let scattered = k.meetings.iter().filter(|(_, s, _)| *s).count() as f64;
                hits(k, FLOOR) - 0.5 * k.meetings.len() as f64 + 0.2 * scattered
            }),
        ),
        (
            law(
                path,
                None,
                "a * cos(departure_azimuth_deg - p) * sin(arrival_elevation_deg) + b * departure_cos",
                &[("a", 2.0, "dB"), ("p", 40.0, "deg"), ("b", 3.0, "dB")],
            ),
            Box::new(move |k, _| {
                let across: f64 = (0..3).map(|i| axis[i] * k.departure[i]).sum();
                2.0 * (azimuth(k.departure) - 40f64.to_radians()).cos() * k.arrival[2] + 3.0 * across
            }),
        ),
        (
            law(
                path,
                None,
                "a * (exp(-time_s / t * (frequency_hz / f)) - 1) * below(distance_m, d)",
                &[("a", 8.0, "dB"), ("t", 0.3, "s"), ("f", 1.0, "kHz"), ("d", 3.0, "m")],
            ),
            Box::new(move |k, hz| 8.0 * ((-k.length_m / speed / 0.3 * hz / 1000.0).exp() - 1.0)),
        ),
        (
            law(
                LawTarget::Recorder,
                None,
                "max(-a * time_after_direct_s, b)",
                &[("a", 20.0, "dB/s"), ("b", -6.0, "dB")],
            ),
            Box::new(|_, _| 0.0), // replaced below: it needs the shortest path
        ),
        (
            law(
                reflection,
                Some("floor"),
                "-a * (1 - cos_incidence)^2 * above(frequency_hz, f0)",
                &[("a", 4.1, "dB"), ("f0", 2.0, "kHz")],
            ),
            Box::new(grazing),
        ),
        (
            law(reflection, Some("ceiling"), "-a * frequency_hz / f", &[("a", 0.5, "dB"), ("f", 1.0, "kHz")]),
            Box::new(move |k, hz| -0.5 * hz / 1000.0 * hits(k, FLOOR + 1)),
        ),
        (
            law(
                path,
                None,
                "a * receiver(r) * ln(frequency_hz / f) + b * receiver(another) - a * length_m / l * source(another)",
                &[("a", 1.5, "dB"), ("b", 9.0, "dB"), ("f", 1.0, "kHz"), ("l", 2.0, "m")],
            ),
            Box::new(|_, hz| 1.5 * (hz / 1000.0).ln()),
        ),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn energies_are_those_of_a_plain_loop(known in known_paths(), chosen in 1usize..512) {
        let (paths, (site, _)) = (path_set(&known), site());
        let walls: Vec<Material> = (0..6).map(|i| Material::uniform(bands(), 0.05 + 0.1 * f64::from(i), 0.3).unwrap()).collect();
        let air = Air::default();
        let speed = air.speed_of_sound_m_s();
        let first_m = known.iter().map(|k| k.length_m).fold(f64::INFINITY, f64::min);
        let mut all = laws_and_rules();
        all[5].1 = Box::new(move |k, _| (-20.0 * (k.length_m - first_m) / speed).max(-6.0));
        let used: Vec<(Law, OwnRule)> =
            all.into_iter().enumerate().filter(|(i, _)| chosen >> i & 1 == 1).map(|(_, one)| one).collect();
        let laws: Vec<Law> = used.iter().map(|(law, _)| law.clone()).collect();
        let bound = BoundLaws::new(&laws, &site).unwrap();
        let plain = paths.energies(&Conditions::new(&walls, &air)).unwrap();
        let under = paths.energies(&Conditions::new(&walls, &air).with_laws(&bound)).unwrap();
        for (band, hz) in HZ.into_iter().enumerate() {
            for (i, path) in known.iter().enumerate() {
                let db: f64 = used.iter().map(|(_, rule)| rule(path, hz)).sum();
                let expected = f64::from(plain[band][i]) * 10f64.powf(db / 10.0);
                let found = f64::from(under[band][i]);
                // Lengths and sums are kept in single precision, directions to 0.005 degrees: 0.001 dB.
                prop_assert!((found - expected).abs() <= 3e-4 * expected + 1e-36, "{db} dB at {hz} Hz: {found} for {expected}, path {i}");
            }
        }
    }
}

#[test]
fn mirrors_of_a_box_take_the_angle_from_the_departure() {
    let mut paths = PathSet::new(6, 100.0);
    paths.set_axes([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let once = paths.reflect_at(PathSet::DIRECT, FLOOR, Reflection::Specular, Incidence::Axis(2));
    let both = paths.reflect_at(once, 5, Reflection::Specular, Incidence::Axis(2));
    let (mut push, z) = (
        |chain, departure| {
            paths.push(Contribution {
                length_m: 10.0,
                log_weight: 0.0,
                chain,
                tail: PathSet::DIRECT,
                departure,
                arrival: departure,
                batch: None,
            });
        },
        101.5_f64 / 252.0,
    );
    let down = [(1.0 - z * z).sqrt(), 0.0, -z];
    push(once, down);
    push(both, down);
    push(PathSet::DIRECT, down);
    let (site, _) = site();
    let laws = [
        law(LawTarget::Reflection, Some("floor"), "-a * (1 - cos_incidence)", &[("a", 10.0, "dB")]),
        law(LawTarget::Reflection, Some("ceiling"), "-a", &[("a", 3.0, "dB")]),
    ];
    let bound = BoundLaws::new(&laws, &site).unwrap();
    let walls = vec![Material::uniform(bands(), 0.1, 0.1).unwrap(); 6];
    let air = Air::default();
    let plain = paths.energies(&Conditions::new(&walls, &air)).unwrap();
    let under = paths.energies(&Conditions::new(&walls, &air).with_laws(&bound)).unwrap();
    let db = |i: usize| 10.0 * f64::from(under[0][i] / plain[0][i]).log10();
    let of_floor = -10.0 * (1.0 - z);
    assert!((db(0) - of_floor).abs() < 1e-3, "{} {of_floor}", db(0));
    assert!((db(1) - of_floor + 3.0).abs() < 1e-3 && db(2) == 0.0);
}

#[test]
fn what_has_no_value_on_some_path_is_an_error_and_never_a_number() {
    let known: Vec<Known> = (0..700)
        .map(|i| Known {
            length_m: 2.0 + f64::from(i),
            departure: [1.0, 0.0, 0.0],
            arrival: [0.0, 0.0, 1.0],
            meetings: vec![(0, false, 0.5); (i % 3) as usize],
            back: 0,
        })
        .collect();
    let (paths, (site, _)) = (path_set(&known), site());
    let walls = vec![Material::uniform(bands(), 0.1, 0.1).unwrap(); 6];
    let air = Air::default();
    let path =
        |formula: &str, parameters: &[(&str, f64, &str)]| law(LawTarget::Path, None, formula, parameters);
    let db = ("a", 1.0, "dB");
    for (law, words) in [
        (path("a / reflections", &[db]), "column 3 of its formula: division by zero on path 0"),
        (
            path("a / (length_m / l - 300)", &[db, ("l", 1.0, "m")]),
            "column 3 of its formula: division by zero on path 298",
        ),
        (
            path("a * ln(reflections * frequency_hz / f)", &[db, ("f", 1.0, "Hz")]),
            "column 5 of its formula: ln gives no finite number on path 0 at 125 Hz",
        ),
        (
            path("a * exp(length_m / l) * 1e-306", &[db, ("l", 0.5, "m")]),
            "column 5 of its formula: exp gives no finite number on path 353",
        ),
        (
            path(
                "a * sqrt(arrival_elevation_deg / l - departure_azimuth_deg / l - 91)",
                &[db, ("l", 1.0, "deg")],
            ),
            "sqrt gives no finite number on path 0",
        ),
        (path("a * length_m / l", &[db, ("l", 2.0, "m")]), "add 256.5 dB, more than 200 dB at 125 Hz"),
        (
            path("a * reflections^(0 - frequency_hz / f)", &[db, ("f", 1.0, "kHz")]),
            "^ gives no finite number on path 0 at 125 Hz",
        ),
    ] {
        let bound = BoundLaws::new(&[law], &site).unwrap();
        let conditions = Conditions::new(&walls, &air).with_laws(&bound);
        for error in [
            paths.energies(&conditions).unwrap_err(),
            paths.energy_response(&conditions, 1e-3).unwrap_err(),
            PathParameters::read(&paths, &conditions).unwrap_err(),
        ] {
            assert!(error.to_string().contains(words), "{error}");
        }
    }
    // An angle that nobody recorded; and what takes all is silence, not an error.
    let mut unknown = PathSet::new(6, 100.0);
    let chain = unknown.reflect(PathSet::DIRECT, FLOOR, Reflection::Specular);
    unknown.push(Contribution {
        length_m: 5.0,
        log_weight: 0.0,
        chain,
        tail: PathSet::DIRECT,
        departure: [1.0, 0.0, 0.0],
        arrival: [1.0, 0.0, 0.0],
        batch: None,
    });
    let with = |law: Law| {
        unknown.energies(&Conditions::new(&walls, &air).with_laws(&BoundLaws::new(&[law], &site).unwrap()))
    };
    let reflection =
        |formula: &str, value| law(LawTarget::Reflection, Some("floor"), formula, &[("a", value, "dB")]);
    let error = with(reflection("a * cos_incidence", 1.0)).unwrap_err().to_string();
    assert!(error.contains("`cos_incidence` is not known"), "{error}");
    assert_eq!(with(reflection("a", -1e30)).unwrap()[0][0], 0.0);
    assert!(with(reflection("a", 201.0)).is_err());
    let found = with(reflection("a", -2.0)).unwrap()[0][0]
        / unknown.energies(&Conditions::new(&walls, &air)).unwrap()[0][0];
    assert!((10.0 * found.log10() + 2.0).abs() < 1e-5);
    let early =
        Law::new("e", LawTarget::Delay, None, "t", [("t", LawParameter::new(-50.0, [-60.0, 0.0], "ms"))])
            .unwrap();
    let error = with(early.clone());
    assert!(error.is_ok()); // energies have no time ...
    let bound = BoundLaws::new(&[early], &site).unwrap();
    let error = unknown.energy_response(&Conditions::new(&walls, &air).with_laws(&bound), 1e-3).unwrap_err();
    assert!(error.to_string().contains("before it is emitted on path 0"), "{error}"); // ... responses do
}

#[test]
fn delays_and_added_energy_stand_in_the_response() {
    let known: Vec<Known> = (0..340)
        .map(|i| Known {
            length_m: 3.432 * f64::from(i + 1),
            departure: [1.0, 0.0, 0.0],
            arrival: [0.0, 0.0, 1.0],
            meetings: vec![],
            back: 0,
        })
        .take(100)
        .collect();
    let (paths, (site, _)) = (path_set(&known), site());
    let walls = vec![Material::uniform(bands(), 0.1, 0.1).unwrap(); 6];
    let air = Air::default();
    let speed = air.speed_of_sound_m_s();
    let laws = [
        law(LawTarget::Delay, None, "t + c * time_s", &[("t", 5.0, "ms"), ("c", 0.1, "1")]),
        law(
            LawTarget::Added,
            None,
            "a - b * time_after_direct_s",
            &[("a", -20.0, "dB"), ("b", 30.0, "dB/s")],
        ),
    ];
    let bound = BoundLaws::new(&laws, &site).unwrap();
    let conditions = Conditions::new(&walls, &air).with_laws(&bound);
    let energies = paths.energies(&conditions).unwrap();
    assert_eq!(energies, paths.energies(&Conditions::new(&walls, &air)).unwrap());
    let response = paths.energy_response(&conditions, 1e-3).unwrap();
    // A plain loop over contributions and milliseconds.
    let late = |m: f64| 1.1 * m / speed + 5e-3;
    let mut expected = vec![0.0; response.band(0).len()];
    for (k, &energy) in known.iter().zip(&energies[0]) {
        // As the set keeps it.
        let bin = (late(f64::from(k.length_m as f32)) * 1e3) as usize;
        if let Some(sum) = expected.get_mut(bin) {
            *sum += f64::from(energy);
        }
    }
    let first_s = late(f64::from(known[0].length_m as f32));
    for (bin, sum) in expected.iter_mut().enumerate() {
        let (begin, end) = ((bin as f64 * 1e-3 - first_s).max(0.0), (bin + 1) as f64 * 1e-3 - first_s);
        if end > begin {
            *sum += (end - begin) * 10f64.powf(-2.0 - 3.0 * 0.5 * (begin + end));
        }
    }
    for (bin, (found, expected)) in response.band(0).iter().zip(&expected).enumerate() {
        assert!((found - expected).abs() < 1e-6 * expected.max(1e-9), "{bin}: {found} for {expected}");
    }
    // Alone, added energy decays by 30 dB/s: 2 s of reverberation, whatever the paths.
    let loud = law(
        LawTarget::Added,
        None,
        "a - b * time_after_direct_s",
        &[("a", 90.0, "dB"), ("b", 150.0, "dB/s")],
    );
    let bound = BoundLaws::new(&[loud], &site).unwrap();
    let read = PathParameters::read(&paths, &Conditions::new(&walls, &air).with_laws(&bound)).unwrap();
    let t20_s = read.t20_s.values()[0].clone().unwrap().value;
    assert!((t20_s - 0.4).abs() < 2e-3, "{t20_s}");
    let sds = vec![sabine_acoustics::PerBand::from_fn(bands(), |_| 0.05); 6];
    let errors =
        PathParameters::read_material_errors(&paths, &Conditions::new(&walls, &air).with_laws(&bound), &sds)
            .unwrap();
    assert!(errors.t20_s.values()[0].clone().unwrap().standard_error < 1e-6);
}

#[test]
fn no_laws_and_laws_that_do_nothing_are_the_same_to_the_byte() {
    let known: Vec<Known> = (0..300)
        .map(|i| Known {
            length_m: 2.0 + f64::from(i),
            departure: [1.0, 0.0, 0.0],
            arrival: [0.0, 0.0, 1.0],
            meetings: vec![(i as u32 % 6, i % 2 == 0, 0.5)],
            back: 0,
        })
        .collect();
    let (paths, (site, _)) = (path_set(&known), site());
    let walls = vec![Material::uniform(bands(), 0.1, 0.2).unwrap(); 6];
    let air = Air::default();
    let none = BoundLaws::new(&[], &site).unwrap();
    let conditions = Conditions::new(&walls, &air);
    let plain = paths.energies(&conditions).unwrap();
    assert_eq!(plain, paths.energies(&conditions.with_laws(&none)).unwrap());
    let zero = law(LawTarget::Path, None, "0 * a * length_m", &[("a", 1.0, "dB/m")]);
    let zero = BoundLaws::new(&[zero], &site).unwrap();
    assert_eq!(plain, paths.energies(&conditions.with_laws(&zero)).unwrap());
    let fault = paths.delays_s(&conditions.with_laws(&zero)).unwrap();
    assert!(fault.is_none());
}

/// Six bands leave two of eight lanes over, in which the weight of a path that stands for many is all there is.
#[test]
fn paths_that_stand_for_many_are_not_too_loud() {
    let (site, _) = site();
    let mut paths = PathSet::new(6, 400.0);
    let chain = (0..12).fold(PathSet::DIRECT, |chain, _| {
        paths.reflect_at(chain, FLOOR, Reflection::Specular, Incidence::Cosine(0.5))
    });
    // 347 dB, of which the walls leave 108.
    paths.push(Contribution {
        length_m: 100.0,
        log_weight: 80.0,
        chain,
        tail: PathSet::DIRECT,
        departure: [1.0, 0.0, 0.0],
        arrival: [0.0, 0.0, 1.0],
        batch: Some(0),
    });
    let walls = vec![Material::uniform(bands(), 0.99, 0.2).unwrap(); 6];
    let air = Air::default();
    let taken = law(LawTarget::Reflection, Some("floor"), "-a * (1 - cos_incidence)", &[("a", 1.0, "dB")]);
    let bound = BoundLaws::new(&[taken], &site).unwrap();
    let conditions = Conditions::new(&walls, &air);
    let plain = paths.energies(&conditions).unwrap();
    let under = paths.energies(&conditions.with_laws(&bound)).unwrap();
    let ratio = f64::from(under[0][0]) / f64::from(plain[0][0]);
    assert!((ratio - 10f64.powf(-0.6)).abs() < 0.01, "{ratio}");
}
