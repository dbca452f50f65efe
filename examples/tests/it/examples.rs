//! Each example runs in an empty folder, ends well, prints what its header shows, and gets the physics right.

use crate::index::shown;
use crate::{numbers, row, run};
use sabine::acoustics::Air;
use std::path::Path;

/// The fixture's true room at 1 kHz (`fixtures/truth.json`).
const TRUE_T60_S: f64 = 0.763;

/// Runs an example in a folder and holds what it prints against its header: the lines shown are there, in that order, whatever
/// their numbers.
fn printed_in(name: &str, arguments: &[&str], here: &Path) -> String {
    let (done, printed, errors) = run(name, arguments, here);
    assert!(done, "{name}: {errors}");
    let mut lines = printed.lines().map(shape);
    for line in shown(name) {
        assert!(lines.any(|l| l == shape(&line)), "{name}: nothing like \"{line}\" (any more):\n{printed}");
    }
    printed
}

fn printed(name: &str) -> String {
    let here = tempfile::tempdir().unwrap();
    printed_in(name, &[], here.path())
}

/// A line without its numbers, its spaces and the greys of `log_mel`.
fn shape(line: &str) -> String {
    line.chars().filter(|c| !c.is_ascii_digit() && !c.is_whitespace() && !"+-.:=*#%@".contains(*c)).collect()
}

fn is_file(here: &Path, name: &str) -> bool {
    std::fs::metadata(here.join(name)).is_ok_and(|file| file.len() > 1000)
}

