//! The experiment as webMUSHRA reads it (<https://github.com/audiolabs/webMUSHRA>, `doc/experimenter.md`).

use super::stimuli::{CONDITIONS, Item};
use std::fmt::Write;
use std::path::Path;

/// Identifier of the experiment and name of its folder of results.
const TEST_ID: &str = "sabine";

/// A name for pages and files out of a file name: letters, digits and `_`.
pub fn identifier(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

/// Name of a stimulus.
pub fn file_name(item: &str, condition: &str) -> String {
    format!("{item}_{condition}.wav")
}

/// The YAML file: an instruction, a page to set the volume, one MUSHRA page for each item in random order, and a page that
/// asks who it was and sends the ratings.
///
/// webMUSHRA adds the hidden reference itself, as a stimulus called `reference`; its own low-passed anchors are switched
/// off, since the anchors here are the paper's.
pub fn configuration(items: &[Item], prefix: &str) -> String {
    let prefix = prefix.trim_end_matches('/');
    let path =
        |item: &Item, condition: &str| quoted(&format!("{prefix}/{}", file_name(&item.name, condition)));
    let mut text = String::from("# Made by the example listening_test.\n");
    let mut line = |indent: usize, words: &str| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{:indent$}{words}", "");
    };
    line(0, "testname: \"How alike do these rooms sound?\"");
    line(0, &format!("testId: {TEST_ID}"));
    line(0, "bufferSize: 2048");
    line(0, "stopOnErrors: true");
    line(0, "showButtonPreviousPage: false");
    line(0, "remoteService: service/write.php");
    line(0, "pages:");
    line(2, "- type: generic");
    line(4, "id: instruction");
    line(4, "name: \"Before you start\"");
    line(4, &format!("content: {}", quoted(INSTRUCTION)));
    if let Some(item) = items.first() {
        line(2, "- type: volume");
        line(4, "id: volume");
        line(4, "name: Volume");
        line(4, "content: \"Set a comfortable volume and leave it there.\"");
        line(4, &format!("stimulus: {}", path(item, CONDITIONS[0])));
        line(4, "defaultVolume: 0.5");
    }
    line(2, "-");
    line(4, "- random");
    for item in items {
        line(4, "- type: mushra");
        line(6, &format!("id: {}", quoted(&item.name)));
        line(6, "name: \"How alike are the rooms?\"");
        line(6, &format!("content: {}", quoted(QUESTION)));
        line(6, "showWaveform: false");
        line(6, "enableLooping: true");
        line(6, "randomize: true");
        line(6, "showConditionNames: false");
        line(6, "createAnchor35: false");
        line(6, "createAnchor70: false");
        line(6, &format!("reference: {}", path(item, CONDITIONS[0])));
        line(6, "stimuli:");
        for condition in &CONDITIONS[1..] {
            line(8, &format!("{condition}: {}", path(item, condition)));
        }
    }
    line(2, "- type: finish");
    line(4, "name: \"Thank you\"");
    line(4, "content: \"Please give the number that you were told, then send your ratings.\"");
    line(4, "showResults: false");
    line(4, "writeResults: true");
    line(4, "questionnaire:");
    line(6, "- type: text");
    line(8, "label: Number");
    line(8, "name: assessor");
    text
}

const INSTRUCTION: &str = "Use headphones in a quiet place. On each page the same words are spoken in a reference room and in \
    several others. Say how much each room sounds like that of the reference, from 0 (not at all) to 100 (the same). One of \
    them is the reference itself: it should get 100.";
const QUESTION: &str = "Compare each room with that of the reference: 100 is the same room, 0 nothing alike. Judge the room, \
    not the voice.";

/// A string that YAML reads as it is: JSON's way of quoting is YAML's too.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
