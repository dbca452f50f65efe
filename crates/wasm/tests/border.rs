//! What a page may be fed, and what it gets.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use sabine_acoustics::{SampleFormat, Signal, encode_wav, encode_wav_channels};
use sabine_scene::MeasuredRoom;
use sabine_wasm::*;

/// Noise whose power decays by 60 dB in `t60_s`.
fn decay(t60_s: f64, duration_s: f64, rate_hz: u32) -> Vec<f32> {
    let rate = f64::from(rate_hz);
    let mut state = 1u32;
    (0..(duration_s * rate) as usize)
        .map(|i| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = f64::from(state >> 8) / 8_388_608.0 - 1.0;
            (noise * (-6.9078 * i as f64 / rate / t60_s).exp()) as f32
        })
        .collect()
}

fn wav(samples: Vec<f32>, rate_hz: u32) -> Vec<u8> {
    encode_wav(&Signal::new(samples, rate_hz).unwrap(), SampleFormat::Float32).unwrap()
}

fn refusal(name: &str, bytes: impl Into<Vec<u8>>) -> String {
    Opened::read(name, bytes.into()).unwrap_err().to_string()
}

#[test]
fn a_decay_is_measured_with_an_interval() {
    let opened = Opened::read("decay.wav", wav(decay(1.2, 3.0, 48_000), 48_000)).unwrap();
    let measured = Measured::read(&opened.responses()[0].samples).unwrap();
    let t60 = measured.rows.iter().find(|row| row.name == "T60").unwrap();
    let Cell::Value { value, low, high } = t60.cells[3] else { panic!("{t60:?}") };
    assert!(low < value && value < high && (value - 1.2).abs() < 1.5 * (high - low), "{t60:?}");
    // The curve of 1 kHz falls by 60 dB in that time.
    let curve = &measured.decay_db[3];
    let at = |db: f64| curve.iter().position(|&level| level < db).unwrap() as f64 * measured.decay_step_s;
    assert!((2.0 * (at(-35.0) - at(-5.0)) - 1.2).abs() < 0.1, "{curve:?}");
    serde_json::to_string(&measured).unwrap();
}

#[test]
fn what_is_no_response_is_refused_in_words() {
    assert_eq!(refusal("empty.wav", []), "empty.wav: the file is empty");
    assert!(refusal("photo.wav", *b"\x89PNG\r\n\x1a\n").starts_with("photo.wav: this is PNG; sound is read"));
    assert!(refusal("photo.txt", *b"\x89PNG\r\n\x1a\n").starts_with("photo.txt: line 1: cannot read"));
    assert!(refusal("cut.sofa", *b"\x89HDF\r\n\x1a\n....").starts_with("cut.sofa: HDF5"));
    let cut = wav(decay(0.3, 1.0, 8000), 8000)[..2000].to_vec();
    assert!(refusal("cut.wav", cut).starts_with("cut.wav: "));
    let talk: Vec<f32> = (0..8).flat_map(|_| decay(0.1, 0.4, 8000)).collect();
    assert!(refusal("talk.wav", wav(talk, 8000)).contains("bursts"));
    assert_eq!(refusal("zeros.wav", wav(vec![0.0; 100], 8000)), "zeros.wav: all samples are zero");
}

#[test]
fn an_hour_of_music_is_refused_by_its_header() {
    // Of a stream whose header promises 3600 s: the bytes need not be there to be counted.
    let hour = wav(vec![0.0; 3600 * 1000], 1000);
    let message = refusal("music.wav", hour);
    assert!(
        message.starts_with("music.wav: this lasts 3600 s; an impulse response of at most 60 s"),
        "{message}"
    );
    let large = refusal("large.wav", vec![0; MAX_FILE_BYTES as usize + 1]);
    assert!(large.starts_with("large.wav: 134217729 bytes; at most 134217728"), "{large}");
}

#[test]
fn of_two_channels_the_first_is_read() {
    let (left, right) = (decay(0.5, 1.0, 16_000), vec![0.0; 16_000]);
    let bytes = encode_wav_channels(&[&left, &right], 16_000, SampleFormat::Float32).unwrap();
    let opened = Opened::read("stereo.wav", bytes).unwrap();
    assert_eq!(opened.responses()[0].samples.samples(), left);
    assert_eq!(opened.summary()["notes"][0], "The first of 2 channels is read.");
    assert!(matches!(opened.response(1), Err(Error::NoSuchResponse { index: 1, count: 1 })));
}

