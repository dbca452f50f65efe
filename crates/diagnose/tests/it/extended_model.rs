//! The extended model as a list of causes: joined, taken apart, drawn from.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

use sabine_diagnose::{Error, ExtendedModel, ModelChange};
use sabine_paths::{Conditions, Propagator};
use sabine_propagate::{PathTracer, TracerConfig};
use sabine_scene::MeasuredRoom;

const HEAD: &str = "version = 2\ncentres_hz = [500, 1000]\n[absorption]\n\"a/b~c\" = [0.3, 0.4]\n";
const LATE: &str = r#"
[[causes]]
id = "time_zero"
[[causes.parameters]]
name = "latency"
value = 3.0
low = -inf
high = 3.2
unit = "ms"
[[causes.changes]]
latency_s = 0.003
"#;
const LOUD: &str = r#"
[[causes]]
id = "channel_fault"
subject = "gain of s-r"
changes = [{ response_gain = { response = "s-r", gain_db = 2.0 } }, "diffraction"]
"#;
const UNSURE: &str = r#"
[uncertainty]
numbers = ["/absorption/a~1b~0c/0", "/causes/0/changes/0/latency_s", "/causes/1/changes/0/response_gain/gain_db"]
covariance = [[0.0025], [0.000004, 1e-8], [0.0, 0.0, 0.04]]
"#;

fn read(text: &str) -> Result<ExtendedModel, Error> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.toml");
    std::fs::write(&path, text).unwrap();
    ExtendedModel::read(path)
}

fn whole() -> ExtendedModel {
    read(&format!("{HEAD}{LATE}{LOUD}{UNSURE}")).unwrap()
}

#[test]
fn a_model_comes_back_to_the_byte() {
    let written = whole().to_toml().unwrap();
    let again = read(&written).unwrap();
    assert!(again == whole() && again.to_toml().unwrap() == written);
    assert_eq!(again.causes[1].name(), "channel_fault (gain of s-r)");
    let applied = again.applied();
    assert_eq!((applied.latency_s, applied.response_gain_db["s-r"]), (Some(0.003), 2.0));
    assert!(applied.diffraction);
}

#[test]
fn walls_that_react_locally_are_rendered() {
    let room = MeasuredRoom::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room")).unwrap();
    let with = |change: &str| {
        let cause = format!("[[causes]]\nid = \"angle_dependent_absorption\"\nchanges = [{{ {change} }}]\n");
        read(&format!("version = 2\ncentres_hz = [500, 1000]\n[absorption]\n{cause}"))?.room(&room)
    };
    let extended = with("locally_reacting_share = 1.0").unwrap();
    let materials: Vec<_> = extended.scene.materials().iter().map(|m| m.material.clone()).collect();
    let config = TracerConfig { rays: 200, duration_s: 0.3, ..TracerConfig::default() };
    let (source, receiver) = (&extended.sources[0], &extended.receivers[0]);
    let paths = PathTracer::new(config).unwrap();
    let paths = paths.trace(&extended.scene, source, receiver, &extended.air, &()).unwrap();
    let energies = |conditions: &Conditions<'_>| paths.energies(conditions).unwrap().concat();
    let found = energies(&extended.conditions(&materials, 0, 0));
    let plain = Conditions::new(&materials, &extended.air);
    assert_eq!(found, energies(&plain.with_local_reaction(1.0, &materials)));
    assert_ne!(found, energies(&plain));
    let error = with("locally_reacting_share = 1.6").unwrap_err();
    assert!(error.to_string().contains("locally_reacting_share"), "{error}");
}

#[test]
fn causes_of_two_models_stand_together_and_apart_again() {
    let late = read(&format!(
        "{HEAD}{LATE}{}",
        UNSURE
            .replace(", \"/causes/1/changes/0/response_gain/gain_db\"", "")
            .replace(", [0.0, 0.0, 0.04]", "")
    ))
    .unwrap();
    let unsure = "[uncertainty]\nnumbers = [\"/absorption/a~1b~0c/0\", \"/causes/0/changes/0/response_gain/gain_db\"]\ncovariance = [[0.1], [0, 0.04]]";
    let loud = read(&format!("{HEAD}{LOUD}{unsure}").replace("0.3, 0.4", "0.8, 0.9")).unwrap();
    let joined = late.clone().merged(loud).unwrap();
    // The first model's absorption, and how sure it was; each cause with its own.
    assert_eq!(joined, whole());
    assert_eq!(joined.clone().without(1), late);
    let gain = joined.without(0);
    let known = gain.uncertainty.unwrap();
    assert_eq!(known.numbers, ["/absorption/a~1b~0c/0", "/causes/0/changes/0/response_gain/gain_db"]);
    assert_eq!(known.covariance, [vec![0.0025], vec![0.0, 0.04]]);
    assert!(matches!(whole().merged(late), Err(Error::ModelsDisagree { .. })));
}

