//! Room responses from and to SOFA files. The golden files come from Python's `sofar` and `h5py` (`tests/sofa/make.py`); bad
//! ones are made by the writer of `hdf5-pure`, which is not the one under test, or by damaging good ones.

use crate::process;
use hdf5_pure::{AttrValue, FileBuilder};
use sabine_acoustics::Air;
use sabine_scene::{
    Error, ImportOptions, Levels, Measurements, NewResponse, Receiver, RoomModel, SofaConvention, Source,
    TimeZero,
};
use std::path::{Path, PathBuf};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/sofa");
const CREATED: &str = "2026-11-24 12:00:00";

fn golden(name: &str) -> PathBuf {
    Path::new(FOLDER).join(name)
}

fn read(path: impl AsRef<Path>) -> Result<Measurements, Error> {
    Measurements::read_sofa(path, &ImportOptions::default())
}

/// As `response` of `make.py`.
fn response(m: usize, r: usize, e: usize, length: usize, onset: usize) -> Vec<f32> {
    let value = |n: usize| match n.checked_sub(onset) {
        None => 0.0,
        Some(0) => 1.0,
        Some(since) => {
            (((7 * n + 3 * m + 5 * r + 11 * e) % 17) as f64 - 8.0) / 16.0 * 0.5f64.powi((since / 50) as i32)
        }
    };
    (0..length).map(|n| value(n) as f32).collect()
}

fn near(found: [f64; 3], expected: [f64; 3]) {
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {expected:?}");
}

#[test]
fn pairs_that_sofar_wrote_are_read_exactly() {
    for name in ["pairs.sofa", "pairs_plain.sofa", "pairs_old.sofa"] {
        let set = read(golden(name)).unwrap();
        assert_eq!(set.responses.len(), 4, "{name}");
        for (m, found) in set.responses.iter().enumerate() {
            // The second has a delay of three samples.
            let mut expected = vec![0.0; if m == 1 { 3 } else { 0 }];
            expected.extend(response(m, 0, 0, 600, 40 + 10 * m));
            assert!(found.samples.samples() == expected, "{name}, response {m}");
            assert_eq!(found.samples.sample_rate_hz(), 8000);
        }
        let pairs: Vec<_> = set.responses.iter().map(|r| (r.source.as_str(), r.receiver.as_str())).collect();
        assert_eq!(pairs, [("s1", "r1"), ("s1", "r2"), ("s2", "r1"), ("s2", "r3")]);
        near(set.sources[0].position_m, [1.0, 2.0, 1.5]);
        near(set.sources[1].position_m, [4.25, 1.0, 1.5]);
        assert_eq!(set.sources[1].axis, Some([-1.0, 0.0, 0.0]));
        // Half a metre to the left of the view, which was turned for the last.
        near(set.receivers[0].position_m, [3.0, 3.5, 1.25]);
        near(set.receivers[1].position_m, [2.0, 4.0, 1.25]);
        near(set.receivers[2].position_m, [2.5, 3.0, 1.25]);
        near(set.receivers[2].axis.unwrap(), [0.0, 1.0, 0.0]);
        assert_eq!(set.air.unwrap().temperature_c(), 21.0);
        assert_eq!(set.responses[0].air, None);
        assert_eq!(set.responses[2].air.unwrap().temperature_c(), 22.0);
        assert_eq!(set.shoebox_m, Some([[0.0; 3], [6.0, 5.0, 3.0]]));
        assert_eq!((set.measurement.time_zero, set.measurement.levels), (TimeZero::Common, Levels::Common));
        assert!(set.notes.iter().any(|note| note.contains("--time-zero")), "{:?}", set.notes);
    }
}

#[test]
fn a_grid_that_sofar_wrote_is_read_exactly() {
    let options = ImportOptions {
        time_zero: Some(TimeZero::Emission),
        levels: Some(Levels::Absolute),
        ..Default::default()
    };
    let set = Measurements::read_sofa(golden("grid.sofa"), &options).unwrap();
    assert_eq!((set.sources.len(), set.receivers.len(), set.responses.len()), (3, 2, 6));
    for (index, found) in set.responses.iter().enumerate() {
        let (r, e) = (index / 3, index % 3);
        assert!(found.samples.samples() == response(0, r, e, 400, 30), "{r} {e}");
        assert_eq!(
            (found.source.as_str(), found.receiver.as_str()),
            (&*format!("s{}", e + 1), &*format!("r{}", r + 1))
        );
    }
    near(set.receivers[1].position_m, [3.0, 2.0, 1.5]);
    near(set.sources[2].position_m, [4.0, 3.0, 1.0]);
    assert!(set.sources.iter().all(|s| s.axis.is_none()), "the view is that of the template");
    assert_eq!(set.measurement.time_zero, TimeZero::Emission);
    assert!(set.notes.is_empty() && set.air.is_none(), "{:?}: a temperature of 0 K is none", set.notes);
}

