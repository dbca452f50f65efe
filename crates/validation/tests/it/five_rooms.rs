//! The paper's table on real rooms, in small.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");

fn five_rooms(arguments: &[&str], out: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_five_rooms")).args(arguments).arg("--out").arg(out).output().unwrap()
}

fn folder(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("sabine_{name}_{}", std::process::id()))
}

#[test]
fn a_real_room_is_rendered_from_speech_and_from_its_response() {
    if !Path::new(DATA).join("rooms_more/bras_cr2_second").exists() {
        eprintln!("skipped: {DATA} is absent");
        return;
    }
    let out = folder("five_rooms_small");
    let output = five_rooms(&["--data", DATA, "--room", "bras", "--pairs", "1", "--rays", "1000"], &out);
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{printed}{}", String::from_utf8_lossy(&output.stderr));
    // As many as the model card counts: training, validation and test are divided as they were.
    assert!(printed.contains("154 speakers") && printed.contains("23 of them in the test"), "{printed}");
    let mean = |error: &str| -> Vec<f64> {
        let table = printed.split(&format!("| {error} |")).nth(1).unwrap();
        let line = table.lines().find(|line| line.starts_with("| **mean of all rooms")).unwrap();
        line.split("**").filter_map(|cell| cell.parse().ok()).collect()
    };
    // In the order of the columns: blind, the paper's objective, response given, T30 and EQ given.
    let (t60_s, eq_db) = (mean("T60 error (s)"), mean("EQ error (dB)"));
    assert!(t60_s[0] < 0.4 && t60_s[2] < 0.15, "{t60_s:?}");
    assert!(eq_db[0] < 4.0 && eq_db[2] < 0.5, "{eq_db:?}");
    let lines = std::fs::read_to_string(out.join("five_rooms.csv")).unwrap().lines().count();
    assert_eq!(lines, 1 + 5 * 13, "a head, five methods, seven octaves of T60 and six of EQ");
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert_eq!(page.matches("<audio").count(), 5);
    std::fs::remove_dir_all(out).unwrap();
}

#[test]
fn what_is_not_there_is_named() {
    let out = folder("five_rooms_nowhere");
    let output = five_rooms(&["--data", "no/such/folder", "--room", "bras"], &out);
    assert!(!output.status.success());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("no/such/folder") && said.contains("there is no such file"), "{said}");
    let output = five_rooms(&["--data", DATA, "--room", "no such room"], &out);
    assert!(String::from_utf8_lossy(&output.stderr).contains("no such room"));
    std::fs::remove_dir_all(out).ok();
}