#[test]
fn draws_have_the_covariance_that_the_model_states() {
    let count = 4000;
    let draws = whole().draws(count, 7).unwrap();
    let numbers = |model: &ExtendedModel| {
        let applied = model.applied();
        [applied.absorption["a/b~c"][0], applied.latency_s.unwrap(), applied.response_gain_db["s-r"]]
    };
    let all: Vec<[f64; 3]> = draws.iter().map(numbers).collect();
    let mean = |f: &dyn Fn(&[f64; 3]) -> f64| all.iter().map(f).sum::<f64>() / count as f64;
    let centre = [0, 1, 2].map(|k| mean(&|x| x[k]));
    for (i, k, wanted) in [(0, 0, 0.0025), (1, 0, 4e-6), (1, 1, 1e-8), (2, 2, 0.04), (2, 0, 0.0), (2, 1, 0.0)]
    {
        let found = mean(&|x| (x[i] - centre[i]) * (x[k] - centre[k]));
        let sd: [f64; 3] = [0.05, 1e-4, 0.2];
        // Standard error of a covariance: below sqrt(2) sd_i sd_k / sqrt(n).
        let tolerance = 4.0 * 2f64.sqrt() * sd[i] * sd[k] / (count as f64).sqrt();
        assert!((found - wanted).abs() < tolerance, "({i}, {k}): {found} for {wanted}");
    }
    for (k, (wanted, sd)) in [(0.3, 0.05), (0.003, 1e-4), (2.0, 0.2)].into_iter().enumerate() {
        assert!((centre[k] - wanted).abs() < 4.0 * sd / (count as f64).sqrt(), "{}", centre[k]);
    }
    let drawn = &draws[0];
    assert!(drawn.uncertainty.is_none() && drawn.causes[0].parameters.is_empty());
    assert_eq!(drawn.causes[1].changes[1], ModelChange::Diffraction);
    assert!(whole().draws(3, 7).unwrap() == draws[..3] && whole().draws(3, 8).unwrap() != draws[..3]);
    let mut sure = whole();
    sure.uncertainty = None;
    assert_eq!(sure.draws(2, 0).unwrap()[1].applied(), sure.applied());
}

#[test]
fn what_is_wrong_with_a_model_is_named() {
    let text = format!("{HEAD}{LATE}{LOUD}{UNSURE}");
    for (from, to, words) in [
        ("version = 2\n", "", "missing field `version`"),
        ("version = 2", "version = 1", "version 1 of extended models is not read, 2 is"),
        ("latency_s", "lateness", "unknown variant `lateness`"),
        ("\"diffraction\"", "\"refraction\"", "unknown variant `refraction`"),
        ("id = \"channel_fault\"\nsubject = \"gain of s-r\"", "id = \"time_zero\"", "causes, time_zero"),
        ("/causes/1/changes/0/r", "/causes/2/changes/0/r", "uncertainty.numbers"),
        ("/causes/0/changes/0/latency_s\", ", "/absorption/a~1b~0c/0\", ", "uncertainty.numbers"),
        ("[0.000004, 1e-8]", "[0.000004]", "uncertainty.covariance, row 2"),
        ("[0.000004, 1e-8]", "[0.0004, 1e-8]", "at most the product of the two standard deviations"),
        ("[0.0025]", "[-1]", "a finite variance"),
        (", [0.0, 0.0, 0.04]", "", "uncertainty.covariance"),
    ] {
        assert!(text.contains(from), "{from}");
        let error = read(&text.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(error.contains(words) && error.contains("model.toml"), "{words}: {error}");
    }
}
