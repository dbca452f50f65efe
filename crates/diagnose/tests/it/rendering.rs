//! Models read from files and what they do to responses, against closed forms.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

use sabine_acoustics::{Bands, FilterBank, ImpulseResponse, SampleFormat, Signal, encode_wav};
use sabine_diagnose::{DisplacementError, Error, ExtendedModel, ExtendedRoom};
use sabine_paths::{Conditions, Propagator};
use sabine_propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine_scene::MeasuredRoom;
use std::path::PathBuf;

const RATE_HZ: u32 = 32_000;
const BANDS: Bands = Bands::T60;

fn fixture() -> MeasuredRoom {
    MeasuredRoom::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room")).unwrap()
}

/// A model with some changes, a line each; lines on absorption are none.
fn in_file(lines: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("extended_model.toml");
    let (absorption, changes): (Vec<&str>, Vec<&str>) =
        lines.lines().partition(|line| line.starts_with("absorption"));
    let changes: Vec<String> = changes.iter().map(|change| format!("{{ {change} }}")).collect();
    let head = "version = 2\ncentres_hz = [125, 250, 500, 1000, 2000, 4000, 8000]";
    let cause = format!("[[causes]]\nid = \"by_hand\"\nchanges = [{}]", changes.join(", "));
    std::fs::write(&path, format!("{head}\n{}\n{cause}\n", absorption.join("\n"))).unwrap();
    (folder, path)
}

fn extended(text: &str) -> ExtendedRoom {
    let (_folder, path) = in_file(text);
    ExtendedModel::read(path).unwrap().room(&fixture()).unwrap()
}

/// Why there is no room of a model.
fn refused(text: &str) -> Error {
    let (_folder, path) = in_file(text);
    ExtendedModel::read(path).and_then(|model| model.room(&fixture())).unwrap_err()
}

fn finished(text: &str, samples: Vec<f32>) -> Vec<f32> {
    let response = ImpulseResponse::new(samples, RATE_HZ).unwrap();
    extended(text).finish("talker", "microphone", response, 3).unwrap().into_samples()
}

fn pulse(at: usize, length: usize) -> Vec<f32> {
    let mut samples = vec![0.0; length];
    samples[at] = 1.0;
    samples
}

/// Energy by octave, 1 for a unit pulse.
fn energies(samples: &[f32]) -> Vec<f64> {
    let bank = FilterBank::new(BANDS, RATE_HZ).unwrap();
    let sums = |samples: &[f32]| -> Vec<f64> {
        let split = bank.analyse(samples);
        split.values().iter().map(|b| b.iter().map(|&s| f64::from(s).powi(2)).sum()).collect()
    };
    sums(samples).iter().zip(sums(&pulse(8000, 16_000))).map(|(e, one)| e / one).collect()
}

fn db(ratio: f64) -> f64 {
    10.0 * ratio.log10()
}

/// Four standard deviations of the energy of noise of a band in a time, as a share.
fn four_sd(band: usize, seconds: f64) -> f64 {
    let (low, high) = BANDS.edges_hz(band);
    4.0 / ((high - low) * seconds).sqrt()
}

fn room_of_fixture() -> (MeasuredRoom, ImpulseResponse) {
    let room = fixture();
    let tracer = PathTracer::new(TracerConfig { rays: 2000, duration_s: 0.8, ..TracerConfig::default() });
    let paths =
        tracer.unwrap().trace(room.scene(), &room.sources()[0], &room.receivers()[0], &room.air(), &());
    let config = RenderConfig { sample_rate_hz: RATE_HZ, ..RenderConfig::default() };
    let materials: Vec<_> = room.scene().materials().iter().map(|m| m.material.clone()).collect();
    let response = PressureRenderer::new(config)
        .unwrap()
        .render(&paths.unwrap(), &Conditions::new(&materials, &room.air()));
    (room, response.unwrap())
}