/// Two sources and two receivers with names and axes, all pairs.
fn set() -> Measurements {
    let axis = |x: f64, y: f64| Some([x, y, 0.0]);
    let sources = vec![
        Source { id: "stage, left".into(), position_m: [1.1, 2.2, 1.3], axis: axis(0.6, 0.8) },
        Source { id: "stage, right".into(), position_m: [0.1 + 0.2, 1.0 / 3.0, 1.7], axis: axis(0.0, -1.0) },
    ];
    let receivers = vec![
        Receiver { id: "Sitz 1".into(), position_m: [4.4, 3.3, 1.2], axis: None },
        Receiver { id: "größe".into(), position_m: [5.5, 2.5, 1.25], axis: None },
    ];
    let mut responses = Vec::new();
    for (k, source) in sources.iter().enumerate() {
        for (i, receiver) in receivers.iter().enumerate() {
            let samples: Vec<f32> = response(k, i, 0, 500, 60).iter().map(|x| x / 3.0).collect();
            responses.push(NewResponse {
                source: source.id.clone(),
                receiver: receiver.id.clone(),
                name: format!("s{k}_r{i}"),
                air: (k == 1).then(|| Air::new(23.25, 50.0, 101.325).unwrap()),
                session: None,
                recorded_at: None,
                samples: sabine_acoustics::ImpulseResponse::new(samples, 48_000).unwrap(),
            });
        }
    }
    Measurements {
        sources,
        receivers,
        air: Some(Air::new(21.5, 50.0, 101.325).unwrap()),
        measurement: sabine_scene::Measurement { time_zero: TimeZero::Emission, levels: Levels::PerResponse },
        shoebox_m: None,
        responses,
        notes: Vec::new(),
    }
}

#[test]
fn what_is_written_is_read_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.sofa");
    let set = set();
    for convention in [SofaConvention::Pairs, SofaConvention::Grid] {
        set.write_sofa(&path, convention, CREATED).unwrap();
        let found = read(&path).unwrap();
        assert!(found.notes.is_empty(), "{:?}", found.notes);
        assert_eq!(found.measurement, set.measurement);
        assert_eq!(found.air, set.air);
        for (found, expected) in found.sources.iter().zip(&set.sources) {
            assert_eq!((&found.id, found.position_m), (&expected.id, expected.position_m));
            near(found.axis.unwrap(), expected.axis.unwrap());
        }
        assert_eq!(found.receivers, set.receivers);
        for expected in &set.responses {
            let pair = |r: &&NewResponse| r.source == expected.source && r.receiver == expected.receiver;
            let found = found.responses.iter().find(pair).unwrap();
            assert!(found.samples == expected.samples, "{convention:?}: samples are the same to the bit");
            if convention == SofaConvention::Pairs {
                assert_eq!(found.air, expected.air);
            }
        }
        let before = std::fs::read(&path).unwrap();
        set.write_sofa(&path, convention, CREATED).unwrap();
        assert!(std::fs::read(&path).unwrap() == before, "the same content gives the same bytes");
    }
}

#[test]
fn a_room_goes_to_sofa_and_back() {
    let folder = tempfile::tempdir().unwrap();
    let model = RoomModel::of_box([[0.0; 3], [6.0, 5.0, 3.0]], None).unwrap();
    let import = |file: &Path, name: &str| {
        let new = read(file).unwrap().into_room(model.clone(), Some(0.02));
        new.write(folder.path().join(name)).unwrap()
    };
    let first = import(&golden("pairs.sofa"), "first");
    assert_eq!(first.position_sd().all_m, Some(0.02));
    let file = folder.path().join("again.sofa");
    let mut set = Measurements::of_room(&first).unwrap();
    // One is three samples longer for its delay.
    let error = set.write_sofa(&file, SofaConvention::Pairs, CREATED).unwrap_err().to_string();
    assert!(
        error.contains("again.sofa: Data.IR") && error.contains("600") && error.contains("603"),
        "{error}"
    );
    assert!(!file.exists());
    set.responses.remove(1);
    set.write_sofa(&file, SofaConvention::Pairs, CREATED).unwrap();
    let second = import(&file, "second");
    for (before, after) in [0, 2, 3].into_iter().zip(0..) {
        assert!(
            first.load_response(before).unwrap() == second.load_response(after).unwrap(),
            "response {before}"
        );
    }
    assert_eq!(second.responses()[1].air, first.responses()[2].air);
}

