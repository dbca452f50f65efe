//! Tables of measurements: what is read, and what is said of bad ones.

use sabine_acoustics::{SampleFormat, write_wav};
use sabine_scene::{Error, ImportOptions, Levels, Measurements, TimeZero};
use std::path::Path;
use tempfile::TempDir;

const GOOD: &str = "\
file,source,source_x_m,source_y_m,source_z_m,receiver,receiver_x_m,receiver_y_m,receiver_z_m,temperature_c,session
ir/a.wav,stage,1,2,1.5,seat 1,4.25,3,1.2,21.5,morning
ir/b.wav,stage,1,2,1.5,\"seat 2, left\",5,3,1.2,22,
ir/c.txt,wing,1.5,4,1.5,seat 1,4.25,3,1.2,22,
";

fn decay(shift: usize) -> Vec<f32> {
    (0..4000)
        .map(|i: usize| match i.checked_sub(100 + shift) {
            None => 0.0,
            Some(since) => (-(since as f32) * 2e-3).exp() * (since as f32 * 1.7).cos(),
        })
        .collect()
}

/// A table and the sounds that it names; the last is a text in a locale with decimal commas.
fn folder(table: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    let ir = folder.path().join("ir");
    std::fs::create_dir(&ir).unwrap();
    for (name, shift) in [("a.wav", 0), ("b.wav", 7)] {
        write_wav(ir.join(name), &decay(shift), 8000, SampleFormat::Float32).unwrap();
    }
    let samples: String = decay(20).iter().map(|x| format!("{x:e}\r\n").replace('.', ",")).collect();
    let head = "* Impulse Response data saved by REW V5.31\r\n* IR is not normalised\r\n4000 // Response length\r\n1,25E-4 // Sample interval (seconds)\r\n-0,0025 // Start time (seconds)\r\n* Data start\r\n";
    std::fs::write(ir.join("c.txt"), format!("{head}{samples}")).unwrap();
    std::fs::write(folder.path().join("positions.csv"), table).unwrap();
    folder
}

fn read(folder: &Path) -> Result<Measurements, Error> {
    Measurements::read_table(folder.join("positions.csv"), &ImportOptions::default())
}

#[test]
fn a_table_and_its_sounds_are_read_exactly() {
    let comma = GOOD
        .replace("seat 2, left", "seat 2; left")
        .replace(',', ";")
        .replace('.', ",")
        .replace(",wav", ".wav")
        .replace(",txt", ".txt");
    let tabs =
        GOOD.replace("\"seat 2, left\"", "seat 2, left").replace(',', "\t").replace("2\t left", "2, left");
    let windows = format!("\u{feff}{}", GOOD.replace('\n', "\r\n"));
    for (name, table) in [("commas", GOOD), ("semicolons", &comma), ("tabs", &tabs), ("windows", &windows)] {
        let folder = folder(table);
        let set = read(folder.path()).unwrap_or_else(|error| panic!("{name}: {error}\n{table}"));
        assert_eq!(
            set.responses.iter().map(|r| r.source.as_str()).collect::<Vec<_>>(),
            ["stage", "stage", "wing"],
            "{name}"
        );
        for (response, shift) in set.responses.iter().zip([0, 7, 20]) {
            assert!(response.samples.samples() == decay(shift), "{name}, {shift}");
        }
        assert_eq!(set.receivers[0].position_m, [4.25, 3.0, 1.2]);
        assert!(set.receivers[1].id.ends_with("left") && set.receivers.len() == 2, "{name}");
        assert_eq!(set.responses[0].air.unwrap().temperature_c(), 21.5);
        assert_eq!(set.responses[0].session.as_deref(), Some("morning"));
        assert_eq!(set.responses[2].session, None);
        assert_eq!((set.measurement.time_zero, set.measurement.levels), (TimeZero::Common, Levels::Common));
        assert!(set.notes.iter().any(|note| note.contains("--time-zero")));
    }
}

#[test]
fn texts_start_at_the_emission_if_asked() {
    let folder = folder(GOOD);
    let options = ImportOptions { time_zero: Some(TimeZero::Emission), ..Default::default() };
    let set = Measurements::read_table(folder.path().join("positions.csv"), &options).unwrap();
    // 2.5 ms at 8 kHz.
    assert!(set.responses[2].samples.samples() == &decay(20)[20..]);
    assert!(set.responses[0].samples.samples() == decay(0));
}

#[test]
fn each_fault_names_its_line_and_column() {
    for (from, to, words) in [
        ("4.25,3,1.2,21.5", ",3,1.2,21.5", "line 2, receiver_x_m: is missing"),
        ("ir/b.wav", "", "line 3, file: is missing"),
        ("4.25,3,1.2,21.5", "\"4,25\",3,1.2,21.5", "line 2, receiver_x_m: cannot read `4,25` as a number"),
        ("4.25,3,1.2,21.5", "NaN,3,1.2,21.5", "line 2, receiver_x_m: cannot read `NaN`"),
        ("4.25,3,1.2,21.5", "4e9,3,1.2,21.5", "line 2, receiver_x_m: position (m)"),
        (",21.5,morning", ",-300,morning", "line 2, temperature_c"),
        (",22,\nir/c", ",22\nir/c", "line 3: has the shape 10 cells, where 11 cells"),
        ("ir/b.wav", "ir/a.wav", "line 3, file: `ir/a.wav` is there twice"),
        (
            "wing,1.5,4",
            "stage,1.5,4",
            "line 4, source: `stage` is at [1.5, 4.0, 1.5] m here and at [1.0, 2.0, 1.5] m before",
        ),
        ("\"seat 2, left\",5", "seat 3,4.25", "line 3, receiver: `seat 3` is where `seat 1` is"),
        ("\"seat 2, left\",5", "seat 3,4.2505", "within 1 mm"),
        ("ir/b.wav", "../../b.wav", "line 3, file: "),
        ("ir/b.wav", "/etc/passwd", "lies outside the folder"),
        ("ir/b.wav", "ir/none.wav", "line 3, file: "),
        (",session", ",colour", "line 1: is `colour`; file, source_x_m"),
        ("receiver_z_m,", "receiver,", "line 1: `receiver` is there twice"),
        ("temperature_c,session", "recorded_at,receiver_x_m", "line 1: `receiver_x_m` is there twice"),
    ] {
        assert!(GOOD.contains(from), "{from}");
        let folder = folder(&GOOD.replacen(from, to, 1));
        let error = read(folder.path()).unwrap_err().to_string();
        assert!(error.contains("positions.csv") && error.contains(words), "{to}: {error}");
        // The same line where lines end as they do under Windows.
        std::fs::write(folder.path().join("positions.csv"), GOOD.replacen(from, to, 1).replace('\n', "\r\n"))
            .unwrap();
        let error = read(folder.path()).unwrap_err().to_string();
        assert!(error.contains(words), "{to}: {error}");
    }
    for (table, words) in [
        ("", "line 1"),
        (GOOD.lines().next().unwrap(), "line 2: is missing"),
        ("file,source\n", "source_x_m"),
    ] {
        let folder = folder(table);
        let error = read(folder.path()).unwrap_err().to_string();
        assert!(error.contains(words), "{table}: {error}");
    }
    let folder = folder(GOOD);
    std::fs::write(folder.path().join("ir/c.txt"), "1.0\n").unwrap();
    let error = read(folder.path()).unwrap_err().to_string();
    assert!(
        error.contains("line 4, file: ") && error.contains("c.txt: Sample interval (seconds): is missing"),
        "{error}"
    );
}