/// Reflections that come from where a level surface 0.8 m below the talker and 0.6 m below the microphone has its image, 1.4 m lower: with a
/// change of the model, and without.
fn reflections_at_0_7_m(room: &MeasuredRoom) -> [usize; 2] {
    let config = TracerConfig { rays: 500, duration_s: 0.1, ..TracerConfig::default() };
    let tracer = PathTracer::new(config).unwrap();
    let away_m = (4.6f64.powi(2) + 1.1f64.powi(2) + 1.4f64.powi(2)).sqrt();
    let found = |room: &MeasuredRoom| {
        let (source, receiver) = (&room.sources()[0], &room.receivers()[0]);
        let paths = tracer.trace(room.scene(), source, receiver, &room.air(), &()).unwrap();
        let near = |i: &usize| paths.is_exact(*i) && (f64::from(paths.lengths_m()[*i]) - away_m).abs() < 1e-3;
        (0..paths.len()).filter(near).count()
    };
    [found(room), found(&fixture())]
}

#[test]
fn a_sheet_reflects_where_its_image_says() {
    let text = "sheet = { absorption = 0.2, corners_m = [[3.4, 1.2, 0.7], [5.0, 1.2, 0.7], [5.0, 3.0, 0.7], [3.4, 3.0, 0.7]] }";
    let stated = fixture();
    let room = extended(text).measured_room(&stated).unwrap();
    assert_eq!(room.scene().materials().len(), stated.scene().materials().len() + 1);
    assert_eq!(reflections_at_0_7_m(&room), [1, 0]);
}

/// A table of the same height, of a material of the room.
const TABLE: &str = "object = { foot_m = [4.2, 2.1, 0.0], size_m = [1.6, 1.8, 0.7], turn_deg = 0.0, material = \"MATERIAL\" }";

#[test]
fn an_object_reflects_where_its_image_says() {
    let stated = fixture();
    let name = stated.scene().materials()[0].name.clone();
    let room = extended(&TABLE.replace("MATERIAL", &name)).measured_room(&stated).unwrap();
    assert_eq!(room.scene().materials(), stated.scene().materials());
    assert_eq!(room.scene().triangles().len(), stated.scene().triangles().len() + 12);
    assert_eq!(reflections_at_0_7_m(&room), [1, 0]);
}

#[test]
fn an_object_that_cannot_stand_there_is_refused_by_name() {
    let name = fixture().scene().materials()[0].name.clone();
    let table = TABLE.replace("MATERIAL", &name);
    let unknown = refused(TABLE).to_string();
    assert!(unknown.contains("object.material") && unknown.contains("MATERIAL"), "{unknown}");
    for (from, to, field) in [
        ("0.7]", "0.0]", "object.size_m"),
        ("turn_deg = 0.0", "turn_deg = 400.0", "object.turn_deg"),
        ("foot_m = [4.2", "foot_m = [inf", "object.foot_m"),
    ] {
        let error = refused(&table.replace(from, to)).to_string();
        assert!(error.contains(field), "{error}");
    }
    // Over the microphone.
    let [x, y, _] = fixture().receivers()[0].position_m;
    let over = table.replace("[4.2, 2.1, 0.0]", &format!("[{x:?}, {y:?}, 0.0]")).replace("0.7]", "2.0]");
    let error = refused(&over);
    assert!(
        matches!(&error, Error::Displacement(DisplacementError::Outside { id }) if id == "microphone"),
        "{error}"
    );
}

#[test]
fn a_model_that_changes_nothing_changes_nothing() {
    let (_, response) = room_of_fixture();
    assert_eq!(finished("", response.samples().to_vec()), response.samples());
}

#[test]
fn noise_has_the_stated_energy_in_every_octave() {
    let seconds = 4.0;
    let silence = vec![0.0; (seconds * f64::from(RATE_HZ)) as usize];
    // Up to 6 dB an octave down, then up again: what neighbours leak into the quiet ones must not count twice.
    let wanted = [1e-2, 2.5e-3, 6e-4, 3e-4, 6e-4, 2.5e-3, 1e-2];
    let noise = finished(&format!("noise_per_s = {wanted:?}"), silence.clone());
    for (band, (found, wanted)) in energies(&noise).iter().zip(wanted).enumerate() {
        let ratio = found / (wanted * seconds);
        assert!((ratio - 1.0).abs() < four_sd(band, seconds), "octave {band}: {ratio}");
    }
    assert_eq!(noise, finished(&format!("noise_per_s = {wanted:?}"), silence));
}

