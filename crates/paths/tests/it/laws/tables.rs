//! Laws in TOML and JSON.

use sabine_paths::laws::Law;
use serde::{Deserialize, Serialize};

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct File {
    laws: Vec<Law>,
}

const GRAZING: &str = r#"
[[laws]]
id = "floor_takes_grazing_sound"
target = "reflection"
surface = "floor"
formula = "-a * (1 - cos_incidence)^2 * above(frequency_hz, f0)"
words = "Each meeting with the floor takes up to 4.1 dB more the more it grazes, from 2 kHz up."
[laws.parameters]
a  = { value = 4.1, low = 2.9, high = 5.4, unit = "dB" }
f0 = { value = 2000, low = 1000, high = 2800, unit = "Hz" }

[[laws]]
id = "latency"
target = "delay"
formula = "t"
parameters = { t = { value = 1.5, low = 1, high = 2, unit = "ms" } }
"#;

#[test]
fn a_file_of_laws_comes_back_to_the_byte() {
    let file: File = toml::from_str(GRAZING).unwrap();
    let values: Vec<f64> = file.laws[0].parameters().map(|(_, parameter)| parameter.value).collect();
    assert_eq!(values, [4.1, 2000.0]);
    assert_eq!(file.laws[1].value(|_| None).unwrap(), 1.5);
    let written = toml::to_string(&file).unwrap();
    let again: File = toml::from_str(&written).unwrap();
    assert_eq!(again, file);
    assert_eq!(toml::to_string(&again).unwrap(), written);
    let json = serde_json::to_string_pretty(&file).unwrap();
    let again: File = serde_json::from_str(&json).unwrap();
    assert_eq!(again, file);
    assert_eq!(serde_json::to_string_pretty(&again).unwrap(), json);
}

#[test]
fn what_is_wrong_in_a_file_is_named() {
    for (from, to, words) in [
        (
            "cos_incidence",
            "cos_incidense",
            "law `floor_takes_grazing_sound`, column 11 of its formula: `cos_incidense`",
        ),
        (
            "target = \"delay\"",
            "target = \"delays\"",
            "law `latency`: one of the targets path, reflection, delay, added and recorder is expected, not `delays`",
        ),
        ("unit = \"ms\"", "unit = \"dB\"", "a law of `delay` gives a time; this formula gives dB"),
        ("value = 4.1", "value = 9.1", "parameters.a: 9.1 lies outside its interval"),
        ("words =", "wrods =", "unknown field `wrods`"),
        ("value = 4.1", "value = nan", "outside its interval"),
        ("surface = \"floor\"\n", "", "needs the name of a material"),
    ] {
        assert!(GRAZING.contains(from));
        let error = toml::from_str::<File>(&GRAZING.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}