#[test]
fn grids_with_holes_and_mixed_rates_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.sofa");
    let refused = |change: &dyn Fn(&mut Measurements), words: &str| {
        let mut set = set();
        change(&mut set);
        let error = set.write_sofa(&path, SofaConvention::Grid, CREATED).unwrap_err().to_string();
        assert!(error.contains("room.sofa: Data.IR") && error.contains(words), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    };
    refused(&|set| drop(set.responses.remove(2)), "no response from `stage, right` to `Sitz 1`");
    refused(&|set| set.responses.push(set.responses[0].clone()), "is there twice");
    refused(&|set| set.responses.clear(), "list of responses is empty");
    let other = sabine_acoustics::ImpulseResponse::new(vec![1.0; 500], 44_100).unwrap();
    refused(&|set| set.responses[1].samples = other.clone(), "44100");
}

/// What a file of one pair holds: text attributes, and arrays with their units.
struct Draft {
    texts: Vec<(&'static str, &'static str)>,
    arrays: Vec<(&'static str, Vec<f64>, Vec<u64>, &'static str)>,
}

impl Draft {
    fn good() -> Self {
        let ir: Vec<f64> = response(0, 0, 0, 400, 30).into_iter().map(f64::from).collect();
        Self {
            texts: vec![
                ("Conventions", "SOFA"),
                ("SOFAConventions", "SingleRoomSRIR"),
                ("SOFAConventionsVersion", "1.0"),
                ("DataType", "FIR"),
            ],
            arrays: vec![
                ("Data.IR", ir, vec![1, 1, 400], ""),
                ("Data.SamplingRate", vec![8000.0], vec![1], "hertz"),
                ("Data.Delay", vec![0.0], vec![1, 1], ""),
                ("ListenerPosition", vec![1.0, 2.0, 1.5], vec![1, 3], "metre"),
                ("SourcePosition", vec![4.0, 2.0, 1.5], vec![1, 3], "metre"),
                ("ListenerView", vec![0.0, 1.0, 0.0], vec![1, 3], "metre"),
                ("ListenerUp", vec![0.0, 0.0, 1.0], vec![1, 3], ""),
            ],
        }
    }

    fn array(&mut self, name: &str) -> &mut (&'static str, Vec<f64>, Vec<u64>, &'static str) {
        self.arrays.iter_mut().find(|array| array.0 == name).unwrap()
    }

    fn write(&self, path: &Path) {
        let mut file = FileBuilder::new();
        for (name, text) in &self.texts {
            file.set_attr(name, AttrValue::AsciiString((*text).into()));
        }
        for (name, values, shape, unit) in &self.arrays {
            let array = file.create_dataset(name);
            array.with_f64_data(values).with_shape(shape);
            if !unit.is_empty() {
                array.set_attr("Units", AttrValue::AsciiString((*unit).into()));
            }
        }
        file.write(path).unwrap();
    }
}