#[test]
fn noise_alike_in_all_octaves_is_white_between_them() {
    // Without octave filters: white noise that a unit pulse's filters see as N per second has the variance N / rate, of which
    // the share between the outer centres is there.
    let silence = vec![0.0; 4 * RATE_HZ as usize];
    let noise = finished("noise_per_s = [0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5]", silence);
    let spectrum = |hz: f64| {
        let step = std::f64::consts::TAU * hz / f64::from(RATE_HZ);
        let (mut re, mut im) = (0.0, 0.0);
        for (n, &s) in noise.iter().enumerate() {
            let (sin, cos) = (step * n as f64).sin_cos();
            (re, im) = (re + f64::from(s) * cos, im + f64::from(s) * sin);
        }
        (re * re + im * im) / noise.len() as f64
    };
    let lines = 300;
    let mean = (0..lines).map(|i| spectrum(300.0 + 10.0 * f64::from(i))).sum::<f64>() / f64::from(lines);
    let expected = 0.5 / f64::from(RATE_HZ);
    // Each line is exponentially distributed.
    assert!((mean / expected - 1.0).abs() < 4.0 / f64::from(lines).sqrt(), "{}", mean / expected);
}

#[test]
fn a_coupled_volume_has_its_level_slope_and_gradient() {
    let room = fixture();
    let seconds = 3.0;
    let silence = vec![0.0; (seconds * f64::from(RATE_HZ)) as usize];
    let (level, t) = (2e-3, [1.6, 1.5, 1.4, 1.2, 1.0, 0.9, 0.8]);
    let receivers = room.receivers();
    let [near, far] = [receivers[0].position_m, receivers[1].position_m];
    let text = format!(
        "coupled = {{ energy_per_s = {:?}, decay_time_s = {t:?}, gradient_db_per_m = [1.0, 0.0, 0.0], centre_m = {near:?} }}",
        [level; 7],
    );
    let extended = extended(&text);
    let source = room.sources()[0].position_m;
    let direct_s = |p: [f64; 3]| {
        (0..3).map(|k| (p[k] - source[k]).powi(2)).sum::<f64>().sqrt() / room.air().speed_of_sound_m_s()
    };
    for (receiver, place) in [("microphone", near), ("corner", far)] {
        let response = ImpulseResponse::new(silence.clone(), RATE_HZ).unwrap();
        let tail = extended.finish("talker", receiver, response, 5).unwrap();
        let at = direct_s(place);
        let first = (at * f64::from(RATE_HZ)) as usize;
        assert!(tail.samples()[..first - 1].iter().all(|&s| s == 0.0), "sound before the direct sound");
        let place_gain = 10f64.powf(0.1 * (place[0] - near[0]));
        for from_s in [0.0, 0.2, 0.4] {
            let cut = first + (from_s * f64::from(RATE_HZ)) as usize;
            let mut rest = vec![0.0; cut];
            rest.extend_from_slice(&tail.samples()[cut..]);
            for (band, found) in energies(&rest).iter().enumerate() {
                let k = 6.0 * std::f64::consts::LN_10 / t[band];
                let fill = 1.0 / 0.02;
                let wanted = level
                    * place_gain
                    * ((-k * from_s).exp() / k - (-(k + fill) * from_s).exp() / (k + fill));
                // A decay is as uncertain as noise of twice its time constant.
                let tolerance = four_sd(band, 2.0 / k);
                let ratio = found / wanted;
                assert!(
                    (ratio - 1.0).abs() < tolerance,
                    "{receiver}, octave {band}, from {from_s} s: {ratio}"
                );
            }
        }
    }
}

