//! Places that are known worse than a tape measure knows them, and say so.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use crate::hidden_effects::{ON_TIMES, THREE_OCTAVES_HZ, small_lab};
use crate::rivals::diagnoser_among;
use sabine_diagnose::{DiagnoseConfig, Diagnosis, Verdict};
use sabine_scene::MeasuredRoom;
use std::path::Path;

/// Distances from where places are to where they are said to be, along an axis, of unit standard deviation: normal quantiles, mixed.
const OFF: [f64; 12] = [-0.87, 0.21, 1.38, -0.43, 0.67, -1.69, 0.0, 1.04, -0.21, -1.15, 0.43, 1.69];

/// A room whose file says that every place is elsewhere, `off_m` along each axis (standard deviation), and how well places are known.
fn misplaced(room: &Path, off_m: f64, stated_m: Option<f64>) -> MeasuredRoom {
    let file = room.join("room.toml");
    let (mut text, mut next) = (String::new(), 0);
    for line in std::fs::read_to_string(&file).unwrap().lines() {
        match line.strip_prefix("position_m = [") {
            Some(position) => {
                let moved: Vec<String> = position
                    .trim_end_matches(']')
                    .split(',')
                    .map(|c| {
                        next += 1;
                        // The steps are coprime to the table's length: axes of one place go their own ways.
                        (c.trim().parse::<f64>().unwrap() + off_m * OFF[(5 * next + next / 12) % 12])
                            .to_string()
                    })
                    .collect();
                text += &format!("position_m = [{}]\n", moved.join(", "));
            }
            None => text += &format!("{line}\n"),
        }
        if let (true, Some(stated_m)) = (line.starts_with("levels = "), stated_m) {
            text += &format!("position_sd_m = {stated_m}\n");
        }
    }
    assert!(next >= 9, "positions stand in lines of their own");
    std::fs::write(&file, text).unwrap();
    MeasuredRoom::read(room).unwrap()
}

fn diagnose(room: &MeasuredRoom) -> Diagnosis {
    let config = DiagnoseConfig { rays: 1000, ..DiagnoseConfig::default() };
    diagnoser_among(config, &ON_TIMES).diagnose(room, &[], &()).unwrap()
}

#[test]
fn places_that_are_off_by_as_much_as_is_stated_name_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let lab = small_lab(571, 6, THREE_OCTAVES_HZ);
    let write = |name: &str| {
        let path = folder.path().join(name);
        lab.write(&[], &path, None).unwrap();
        path
    };
    let found = diagnose(&misplaced(&write("stated"), 0.05, Some(0.05)));
    let named: Vec<_> = found.causes.iter().map(|c| (&c.effect, &c.subject)).collect();
    assert_eq!(found.verdict, Verdict::Adequate, "{named:?} {:?}", found.lack_of_fit);
    // Where a centimetre is stated, or nothing, these places are wrong, and that is said.
    let found = diagnose(&misplaced(&write("silent"), 0.05, None));
    assert_ne!(found.verdict, Verdict::Adequate);
    assert!(
        found.causes.iter().any(|c| c.effect == "position_error"),
        "{:?} {:?}",
        found.causes,
        found.notes
    );
}