#[test]
fn each_fault_names_its_variable() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.sofa");
    Draft::good().write(&path);
    read(&path).unwrap();
    let refused = |change: &dyn Fn(&mut Draft), field: &str, words: &str| {
        let mut draft = Draft::good();
        change(&mut draft);
        draft.write(&path);
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains(&format!("bad.sofa: {field}")) && error.contains(words), "{field}: {error}");
    };
    refused(&|d| d.texts.retain(|t| t.0 != "Conventions"), "Conventions", "is missing");
    refused(&|d| d.texts[1].1 = "GeneralFIR", "SOFAConventions", "`GeneralFIR 1.0` where SingleRoomSRIR");
    refused(&|d| d.texts[2].1 = "2.0", "SOFAConventions", "SingleRoomSRIR 2.0");
    refused(&|d| d.texts[3].1 = "TF", "DataType", "is `TF`; FIR can be read");
    for name in ["Data.IR", "Data.SamplingRate", "ListenerPosition", "SourcePosition"] {
        refused(&|d| d.arrays.retain(|a| a.0 != name), name, "is missing");
    }
    refused(&|d| d.array("Data.IR").2 = vec![1, 400], "Data.IR", "[1, 400], where [M, R, N]");
    refused(&|d| d.array("Data.IR").1[7] = f64::NAN, "Data.IR", "7 is not finite");
    refused(&|d| d.array("Data.IR").1[7] = 1e300, "Data.IR[measurement 0", "not finite");
    refused(&|d| d.array("Data.IR").1.fill(0.0), "Data.IR[measurement 0", "silent");
    refused(&|d| d.array("Data.SamplingRate").1[0] = 44_100.5, "Data.SamplingRate", "whole number");
    refused(&|d| d.array("Data.SamplingRate").1[0] = -1.0, "Data.SamplingRate", "from 1 kHz to 768 kHz");
    refused(&|d| d.array("Data.SamplingRate").3 = "rpm", "Data.SamplingRate:Units", "is `rpm`; hertz");
    refused(&|d| d.array("Data.Delay").1[0] = 0.5, "Data.Delay", "whole number of samples");
    refused(&|d| d.array("Data.Delay").1[0] = -4.0, "Data.Delay", "whole number of samples");
    refused(&|d| d.array("Data.Delay").1[0] = 1e12, "Data.Delay", "at most 60 s");
    refused(&|d| d.array("ListenerPosition").3 = "feet", "ListenerPosition:Units", "is `feet`");
    refused(&|d| d.array("ListenerPosition").1[1] = f64::INFINITY, "ListenerPosition", "1 is not finite");
    refused(&|d| d.array("ListenerPosition").1[1] = 1e7, "ListenerPosition", "within 100 km");
    let wrong = |d: &mut Draft| {
        (d.array("SourcePosition").1, d.array("SourcePosition").2) = (vec![0.0; 6], vec![2, 3])
    };
    refused(&wrong, "SourcePosition", "[2, 3], where [1, 3] or [1, 3]");
    refused(&|d| d.array("ListenerView").1 = vec![0.0; 3], "ListenerView[0]", "length of the direction");
    refused(&|d| d.array("ListenerView").1 = vec![0.0, 0.0, 1.0], "ListenerUp[0]", "length of the direction");
    let error = read(golden("head.sofa")).unwrap_err().to_string();
    assert!(error.contains("SimpleFreeFieldHRIR") && error.contains("--head"), "{error}");
    std::fs::write(&path, b"\x89HDF, but not really").unwrap();
    assert!(read(&path).unwrap_err().to_string().contains("bad.sofa: HDF5: cannot be read"));
}

/// A step of a linear congruential generator (Knuth's constants).
fn next(state: &mut u64) -> usize {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as usize
}

#[test]
#[ignore = "run by the other test in a process of its own"]
fn child_reads_damaged_files() {
    let Some(folder) = process::folder() else { return };
    let path = folder.join("damaged.sofa");
    let mut answers = [0, 0];
    let mut answer = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        match read(&path) {
            Ok(set) => {
                assert!(set.responses.iter().all(|r| r.samples.samples().iter().all(|x| x.is_finite())));
                answers[0] += 1;
            }
            Err(error) => {
                assert!(error.to_string().contains("damaged.sofa: "), "{error}");
                answers[1] += 1;
            }
        }
    };
    let mut state = 1;
    for name in ["pairs.sofa", "grid.sofa", "pairs_old.sofa"] {
        let whole = std::fs::read(golden(name)).unwrap();
        for step in 0..40 {
            answer(&whole[..whole.len() * step / 40]);
        }
        for round in 0..400 {
            let mut bytes = whole.clone();
            for _ in 0..=round % 4 {
                let at = next(&mut state) % bytes.len();
                // Sizes and addresses are what does harm: all ones, a sign, any value.
                bytes[at] = [0xff, 0x80, next(&mut state) as u8, 0][next(&mut state) % 4];
            }
            answer(&bytes);
        }
    }
    assert!(answers[0] > 0 && answers[1] > 120, "{answers:?}");
    process::done();
}

#[cfg(target_os = "linux")]
#[test]
fn damaged_files_are_answered_in_bounded_memory() {
    let folder = tempfile::tempdir().unwrap();
    process::with_memory("sofa_files::child_reads_damaged_files", folder.path(), 768 << 10);
}

#[test]
fn claims_beyond_the_file_are_refused_before_memory_is_taken() {
    // The shape of Data.IR in its header, 600 samples, becomes 2^40: `pairs_plain.sofa` keeps it as four, one, 600.
    let mut bytes = std::fs::read(golden("pairs_old.sofa")).unwrap();
    let shape: Vec<u8> = [4u64, 1, 600].iter().flat_map(|n| n.to_le_bytes()).collect();
    let places: Vec<usize> = (0..bytes.len() - 24).filter(|&at| bytes[at..at + 24] == shape).collect();
    assert!(!places.is_empty());
    for at in places {
        bytes[at + 16..at + 24].copy_from_slice(&(1u64 << 40).to_le_bytes());
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("claims.sofa");
    std::fs::write(&path, bytes).unwrap();
    let error = read(&path).unwrap_err().to_string();
    assert!(error.contains("claims.sofa: Data.IR: 4398046511104 where at most"), "{error}");
}