#[test]
fn gains_are_those_of_the_octaves_of_a_pulse() {
    let wanted = [6.0, 2.0, 0.0, 4.0, -1.0, 2.0, -3.0];
    let found = energies(&finished(&format!("gain_db = {wanted:?}"), pulse(8000, 16_000)));
    for (found, wanted) in found.iter().zip(wanted) {
        assert!((db(*found) - wanted).abs() < 0.05, "{found:.3}: {:.2} dB for {wanted}", db(*found));
    }
    // A cardioid of gain 1 on its axis radiates a third of the power; the model keeps the power.
    let cardioid = "source_pattern = { directed_share = [0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5], axis = { talker = [1, 0, 0], screen = [1, 0, 0] } }";
    for found in energies(&finished(cardioid, pulse(8000, 16_000))) {
        assert!((found / 3.0 - 1.0).abs() < 0.01, "{found}");
    }
    let (_, response) = room_of_fixture();
    let before = energies(response.samples());
    let after = energies(&finished(&format!("gain_db = {wanted:?}"), response.samples().to_vec()));
    for ((before, after), wanted) in before.iter().zip(after).zip(wanted) {
        // The room's own slope within an octave weighs the flanks of the filters otherwise than a pulse does.
        assert!((db(after / before) - wanted).abs() < 1.0, "{} for {wanted}", db(after / before));
    }
}

#[test]
fn the_recorder_delays_stretches_cuts_and_turns() {
    let late = finished("latency_s = 0.002", pulse(1000, 4000));
    assert!((late[1064] - 1.0).abs() < 1e-6 && late.len() == 4064);
    let early = finished("latency_s = -0.002", pulse(1000, 4000));
    assert!((early[936] - 1.0).abs() < 1e-6 && early.len() == 3936);
    let slow = finished("clock_ppm = 1000", pulse(20_000, 30_000));
    assert!((slow[20_020] - 1.0).abs() < 1e-6 && slow.len() == 30_030);
    // A tone between samples keeps its form.
    let tone = |n: usize, shift: f64| (0.3 * (n as f64 - shift)).sin();
    let shifted = finished("latency_s = 0.001015625", (0..4000).map(|n| tone(n, 0.0) as f32).collect());
    for (n, &sample) in shifted.iter().enumerate().take(3900).skip(200) {
        assert!((f64::from(sample) - tone(n, 32.5)).abs() < 1e-4, "sample {n}");
    }
    let noise = "noise_per_s = [0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]\n";
    let cut = finished(&format!("{noise}truncation_s = [0.1, 0.02]"), vec![0.0; 6400]);
    let whole = finished(noise, vec![0.0; 6400]);
    assert!(cut[3200..].iter().all(|&s| s == 0.0) && cut[..2560] == whole[..2560]);
    assert!((cut[2880] - 0.5 * whole[2880]).abs() <= 1e-6 * whole[2880].abs());
    let turned =
        "inverted = \"talker-microphone\"\nresponse_gain = { response = \"talker-microphone\", gain_db = 6 }";
    assert!((finished(turned, pulse(9, 99))[9] + 10f32.powf(0.3)).abs() < 1e-5);
    let other = "inverted = \"talker-corner\"\nresponse_gain = { response = \"talker-corner\", gain_db = 6 }";
    assert_eq!(finished(other, pulse(9, 99)), pulse(9, 99));
}