/// The only file or folder that an example leaves is `out`, and no temporary file is in it.
fn leaves_only(here: &Path, folder: &str, names: &[&str]) {
    let list = |path: &Path| -> Vec<String> {
        let mut names: Vec<String> =
            std::fs::read_dir(path).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    assert_eq!(list(here), ["out"]);
    assert_eq!(list(&here.join("out").join(folder)), names);
    assert!(names.iter().all(|name| is_file(&here.join("out").join(folder), name)));
}

#[test]
fn measure_response_reads_the_t60_of_the_true_room_and_gives_a_reason_above_half_the_sample_rate() {
    let printed = printed("measure_response");
    let [t30, t30_error, t60, t60_error, ..] = row(&printed, "1000")[..] else { panic!("{printed}") };
    for (value, error) in [(t30, t30_error), (t60, t60_error)] {
        assert!(error > 0.0 && (value - TRUE_T60_S).abs() < 3.0 * error + 0.02, "{printed}");
    }
    assert!(printed.contains("no T60 at 8000 Hz: "), "{printed}");
    let here = tempfile::tempdir().unwrap();
    let (done, _, errors) = run("measure_response", &["no_such.wav"], here.path());
    assert!(!done && errors.contains("no_such.wav"), "{errors}");
}

#[test]
fn design_eq_has_the_gains_that_it_was_asked_for() {
    let here = tempfile::tempdir().unwrap();
    let printed = printed_in("design_eq", &[], here.path());
    for octave in ["62.5", "125", "250", "500", "1000", "2000", "4000"] {
        let [wanted_db, measured_db] = row(&printed, octave)[..] else { panic!("{printed}") };
        assert!((wanted_db - measured_db).abs() <= 0.1, "{octave} Hz: {printed}");
    }
    leaves_only(here.path(), "design_eq", &["equalised.wav"]);
}

#[test]
fn log_mel_hears_all_frames_and_the_stream_equals_the_file() {
    let printed = printed("log_mel");
    assert!(printed.contains("the same numbers: true"), "{printed}");
    let recording = crate::folder().join("../fixtures/speech/recording.wav");
    let info = sabine::acoustics::probe_audio(recording).unwrap();
    let samples = info.frames as f64 / f64::from(info.sample_rate_hz) * 16_000.0;
    // Frames of 256 samples, 128 apart; the last sample depends on the rounding of the length.
    let frames = (samples - 256.0) / 128.0 + 1.0;
    let line = printed.lines().find(|line| line.contains(" frames of ")).unwrap();
    let [found, bands, hop_ms] = numbers(line)[..] else { panic!("{line}") };
    assert!((found - frames).abs() <= 1.0 && bands == 32.0 && hop_ms == 8.0, "{line}: {frames}");
}

#[test]
fn estimate_speech_hears_the_room_and_is_less_sure_after_one_second() {
    let printed = printed("estimate_speech");
    let (all, second) = printed.split_once("the first second").unwrap();
    let [t60, error, ..] = row(all, "1000")[..] else { panic!("{printed}") };
    assert!((t60 - TRUE_T60_S).abs() < 3.0 * error && (t60 / TRUE_T60_S - 1.0).abs() < 0.15, "{printed}");
    let errors = |part: &str| -> f64 {
        ["125", "250", "500", "1000", "2000", "4000", "8000"].iter().map(|hz| row(part, hz)[1]).sum()
    };
    assert!(errors(second) > errors(all), "{printed}");
    assert!(second.contains("note: the recording lasts 1.0 s"), "{printed}");
}

#[test]
fn mix_recording_sets_the_noise_where_it_is_asked_to_be() {
    for (arguments, snr_db) in [(&[][..], 20.0), (&["-5"][..], -5.0)] {
        let here = tempfile::tempdir().unwrap();
        let printed = printed_in("mix_recording", arguments, here.path());
        assert_eq!(row(&printed, "speech")[0], snr_db, "{printed}");
        leaves_only(here.path(), "mix_recording", &["mixed.wav"]);
    }
}

#[test]
fn box_room_meets_eyring_where_its_walls_scatter_and_outlives_him_where_they_do_not() {
    let printed = printed("box_room");
    let (mirrors, diffusers) = printed.split_once("scattering 0.9").unwrap();
    for octave in ["500", "1000", "2000"] {
        let [_, eyring_s, t30_s, error_s] = row(mirrors, octave)[..] else { panic!("{printed}") };
        assert!(t30_s - 5.0 * error_s > 1.2 * eyring_s, "{octave} Hz: {printed}");
        let [sabine_s, eyring_s, t30_s, _] = row(diffusers, octave)[..] else { panic!("{printed}") };
        // A field that scatters everywhere is still not even: floor and ceiling face each other.
        assert!(eyring_s < sabine_s && (t30_s / eyring_s - 1.0).abs() < 0.15, "{octave} Hz: {printed}");
    }
}

#[test]
fn trace_room_puts_the_direct_sound_where_and_when_geometry_has_it() {
    let here = tempfile::tempdir().unwrap();
    let printed = printed_in("trace_room", &[], here.path());
    // Of `fixtures/room/room.toml`: talker, microphone, 21 degrees.
    let away_m = [1.6 - 6.2, 1.5 - 2.6, 1.5 - 1.3_f64];
    let distance_m = away_m.iter().map(|c| c * c).sum::<f64>().sqrt();
    let speed_m_s = 343.2 * ((273.15 + 21.0) / 293.15_f64).sqrt();
    let [delay_ms, degrees, ..] = row(&printed, "direct sound after")[..] else { panic!("{printed}") };
    assert!((delay_ms - 1e3 * distance_m / speed_m_s).abs() < 0.03, "{printed}");
    assert!((degrees - away_m[1].atan2(away_m[0]).to_degrees()).abs() < 3.0, "{printed}");
    leaves_only(here.path(), "trace_room", &["ambisonics.wav", "impulse_response.wav"]);
    let info = sabine::acoustics::probe_audio(here.path().join("out/trace_room/ambisonics.wav")).unwrap();
    assert_eq!(info.channels, 4);
}

#[test]
fn other_air_changes_what_it_should_and_nothing_else() {
    let printed = printed("other_air");
    let names = ["as stated", "air of 15 % humidity", "curtain drawn back", "talker looks away"];
    let [stated, dry, bare, away] = names.map(|name| row(&printed, name));
    let share = |other: &[f64], column: usize| other[column] / stated[column] - 1.0;
    // T30 at 1 kHz, its error, T30 at 8 kHz, its error, DRR, its error.
    // What drier air takes adds to the slope: decibels per metre times the speed of sound.
    let [air, drier] = [45.0, 15.0].map(|percent| Air::new(21.0, percent, 101.325).unwrap());
    for (column, hz) in [(0, 1000.0), (2, 8000.0)] {
        let more_db_per_m = drier.attenuation_db_per_m(hz) - air.attenuation_db_per_m(hz);
        let expected_s = 60.0 / (60.0 / stated[column] + more_db_per_m * air.speed_of_sound_m_s());
        assert!((dry[column] / expected_s - 1.0).abs() < 0.03, "{hz} Hz: {expected_s} s: {printed}");
        assert!(share(&dry, column) < -0.01, "{hz} Hz: {printed}");
    }
    assert!(share(&bare, 0) > 0.1 && share(&bare, 2) > 0.02, "{printed}");
    // (0.7 - 0.3)2 of the direct energy, 0.52 of the reverberant energy: -7.96 dB and -2.84 dB.
    assert!((away[4] - stated[4] - (-7.96 + 2.84)).abs() < 1.5, "{printed}");
    assert!(share(&away, 0).abs() < 0.05, "{printed}");
}

#[test]
fn fit_materials_reaches_the_reverberation_times() {
    let printed = printed("fit_materials");
    for octave in ["125", "250", "500", "1000", "2000", "4000", "8000"] {
        let [wanted_s, before_s, after_s] = row(&printed, octave)[..] else { panic!("{printed}") };
        // Printed to 10 ms.
        assert!((after_s - wanted_s).abs() <= 0.005 * wanted_s + 0.005, "{octave} Hz: {printed}");
        assert!((before_s - wanted_s).abs() > 0.01, "{octave} Hz: there is nothing to fit: {printed}");
    }
    assert!(printed.contains("not determined: "), "{printed}");
}

#[test]
fn fit_responses_predicts_the_place_held_out() {
    let printed = printed("fit_responses");
    for octave in ["500", "1000", "2000"] {
        let line = printed.lines().find(|line| line.trim_start().starts_with(octave)).unwrap();
        let found: Vec<f64> = numbers(line);
        let [_, measured_s, table_s, table_db, fitted_s, fitted_db] = found[..] else { panic!("{line}") };
        assert!((fitted_s - measured_s).abs() < (table_s - measured_s).abs(), "{printed}");
        assert!((fitted_s / measured_s - 1.0).abs() < 0.06 && fitted_db < table_db, "{printed}");
    }
    assert!(printed.contains("not determined: "), "{printed}");
}

#[test]
fn replace_material_deadens_the_room_and_clears_the_voice() {
    let here = tempfile::tempdir().unwrap();
    let printed = printed_in("replace_material", &[], here.path());
    let (t60, c50) = printed.split_once("C50 before").unwrap();
    for (part, begins, sign, rounding) in
        [(t60, "T60", -1.0, 0.0021), (&format!("C50 before{c50}")[..], "C50", 1.0, 0.0021)]
    {
        let unit = if begins == "T60" { "(s)" } else { "(dB)" };
        let [before, after] = ["before", "after"].map(|side| row(part, &format!("{begins} {side} {unit}")));
        let difference = row(part, &format!("difference {unit}"));
        for octave in [0, 2, 4] {
            let change = difference[octave];
            assert!((after[octave] - before[octave] - change).abs() < rounding, "{printed}");
            // 95 %.
            assert!(sign * change > 2.0 * difference[octave + 1], "{printed}");
        }
    }
    leaves_only(here.path(), "replace_material", &["after.wav", "before.wav"]);
}

#[test]
fn low_frequencies_has_its_peaks_at_the_standing_waves_of_the_box() {
    let here = tempfile::tempdir().unwrap();
    let printed = printed_in("low_frequencies", &[], here.path());
    let peaks: Vec<Vec<f64>> = printed.lines().filter(|line| line.contains(" dB   [")).map(numbers).collect();
    assert!(peaks.len() >= 4, "{printed}");
    for peak in &peaks {
        let (found_hz, theory_hz) = (peak[0], peak[5]);
        assert!((found_hz / theory_hz - 1.0).abs() < 0.01, "{printed}");
    }
    // Half a wave along 5 m: c / 2L.
    assert!((peaks[0][0] / (343.2 / 10.0) - 1.0).abs() < 0.01, "{printed}");
    leaves_only(here.path(), "low_frequencies", &["impulse_response.wav"]);
}

#[test]
fn live_convolution_is_the_same_as_one_long_convolution_before_and_after_the_change() {
    let here = tempfile::tempdir().unwrap();
    let printed = printed_in("live_convolution", &[], here.path());
    for room in ["first room", "second room"] {
        assert!(row(&printed, room)[0] < -100.0, "{printed}");
    }
    let [asked_s, alone_s] = row(&printed, "asked for another room at")[..] else { panic!("{printed}") };
    // 32 blocks of 256 samples until the new tail is computed, 8 to fade, at 22.05 kHz.
    assert!(asked_s < alone_s && alone_s - asked_s <= 0.47, "{printed}");
    leaves_only(here.path(), "live_convolution", &["heard.wav"]);
}

#[test]
fn match_room_reaches_what_was_heard() {
    let here = tempfile::tempdir().unwrap();
    let printed = printed_in("match_room", &[], here.path());
    for octave in ["125", "250", "500", "1000", "2000", "4000", "8000"] {
        let [heard_s, reached_s] = row(&printed, octave)[..] else { panic!("{printed}") };
        // One just-noticeable difference, and two numbers printed to 10 ms.
        assert!((reached_s - heard_s).abs() < 0.05 * heard_s + 0.01, "{octave} Hz: {printed}");
    }
    let names = [
        "eq_filter.wav",
        "impulse_response.wav",
        "match.json",
        "matched.wav",
        "materials.toml",
        "report.html",
    ];
    leaves_only(here.path(), "match_room", &names);
}

#[test]
fn diagnose_room_names_the_latency_and_the_extended_model_has_it() {
    let printed = printed("diagnose_room");
    assert!(printed.starts_with("explained\ntime_zero ("), "{printed}");
    let line = printed.lines().nth(2).unwrap();
    let found = numbers(line);
    let [latency_ms, _, low_ms, high_ms] = found[..] else { panic!("{line}") };
    assert!((latency_ms - 5.0).abs() < 0.2 && low_ms < 5.0 && 5.0 < high_ms, "{printed}");
    let [measured, stated, extended] =
        ["measured", "model", "extended model"].map(|what| row(&printed, what)[0]);
    assert!((measured - extended).abs() < 0.3 && (measured - stated - 5.0).abs() < 0.3, "{printed}");
}

#[test]
fn own_tracer_gives_the_fit_the_absorption_of_eyrings_formula() {
    let printed = printed("own_tracer");
    for octave in ["500", "1000"] {
        let [wanted_s, _, eyring_s] = row(&printed, octave)[..] else { panic!("{printed}") };
        assert!((eyring_s / wanted_s - 1.0).abs() < 0.02, "{printed}");
    }
    let source = std::fs::read_to_string(crate::folder().join("own_tracer.rs")).unwrap();
    let page = std::fs::read_to_string(crate::folder().join("../docs/how-to/own-tracer.md")).unwrap();
    let [start, end] = ["/// Sound that", "fn main()"].map(|at| source.find(at).unwrap());
    assert!(page.contains(source[start..end].trim_end()), "the page shows another tracer than the example");
}

#[test]
fn training_set_deals_out_its_clips_and_learns() {
    let here = tempfile::tempdir().unwrap();
    let printed = printed_in("training_set", &[], here.path());
    for (partition, clips) in [("train", 64.0), ("validation", 24.0), ("test", 24.0)] {
        let found = row(&printed, partition);
        // Four clips share a room.
        assert_eq!((found[0], found[3]), (clips, clips / 4.0), "{printed}");
    }
    let [first, second] = ["epoch 1: loss", "epoch 2: loss"].map(|epoch| row(&printed, epoch)[1]);
    assert!(second < first, "the validation error grows: {printed}");
    assert_eq!(std::fs::read_dir(here.path()).unwrap().count(), 0, "something is left behind");
}
