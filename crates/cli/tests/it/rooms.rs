//! What commands say of a room before they compute: its size, its units, its guesses; rooms that are drawn; walks into walls.

use crate::sabine;
use sabine::acoustics::material_library;
use sabine::scene::MeasuredRoom;
use serde_json::Value;
use std::path::Path;
use std::process::Output;
use tempfile::TempDir;

const FIXTURE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room");

fn run(job: &str, arguments: &[&str]) -> Output {
    sabine(job).args(arguments).output().unwrap()
}

fn printed(output: &Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The one line of an error.
fn refused(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stdout));
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The fixture's room with another text or mesh.
fn changed(toml: impl Fn(String) -> String, obj: impl Fn(String) -> String) -> TempDir {
    let folder = TempDir::new().unwrap();
    let text = |name: &str| std::fs::read_to_string(Path::new(FIXTURE).join(name)).unwrap();
    let no_responses = text("room.toml").split("[[responses]]").next().unwrap().to_owned();
    std::fs::write(folder.path().join("room.toml"), toml(no_responses)).unwrap();
    std::fs::write(folder.path().join("room.obj"), obj(text("room.obj"))).unwrap();
    folder
}

fn corners(obj: String, corner: impl Fn([f64; 3]) -> [f64; 3]) -> String {
    let line = |line: &str| match line.strip_prefix("v ") {
        None => format!("{line}\n"),
        Some(rest) => {
            let numbers: Vec<f64> = rest.split_whitespace().map(|word| word.parse().unwrap()).collect();
            let [x, y, z] = corner([numbers[0], numbers[1], numbers[2]]);
            format!("v {x} {y} {z}\n")
        }
    };
    obj.lines().map(line).collect()
}

fn path(folder: &TempDir) -> &str {
    folder.path().to_str().unwrap()
}

#[test]
fn a_drawn_room_is_traced() {
    let folder = TempDir::new().unwrap();
    let room = folder.path().join("living room");
    let room = room.to_str().unwrap();
    let arguments = [
        "--size",
        "5x4x2.6",
        "--floor",
        "parquet_on_concrete",
        "--ceiling",
        "plasterboard_ceiling",
        "--walls",
        "rendered_brick",
        "--wall",
        "2=glass_window",
        "--source",
        "1,2,1.5",
        "--source",
        "screen=0.5,3,1",
        "--receiver",
        "4,1.5,1.2",
        "--out",
        room,
    ];
    let text = printed(&run("new-room", &arguments));
    assert!(
        text.starts_with("room: 5 x 4 x 2.6 m (along x, y, z), volume 52 m3, surface 86.8 m2\n"),
        "{text}"
    );
    assert!(text.lines().last().unwrap().starts_with("next: sabine trace --room "), "{text}");
    let read = MeasuredRoom::read(room).unwrap();
    assert_eq!(read.sources().iter().map(|s| s.id.as_str()).collect::<Vec<_>>(), ["s1", "screen"]);
    let out = folder.path().join("traced");
    let traced = ["--room", room, "--rays", "2000", "--rate", "16000", "--out", out.to_str().unwrap()];
    let text = printed(&run("trace", &traced));
    assert!(text.starts_with("room: 5 x 4 x 2.6 m") && !text.contains("note: "), "{text}");
    let written = std::fs::read_to_string(Path::new(room).join("room.toml")).unwrap();
    assert!(written.starts_with("[room]\n") && !written.contains("responses"), "{written}");
    let again = refused(&run("new-room", &arguments));
    assert!(again.contains("living room"), "{again}");
}

#[test]
fn a_floor_plan_becomes_a_room_and_what_is_none_is_refused() {
    let folder = TempDir::new().unwrap();
    let (plan, room) = (folder.path().join("plan.txt"), folder.path().join("room"));
    let (plan, room) = (plan.to_str().unwrap(), room.to_str().unwrap());
    let drawn = |more: &[&str]| {
        run("new-room", &[&["--plan", plan, "--height", "2.5", "--out", room], more].concat())
    };
    std::fs::write(plan, "0 0\n6 3\n6 0\n0 3\n").unwrap();
    let crossed = refused(&drawn(&[]));
    assert!(crossed.contains("plan.txt: corners: wall 1 and wall 3 cross"), "{crossed}");
    std::fs::write(plan, "0 0\n6 0\n6 3\n3 3\n3 5\n0 5\n").unwrap();
    let outside = refused(&drawn(&["--source", "4,4,1"]));
    assert!(outside.contains("`s1` at [4.0, 4.0, 1.0] m is not inside the room"), "{outside}");
    let unknown = refused(&drawn(&["--floor", "carpt_thin"]));
    assert!(unknown.contains("no `carpt_thin`; the nearest names are carpet_thin"), "{unknown}");
    assert!(refused(&run("new-room", &["--size", "5x0x2.6", "--out", room])).contains("width (m) is 0"));
    assert!(
        refused(&run("new-room", &["--size", "5x4", "--out", room])).contains("--size 5x4: write length")
    );
    assert_eq!(run("new-room", &["--plan", plan, "--out", room]).status.code(), Some(2), "no height");
    assert!(!Path::new(room).exists());
    let text = printed(&drawn(&["--floor", "carpet_thin"]));
    assert!(
        text.starts_with("room: 6 x 5 x 2.5 m (along x, y, z), volume 60 m3, surface 103 m2\n"),
        "{text}"
    );
    assert!(
        text.contains("note: ceiling: no absorption is stated") && text.contains("there are no sources"),
        "{text}"
    );
}