#[test]
fn the_room_is_as_the_model_says() {
    let text = "relative_humidity_percent = 12\ntemperature_c = 30\n\
        absorption.carpet = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]\nscattering = { carpet = [0.9, 0.9, 0.9, 0.9, 0.9, 0.9, 0.9] }\n\
        position = { id = \"corner\", position_m = [1.0, 4.0, 1.5] }\ndimensions = { scale = [1.1, 1.0, 0.9], shift_m = [0.0, 0.2, 0.0] }";
    let room = fixture();
    let extended = extended(text);
    assert!((extended.scene.volume_m3() / room.scene().volume_m3() - 0.99).abs() < 1e-9);
    let middle = |scene: &sabine_scene::Scene, k: usize| {
        let all: Vec<f64> = scene.vertices().iter().map(|v| v[k]).collect();
        0.5 * (all.iter().copied().fold(f64::MAX, f64::min) + all.iter().copied().fold(f64::MIN, f64::max))
    };
    for (k, shift) in [0.0, 0.2, 0.0].into_iter().enumerate() {
        assert!((middle(&extended.scene, k) - middle(room.scene(), k) - shift).abs() < 1e-9);
    }
    assert_eq!(extended.receivers[1].position_m, [1.0, 4.0, 1.5]);
    assert_eq!(extended.receivers[0], room.receivers()[0]);
    assert_eq!((extended.air.temperature_c(), extended.attenuation.temperature_c()), (30.0, 21.0));
    assert_eq!(extended.attenuation.relative_humidity_percent(), 12.0);
    for (new, old) in extended.scene.materials().iter().zip(room.scene().materials()) {
        if new.name == "carpet" {
            assert_eq!(new.material.absorption().values(), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]);
            assert_eq!(new.material.scattering().values(), [0.9; 7]);
        } else {
            assert_eq!(new, old);
        }
    }
    let materials: Vec<_> = extended.scene.materials().iter().map(|m| m.material.clone()).collect();
    let conditions = extended.conditions(&materials, 0, 0);
    assert!(conditions.source.is_none() && conditions.attenuation == Some(&extended.attenuation));
}

#[test]
fn a_model_is_read_as_it_was_written() {
    let text = "noise_per_s = [1, 2, 3, 4, 5, 6, 7]\nexchanged = [\"talker-corner\", \"talker-microphone\"]\n\
        absorption.carpet = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]\n";
    let (folder, path) = in_file(text);
    let model = ExtendedModel::read(path).unwrap();
    let again = folder.path().join("again.toml");
    model.write(&again).unwrap();
    assert_eq!(ExtendedModel::read(again).unwrap(), model);
    assert!(model.write(folder.path().join("missing/model.toml")).is_err());
}

#[test]
fn what_is_wrong_in_a_file_is_named() {
    for (text, parts) in [
        ("noise_per_s = [1, 2]", &["noise_per_s", "2 values for 7 bands"][..]),
        ("absorption.carpet = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 1.7]", &["absorption.carpet", "1.7"]),
        ("gain_db = [nan, 0, 0, 0, 0, 0, 0]", &["gain_db", "NaN"]),
        ("temperature_c = 300", &["temperature_c", "300"]),
        ("truncation_s = [-1, 0]", &["truncation_s", "-1"]),
        ("dimensions = { scale = [1, 1, 9], shift_m = [0, 0, 0] }", &["dimensions.scale", "9"]),
        ("wishes = 3", &["wishes"]),
        ("clock_ppm = \"fast\"", &["clock_ppm"]),
    ] {
        let (_folder, path) = in_file(text);
        let message = ExtendedModel::read(&path).unwrap_err().to_string();
        assert!(message.contains("extended_model.toml"), "{message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{text}: {message}");
    }
    assert!(matches!(ExtendedModel::read("no/such.toml"), Err(Error::Acoustics(_))));
    for (text, field, name) in [
        ("absorption.velvet = [0, 0, 0, 0, 0, 0, 0]", "absorption", "velvet"),
        ("position = { id = \"nobody\", position_m = [0, 0, 0] }", "position", "nobody"),
        ("inverted = \"corner-talker\"", "inverted", "corner-talker"),
        (
            "source_pattern = { directed_share = [0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5], axis = {} }",
            "source_pattern.axis.talker",
            "talker",
        ),
    ] {
        let (_folder, path) = in_file(text);
        let error = ExtendedModel::read(path).unwrap().room(&fixture()).unwrap_err();
        let message = error.to_string();
        assert!(matches!(error, Error::InModel { .. }), "{message}");
        assert!(message.contains(field) && message.contains(name), "{message}");
    }
    let silence = ImpulseResponse::new(vec![0.0; 100], RATE_HZ).unwrap();
    assert!(extended("").finish("nobody", "corner", silence, 0).unwrap_err().to_string().contains("nobody"));
}

