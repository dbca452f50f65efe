//! Arguments out of range, places that cannot be written to, and files of the wrong kind.

use super::outcome::Case;
use super::outcome::Expected::{self, Done, Refused, Usage};
use std::path::Path;

/// Walks and ratings.
pub fn make(folder: &Path) {
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write("walk_nan", "1.6 1.5 1.5\nnan 1 1\n");
    write("walk_outside", "1.6 1.5 1.5\n100 1 1\n");
    write("walk_of_one", "1.6 1.5 1.5\n");
    write("walk_empty", "");
    write("walk_of_words", "a b c\n");
    write("walk_on_the_spot", "1.6 1.5 1.5\n1.6 1.5 1.5\n");
    write("ratings_without_columns.csv", "a,b\n1,2\n");
    write("ratings_of_words.csv", "session_uuid,trial_id,rating_stimulus,rating_score\nx,y,z,abc\n");
    std::fs::write(folder.join("ratings_binary.csv"), [0xff, 0xfe, 0x00, b'\n']).unwrap();
    write("a_file", "in the way");
    std::os::unix::fs::symlink("nowhere", folder.join("dangling")).unwrap();
}

pub fn cases() -> Vec<Case> {
    let trace: [(&str, Expected); 22] = [
        ("--rays 0", Refused(&["rays"])),
        ("--rays 1 --duration 0.2", Done(&[])),
        ("--rays -1", Usage),
        ("--rays 99999999999999999999", Usage),
        ("--rays abc", Usage),
        ("--duration 0", Refused(&["duration_s"])),
        ("--duration -1", Refused(&["duration_s"])),
        ("--duration nan", Refused(&["duration_s"])),
        ("--duration 1e9", Refused(&["duration_s"])),
        ("--duration 0.001", Refused(&["path"])),
        ("--rate 0", Refused(&["sample_rate_hz"])),
        ("--rate 10000000", Refused(&["sample_rate_hz"])),
        ("--ambisonics 0", Refused(&["ambisonic order"])),
        ("--ambisonics 9", Refused(&["ambisonic order"])),
        ("--order 50", Refused(&["image_order"])),
        ("--threads 10000", Refused(&["threads"])),
        ("--wave-below nan", Refused(&["crossover_hz"])),
        ("--wave-below -5", Refused(&["crossover_hz"])),
        ("--wave-below 2000", Refused(&["would fit"])),
        ("--source nope", Refused(&["sources", "nope"])),
        ("--model rooms/good/room.toml", Refused(&["room.toml"])),
        ("--pattern nope", Usage),
    ];
    let mut cases: Vec<Case> = Vec::new();
    for (arguments, expected) in trace {
        let all = format!("trace --room rooms/good {arguments} --out OUT");
        cases.push(Case::new(format!("trace {arguments}"), &all, expected));
    }
    for (arguments, expected) in [
        ("eq --gains-db nan,1,2,3,0,1,2 --sample-rate 48000 --out OUT", Refused(&["62.5 Hz", "NaN"])),
        ("eq --gains-db 1e9,1,2,3,0,1,2 --sample-rate 48000 --out OUT", Refused(&["62.5 Hz", "between"])),
        ("eq --gains-db -6,6,-6,6,-6,6,-6 --sample-rate 48000 --out OUT", Done(&["wrote"])),
        ("eq --gains-db 0,1,2,3,0,1,2 --sample-rate 0 --out OUT", Refused(&["sample_rate_hz"])),
        ("eq --gains-db 0,1,2,3,0,1,2 --sample-rate 48000 --out a_file/fir.wav", Refused(&["a_file"])),
        ("fit --room rooms/good --t60 20,20,20,20,20,20,20 --out OUT", Refused(&["T60 of 20 s"])),
        ("fit --room rooms/good --t60 0.5,0.5 --out OUT", Refused(&["7"])),
        (
            "fit --room rooms/good --rays 500 --responses --hold-out microphone,corner --out OUT",
            Refused(&["none is left"]),
        ),
        ("fit --room rooms/good --rays 500 --smoothness 1e9 --out OUT", Refused(&["smoothness"])),
        (
            "diagnose --room rooms/good --rays 300 --hold-out microphone,corner --out OUT",
            Refused(&["held out"]),
        ),
        ("diagnose --room rooms/good --rays 300 --effects nope --out OUT", Refused(&["nope"])),
        ("replace --room rooms/good --material cheese --out OUT", Refused(&["cheese", "carpet"])),
        ("replace --room rooms/good --with cheese --out OUT", Refused(&["cheese"])),
        ("walk --room rooms/good --path walk_nan --out OUT", Refused(&["walk_nan"])),
        ("walk --room rooms/good --path walk_outside --out OUT", Refused(&["wall"])),
        ("walk --room rooms/good --path walk_of_one --out OUT", Refused(&["two different corners"])),
        ("walk --room rooms/good --path walk_empty --out OUT", Refused(&["two different corners"])),
        ("walk --room rooms/good --path walk_of_words --out OUT", Refused(&["walk_of_words", "line 1"])),
        ("walk --room rooms/good --path walk_on_the_spot --out OUT", Refused(&["two different corners"])),
        ("walk --room rooms/good --speed 0 --out OUT", Refused(&["--speed"])),
        ("walk --room rooms/good --speed 1e-9 --out OUT", Refused(&["--speed"])),
        ("walk --room rooms/good --rate 0 --out OUT", Refused(&["sample rate"])),
        ("walk --room rooms/good --duration 0 --out OUT", Refused(&["duration_s"])),
        ("walk --room rooms/good --mode binaural --head nope.sofa --out OUT", Refused(&["nope.sofa"])),
        ("live --fast --room rooms/good --rays 500 --speech wav/one.wav", Refused(&["one.wav", "0.00 s"])),
        (
            "listen analyse --ratings ratings_without_columns.csv",
            Refused(&["ratings_without_columns.csv", "--assessor"]),
        ),
        ("listen analyse --ratings ratings_of_words.csv", Refused(&["line 2", "abc"])),
        ("listen analyse --ratings ratings_binary.csv", Refused(&["ratings_binary.csv"])),
        ("listen analyse --ratings nope.csv", Refused(&["nope.csv"])),
        ("validate --room rooms/good", Refused(&["measured_parameters.csv"])),
        ("evaluate --data nope", Refused(&["manifest.json"])),
        ("estimate", Usage),
        ("nonsense", Usage),
        ("match --rays 300 --out a_file", Refused(&["a_file"])),
        ("match --rays 300 --out a_file/below", Refused(&["a_file"])),
        ("match --rays 300 --out dangling", Refused(&["dangling"])),
        ("match --rays 300 --out /proc/nowhere", Refused(&["/proc/nowhere"])),
        ("measure wav/good.wav --json /proc/nowhere.json", Refused(&["/proc/nowhere.json"])),
        ("measure wav/good.wav --plots a_file", Refused(&["a_file"])),
        ("measure wav/good.wav --from 30 --to 20", Refused(&["nominal centre"])),
        ("new-room --size 0x4x2.6 --out OUT", Refused(&["size"])),
        ("new-room --size 5x4 --out OUT", Refused(&["5x4", "length x width x height"])),
        ("materials --csv", Done(&["carpet_thin"])),
    ] {
        cases.push(Case::new(arguments, arguments, expected));
    }
    cases
}