#[test]
fn sofa_files_bring_their_places() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scene/tests/sofa/pairs.sofa");
    let opened = Opened::read("pairs.sofa", std::fs::read(path).unwrap()).unwrap();
    assert!(opened.responses().len() > 1);
    assert!(opened.responses().iter().all(|response| response.places_m.is_some()));
}

fn trace_spec(room: &str) -> Result<TraceSpec, serde_json::Error> {
    serde_json::from_str(&format!(
        r#"{{"room": {room}, "source_m": [1.5, 2, 1.5], "receiver_m": [4.2, 3.1, 1.2], "rays": 2000}}"#
    ))
}

#[test]
fn a_box_is_traced_and_its_mesh_likewise() {
    let surfaces = r#""surfaces": {"floor": "parquet_on_concrete", "ceiling": "plasterboard_ceiling", "walls": "rendered_brick"}"#;
    let spec = trace_spec(&format!(r#"{{"size_m": [6, 5, 3], {surfaces}}}"#)).unwrap();
    let traced = Traced::new(&spec, &()).unwrap();
    assert!(traced.response.peak() > 0.01 && traced.paths > 1000);
    let obj = spec.room.model().unwrap().scene.to_obj();
    let room = RoomSpec { obj: Some(obj), size_m: None, ..spec.room.clone() };
    let same = Traced::new(&TraceSpec { room, ..spec.clone() }, &()).unwrap();
    assert_eq!(same.rows, traced.rows);
    assert!(same.response == traced.response);
}

#[test]
fn slips_of_a_request_are_named() {
    let fails = |room: &str| match trace_spec(room) {
        Ok(spec) => Traced::new(&spec, &()).unwrap_err().to_string(),
        Err(error) => error.to_string(),
    };
    assert!(fails("{}").contains("either size_m"));
    assert!(fails(r#"{"size": [6, 5, 3]}"#).contains("size"));
    assert!(fails(r#"{"size_m": [6, 5, -3]}"#).contains("-3"));
    assert!(fails(r#"{"size_m": [6, 5, 3], "surfaces": {"floor": "parkett"}}"#).contains("parkett"));
    assert!(fails(r#"{"size_m": [6, 5, 3], "surfaces": {"roof": "limestone"}}"#).contains("roof"));
    assert!(fails(r#"{"obj": "v 0 0 x"}"#).starts_with("room.obj: line 1"));
    assert!(fails(r#"{"size_m": [4, 5, 3]}"#).contains("4.2"), "{}", fails(r#"{"size_m": [4, 5, 3]}"#));
}

/// The same room and responses from a folder and from memory: what the library compares is the same.
#[test]
fn a_survey_is_the_room_that_a_folder_would_hold() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room");
    let on_disk = MeasuredRoom::read(folder).unwrap();
    let mut survey = Survey::default();
    for (index, entry) in on_disk.responses().iter().enumerate() {
        let places =
            [on_disk.sources()[entry.source].position_m, on_disk.receivers()[entry.receiver].position_m];
        survey.add(on_disk.load_response(index).unwrap(), places).unwrap();
    }
    let obj = std::fs::read_to_string(format!("{folder}/room.obj")).unwrap();
    let spec = DiagnoseSpec {
        room: RoomSpec { obj: Some(obj), ..RoomSpec::default() },
        rays: 500,
        seed: 0,
        time_zero: on_disk.measurement().time_zero,
        levels: on_disk.measurement().levels,
    };
    let room = survey.room(&spec).unwrap();
    assert_eq!(room.scene().volume_m3(), on_disk.scene().volume_m3());
    for index in 0..room.responses().len() {
        assert_eq!(room.load_response(index).unwrap(), on_disk.load_response(index).unwrap());
    }
    let found = survey.diagnose(&spec, &()).unwrap();
    assert!(
        ["adequate", "explained", "incomplete", "unconfirmed", "ambiguous", "unexplained"]
            .iter()
            .any(|v| found["verdict"] == *v),
        "{found}"
    );
    assert_eq!(found["materials"].as_object().unwrap().len(), room.scene().materials().len());
    let none = Survey::default().diagnose(&spec, &()).unwrap_err().to_string();
    assert!(none.contains("response"), "{none}");
    let rays = survey.diagnose(&DiagnoseSpec { rays: 1_000_000, ..spec }, &()).unwrap_err().to_string();
    assert!(rays.contains("rays"), "{rays}");
}