#[test]
fn octaves_above_half_the_sample_rate_are_left_alone() {
    let noise = "noise_per_s = [0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]";
    let response = ImpulseResponse::new(vec![0.0; 8000], 8000).unwrap();
    let samples = extended(noise).finish("talker", "corner", response, 0).unwrap();
    assert!(samples.samples().iter().all(|s| s.is_finite()) && samples.peak() > 0.0);
    assert!(encode_wav(&Signal::from(samples), SampleFormat::Float32).is_ok());
}

#[test]
fn a_gain_over_time_acts_on_the_time_of_the_file() {
    let mut pulses = vec![0.0; 32_000];
    for at in [3200, 9600, 16_000, 28_800] {
        pulses[at] = 1.0;
    }
    let model = "gain_over_time = { time_s = [0.2, 0.4, 0.6], gain_db = [-6, 0, 12] }";
    let found = finished(model, pulses);
    // Before the first instant, halfway, halfway, after the last.
    for (at, gain_db) in [(3200, -6.0), (9600, -3.0), (16_000, 6.0), (28_800, 12.0)] {
        assert!((20.0 * f64::from(found[at]).log10() - gain_db).abs() < 1e-3, "{at}: {}", found[at]);
    }
    for (field, wrong) in [
        ("gain_over_time.gain_db", "time_s = [0.2, 0.4], gain_db = [1]"),
        ("gain_over_time.time_s", "time_s = [0.4, 0.2], gain_db = [1, 2]"),
        ("gain_over_time.gain_db", "time_s = [], gain_db = []"),
    ] {
        let (_folder, path) = in_file(&format!("gain_over_time = {{ {wrong} }}"));
        let error = ExtendedModel::read(path).unwrap_err().to_string();
        assert!(error.contains(field), "{error}");
    }
}

#[test]
fn a_microphone_with_a_pattern_hears_its_direction_and_as_much_of_a_diffuse_field() {
    let text = "receiver_pattern = { directed_share = { microphone = [0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5] }, axis = { microphone = [0, 0, 1] } }";
    let room = extended(text);
    let materials: Vec<_> = room.scene.materials().iter().map(|m| m.material.clone()).collect();
    let conditions = room.conditions(&materials, 0, 0);
    let (pattern, _) = conditions.receiver.unwrap();
    assert!(pattern.bands().is_some() && room.conditions(&materials, 0, 1).receiver.is_none());
    // A cardioid takes a third of what an omnidirectional microphone takes of a diffuse field.
    for found in energies(&finished(text, pulse(8000, 16_000))) {
        assert!((found / 3.0 - 1.0).abs() < 0.01, "{found}");
    }
    let response = ImpulseResponse::new(pulse(9, 99), RATE_HZ).unwrap();
    let other = room.finish("talker", "corner", response, 3).unwrap();
    assert_eq!(other.samples(), pulse(9, 99));
}

#[test]
fn a_channel_has_its_own_octaves() {
    let wanted = [-3.0, -1.0, 0.0, 1.0, 2.0, 1.0, -2.0];
    let text = format!("response_band_gains = {{ response = \"talker-microphone\", gain_db = {wanted:?} }}");
    let found = energies(&finished(&text, pulse(8000, 16_000)));
    for (found, wanted) in found.iter().zip(wanted) {
        assert!((db(*found) - wanted).abs() < 0.05, "{} for {wanted}", db(*found));
    }
    let other = "response_band_gains = { response = \"talker-corner\", gain_db = [9, 9, 9, 9, 9, 9, 9] }";
    assert_eq!(finished(other, pulse(9, 99)), pulse(9, 99));
    let (_folder, path) =
        in_file("response_band_gains = { response = \"nobody\", gain_db = [0, 0, 0, 0, 0, 0, 0] }");
    let error = ExtendedModel::read(path).unwrap().room(&fixture()).unwrap_err().to_string();
    assert!(error.contains("response_band_gains") && error.contains("nobody"), "{error}");
}