#[test]
fn the_library_is_printed_as_table_and_as_csv() {
    let csv = printed(&run("materials", &["--csv"]));
    assert_eq!(csv.lines().count(), 1 + material_library().len());
    assert!(csv.starts_with("name,absorption_125_hz,"), "{csv}");
    let table = printed(&run("materials", &[]));
    assert!(
        material_library()
            .iter()
            .all(|surface| table.contains(surface.name) && table.contains(surface.source))
    );
}

#[test]
fn guessed_materials_and_both_uncertainties_are_printed() {
    let empty = |toml: String| {
        let (before, after) = toml.split_once("[materials.carpet]\n").unwrap();
        format!("{before}[materials.carpet]\n{}", &after[after.find("\n\n").unwrap()..])
    };
    let room = changed(empty, |obj| obj);
    let json = room.path().join("p.json");
    let trace = |folder: &str| {
        let arguments =
            ["--room", folder, "--rays", "2000", "--rate", "16000", "--json", json.to_str().unwrap()];
        let text = printed(&run("trace", &arguments));
        let value: Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
        (text, value)
    };
    let (text, guessed) = trace(path(&room));
    assert!(text.contains("note: carpet: no absorption is stated; 0.2 ± 0.25 is a guess ("), "{text}");
    assert!(
        text.contains("T30 at 1000 Hz: ") && text.contains(" (rays) ± ") && text.contains(" (materials)"),
        "{text}"
    );
    assert_eq!(guessed["guessed_materials"][0]["material"], "carpet");
    let (_, stated) = trace(FIXTURE);
    assert_eq!(stated["guessed_materials"].as_array().unwrap().len(), 0);
    let at_1k = |value: &Value, key: &str| value[key][3].as_f64().unwrap();
    for value in [&guessed, &stated] {
        let (rays, materials) = (at_1k(value, "t30_sd_s"), at_1k(value, "t30_materials_sd_s"));
        assert!(materials > 2.0 * rays, "{rays} {materials}");
    }
    assert_eq!(stated["size_m"], serde_json::json!([8.0, 6.8, 3.96]));
}

#[test]
fn units_and_axes_are_questioned() {
    let cm = changed(|toml| toml, |obj| corners(obj, |p| p.map(|c| 100.0 * c)));
    let arguments = |folder| ["--room", folder, "--rays", "500", "--rate", "16000", "--duration", "0.5"];
    let text = printed(&run("trace", &arguments(path(&cm))));
    assert!(
        text.contains("note: 800 m long: is the mesh in centimetres? Then add units = \"cm\" to [room]"),
        "{text}"
    );
    let stated = changed(
        |toml| toml.replacen("[room]", "[room]\nunits = \"cm\"", 1),
        |obj| corners(obj, |p| p.map(|c| 100.0 * c)),
    );
    let text = printed(&run("trace", &arguments(path(&stated))));
    assert!(text.starts_with("room: 8 x 6.8 x 3.96 m") && !text.contains("centimetres"), "{text}");
    let y_up = changed(|toml| toml, |obj| corners(obj, |[x, y, z]| [x, z, -y]));
    let error = refused(&run("trace", &arguments(path(&y_up))));
    assert!(
        error.contains("sources[0].position_m") && error.contains("add up_axis = \"y\" to [room]"),
        "{error}"
    );
}

#[test]
fn other_folders_are_read_only_if_asked() {
    let other = TempDir::new().unwrap();
    std::fs::copy(Path::new(FIXTURE).join("room.obj"), other.path().join("room.obj")).unwrap();
    let mesh = format!("mesh = \"{}/room.obj\"", path(&other));
    let room = changed(|toml| toml.replacen("mesh = \"room.obj\"", &mesh, 1), |obj| obj);
    let arguments = ["--room", path(&room), "--rays", "500", "--rate", "16000"];
    let error = refused(&run("trace", &arguments));
    assert!(error.contains("room.toml: room.mesh: ") && error.contains("outside the folder"), "{error}");
    printed(&run("trace", &[&arguments[..], &["--allow-outside"]].concat()));
}

#[test]
fn a_walk_into_a_wall_is_refused_at_once() {
    let folder = TempDir::new().unwrap();
    let (corners, out) = (folder.path().join("corners.txt"), folder.path().join("walk.wav"));
    let arguments = [
        "--room",
        FIXTURE,
        "--path",
        corners.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
        "--rays",
        "50",
        "--update",
        "0.5",
        "--rate",
        "16000",
        "--duration",
        "0.3",
    ];
    std::fs::write(&corners, "6.2 2.6 1.3\n6.2 2.8 1.3\n6.2 9 1.3\n").unwrap();
    let error = refused(&run("walk", &arguments));
    for words in
        ["leg 2 of the walk, from [6.2, 2.8, 1.3] to [6.2, 9.0, 1.3] m, goes through `", "--through-walls"]
    {
        assert!(error.contains(words), "{error}");
    }
    // Thousands of corners: hours of sound are refused before the first ray.
    let walk: String =
        (0..4000).map(|i| format!("6.2 {} 1.3\n", if i % 2 == 0 { 1.0 } else { 6.0 })).collect();
    std::fs::write(&corners, walk).unwrap();
    let error = refused(&run("walk", &[&arguments[..], &["--through-walls"]].concat()));
    assert!(error.contains("the walk takes 4.6 h at 1.2 m/s: 267 million samples"), "{error}");
    assert!(!out.exists());
    std::fs::write(&corners, "6.2 2.6 1.3\n6.2 2.8 1.3\n").unwrap();
    let text = printed(&run("walk", &arguments));
    assert!(
        text.starts_with("room: 8 x 6.8 x 3.96 m") && text.contains("walk: 1 leg, 0.2 m, 0.2 s"),
        "{text}"
    );
}