const END_WALL: &str =
    "surface = { point_m = [POINT], normal = [NORMAL], offset_m = OFFSET, tilt_deg = [0.0, TILT] }\n";

/// The fixture's wall at its greatest x, displaced.
fn end_wall(offset_m: f64, tilt_deg: f64) -> (String, f64) {
    end_wall_about(0.0, offset_m, tilt_deg)
}

/// The same, said by a point so far from its middle.
fn end_wall_about(aside_m: f64, offset_m: f64, tilt_deg: f64) -> (String, f64) {
    let room = fixture();
    let far = room.scene().vertices().iter().map(|v| v[0]).fold(f64::NEG_INFINITY, f64::max);
    let corners: Vec<&[f64; 3]> =
        room.scene().vertices().iter().filter(|v| (v[0] - far).abs() < 1e-9).collect();
    let middle = |k: usize| corners.iter().map(|c| c[k]).sum::<f64>() / corners.len() as f64;
    let text = END_WALL
        .replace("POINT", &format!("{far}, {}, {}", middle(1) + aside_m, middle(2)))
        .replace("NORMAL", "1.0, 0.0, 0.0")
        .replace("OFFSET", &format!("{offset_m:?}"))
        .replace("TILT", &format!("{tilt_deg:?}"));
    (text, far)
}

fn farthest_x(room: &ExtendedRoom) -> f64 {
    room.scene.vertices().iter().map(|v| v[0]).fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn a_displaced_surface_comes_out_of_its_file_where_it_stands() {
    let (text, far) = end_wall(0.3, 0.0);
    let room = extended(&text);
    assert!((farthest_x(&room) - far - 0.3).abs() < 1e-9);
    // Back to a file and in again.
    let (_folder, path) = in_file(&text);
    let model = ExtendedModel::read(&path).unwrap();
    model.write(&path).unwrap();
    assert_eq!(ExtendedModel::read(&path).unwrap(), model);
    // It leans: the upper edge is farther out, the lower one less.
    let (text, _) = end_wall(0.3, 2.0);
    assert!(farthest_x(&extended(&text)) > far + 0.31);
    // A sheet on the wall stands where the wall stands; one elsewhere stays.
    let x = far - 0.005;
    let sheet = |x: f64| {
        format!(
            "sheet = {{ absorption = 1.0, corners_m = [[{x}, 1.0, 1.0], [{x}, 2.0, 1.0], [{x}, 2.0, 2.0], [{x}, 1.0, 2.0]] }}\n"
        )
    };
    let (text, _) = end_wall(0.3, 0.0);
    let with_sheets = extended(&format!("{text}{}{}", sheet(x), sheet(far - 1.0)));
    let first = with_sheets.scene.vertices().len() - 8;
    assert!((with_sheets.scene.vertices()[first][0] - x - 0.3).abs() < 1e-9);
    assert!((with_sheets.scene.vertices()[first + 4][0] - far + 1.0).abs() < 1e-9);
}

#[test]
fn a_surface_that_cannot_stand_there_is_refused_by_name() {
    let (text, _) = end_wall(0.1, 0.0);
    let error = refused(&text.replace("normal = [1.0, 0.0, 0.0]", "normal = [0.0, 0.6, 0.8]"));
    assert!(matches!(error, Error::Displacement(DisplacementError::NoSurface { .. })), "{error}");
    let (again, _) = end_wall_about(0.1, 0.1, 0.0);
    let error = refused(&format!("{text}{again}"));
    assert!(matches!(error, Error::Displacement(DisplacementError::Twice { .. })), "{error}");
    for (from, to, field) in [
        ("offset_m = 0.1", "offset_m = 3.0", "surface.offset_m"),
        ("normal = [1.0, 0.0, 0.0]", "normal = [2.0, 0.0, 0.0]", "surface.normal"),
        ("tilt_deg = [0.0, 0.0]", "tilt_deg = [0.0, 45.0]", "surface.tilt_deg"),
    ] {
        let error = refused(&text.replace(from, to)).to_string();
        assert!(error.contains(field), "{error}");
    }
}
