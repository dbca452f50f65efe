//! Pages of hand-made findings.

use super::findings::Findings;
use super::report::html;
use serde_json::{Value, json};

fn findings(verdict: &str, changes: &Value) -> Findings {
    let gain =
        json!({ "nats_per_bin": 0.4, "low": 0.3, "high": 0.5, "db_rmse_before": 2.0, "db_rmse_after": 0.5 });
    let humidity =
        json!({ "name": "relative_humidity", "value": 17.0, "low": 15.0, "high": 19.0, "unit": "%" });
    let cause = json!({ "effect": "air_absorption", "subject": null, "explanation": "It was <dry>.",
        "probability": 0.99, "nats": 40.0, "parameters": [humidity], "held_out_gain": gain, "slight": true });
    let score = |id: &str, nats: f64| json!({ "effect": id, "subject": null, "nats": nats, "d_prime": 4.0, "nats_beside_causes": -1.0 });
    let residual = json!({ "response": null, "band_hz": 4000.0, "time_s": 0.34, "before_db": -4.1,
        "after_db": 0.2, "expected_sd_db": 0.5 });
    let decay = json!({ "response": "s-r", "band_hz": 4000.0, "time_s": [0.0, 0.1], "measured_db": [0.0, -9.0],
        "before_db": [0.0, -7.0], "after_db": [0.0, -9.0], "held_out": true });
    let mut all = json!({ "room": "rooms/hall", "responses": 3, "receivers": 3, "bands_hz": [2000.0, 4000.0],
        "threshold_nats": 5.6, "verdict": verdict, "alternatives": [], "would_decide": [], "held_out": null,
        "lack_of_fit": { "p_value": 1e-4, "p_value_explained": 0.3, "discrepancy_nats": 30.0,
            "discrepancy_nats_explained": -2.0, "dispersion": [1.0, 1.0] },
        "causes": [cause], "candidates": [score("air_absorption", 40.0), score("time_zero", -3.0)],
        "isolability": [{ "effects": ["sound_speed", "sampling_clock"], "cosine": 0.999, "separable": false,
            "would_decide": "read a thermometer" }],
        "materials": [["wall", { "stated": [0.1, 0.1], "absorption_before": [0.2, 0.2],
            "absorption": [0.1, 0.1], "absorption_sd": [0.01, 0.01] }]],
        "residuals": [residual], "decays": [decay], "common_gain_db": -7.0, "notes": [], "seconds": [["trace", 1.0]] });
    for (key, value) in changes.as_object().unwrap() {
        all[key] = value.clone();
    }
    serde_json::from_value(all).unwrap()
}

#[test]
fn a_named_cause_is_told_with_its_figures() {
    let page = html(&findings("explained", &json!({})), None).unwrap();
    for part in [
        "Found: Air drier or more humid than stated.",
        "It was &lt;dry&gt;.",
        "Slight: Air drier or more humid than stated.",
        "17.0 %",
        "15.0 and 19.0",
        "at 4 kHz, 340 ms after the direct sound: the measurement is 4.1 dB quieter",
        "7.0 dB below",
        "2.00 dB off before, 0.50 dB after",
        "too few microphone positions",
        "nothing speaks for: Latency not removed",
        "To tell them apart: Read a thermometer.",
    ] {
        assert!(page.contains(part), "{part}");
    }
}

#[test]
fn what_a_cause_may_concern_as_well_is_told() {
    let cause = json!({ "effect": "surface_absorption", "subject": "carpet", "other_subjects": ["board"],
        "explanation": "One material.", "probability": 0.99, "nats": 30.0, "parameters": [], "held_out_gain": null });
    let page = html(&findings("explained", &json!({ "causes": [cause] })), None).unwrap();
    assert!(page.contains("Found: Absorption of one material is wrong (carpet or board)."), "{page}");
}

#[test]
fn reflections_that_tell_a_cause_are_listed_the_farthest_moved_first() {
    let one = |i: usize| json!({ "response": format!("s-<r{i}>"), "order": i % 2, "stops_m": [], "stated_ms": 10.0, "found_ms": 11.234, "measured_ms": 11.25 });
    let all: Vec<Value> = (0..14).map(one).collect();
    let page = html(&findings("explained", &json!({ "moved_reflections": all })), None).unwrap();
    assert!(page.contains("Reflections that tell it") && page.contains("2 more are in diagnosis.json."));
    assert!(
        page.contains("<td>s-&lt;r0&gt;</td><td>not known</td><td>10.00</td><td>11.23</td><td>11.25</td>")
    );
    assert!(!html(&findings("explained", &json!({})), None).unwrap().contains("Reflections that tell it"));
}

#[test]
fn each_verdict_says_what_it_means() {
    let page = html(&findings("adequate", &json!({ "causes": [] })), None).unwrap();
    assert!(page.contains("The simulation explains this measurement.") && !page.contains("What was found"));
    let page = html(&findings("unconfirmed", &json!({})), None).unwrap();
    assert!(
        page.contains("Found at the one place measured, not confirmed: Air drier or more humid than stated.")
    );
    assert!(page.contains("A response at a second place would."));
    let left = json!({ "p_value": 1e-9, "p_value_explained": 1e-3, "discrepancy_nats": 30.0, "discrepancy_nats_explained": 3.0,
        "dispersion": [1.0, 1.0], "tests": [{ "name": "levels", "p_value": 1e-4 }] });
    let page = html(&findings("incomplete", &json!({ "lack_of_fit": left })), None).unwrap();
    assert!(
        page.contains("Found, but not everything is explained: Air drier or more humid than stated.")
            && page.contains("what is named may stand in for what is missing")
    );
    let set = json!({ "alternatives": ["surface_absorption"], "would_decide": ["measure on a damp day"] });
    let page = html(&findings("ambiguous", &set), None).unwrap();
    assert!(page.contains("which of 2 causes it is") && page.contains("<li>Measure on a damp day.</li>"));
    let fit = json!({ "p_value": 1e-4, "p_value_explained": 1e-4, "discrepancy_nats": 30.0, "discrepancy_nats_explained": 30.0,
        "dispersion": [1.0, 1.0], "tests": [{ "name": "odd bins", "subject": "s1-r2", "p_value": 3e-5 }, { "name": "levels", "p_value": 0.4 }] });
    let page = html(&findings("unexplained", &json!({ "causes": [], "lack_of_fit": fit })), None).unwrap();
    assert!(page.contains("What chance does not explain: odd bins (most: s1-r2)."));
    assert!(page.contains("<td>Odd bins</td><td>s1-r2</td><td>below 0.001</td>"));
    assert!(page.contains("<td>Levels</td><td></td><td>0.400</td>"));
    assert!(page.contains("none of the known causes explains"));
    assert!(!page.contains("After: with what was found"));
}

#[test]
fn a_law_is_told_with_its_trials_and_drawn_through_what_is_left_without_it() {
    let point = |x: f64, vault: bool| json!({ "covariate": x, "left_db": -4.0 * x, "half_width_db": 0.5, "law_db": -4.0 * x, "vault": vault });
    let points =
        [point(0.1, false), point(0.5, false), point(0.9, false), point(0.3, true), point(0.8, true)];
    let amplitude = json!({ "name": "a", "value": 4.0, "low": 3.0, "high": 5.0, "unit": "dB" });
    let law = json!({ "id": "grazing_carpet", "target": "reflection", "surface": "carpet", "formula": "-a * (1 - cos_incidence)^2",
        "words": "Each meeting with <carpet> loses.", "parameters": [amplitude], "evidence_nats": 30.0, "prior_nats": 5.0, "family_p": 0.0025,
        "vault_gain_nats": 7.25, "sham_nats": 12.0, "not_told_from": ["cos_incidence^2"], "points": points });
    let search = json!({ "vault": ["r2", "r5"], "fallen": [{ "goes_with": "decays go with <x>", "reason": "a sham does as well" }] });
    let page = html(&findings("law", &json!({ "laws": [law], "law_search": search })), None).unwrap();
    for part in [
        "A law that no catalogue lists",
        "Each meeting with &lt;carpet&gt; loses.",
        "<code>-a * (1 - cos_incidence)^2</code>",
        "4.0 dB (90 %: 3.0 to 5.0)",
        "probability 0.0025 at most",
        "7.2 nats",
        "12.0 nats",
        "Formulas that do as well at these positions: 1<",
        "positions set aside",
        "Decays go with &lt;x&gt;. A sham does as well.",
        "to confirm what it finds: r2, r5.",
    ] {
        assert!(page.contains(part), "{part}");
    }
    // The vault has a colour of its own.
    let drawn = &page[page.find("The search for a law").unwrap()..];
    assert!(drawn.contains("#0072B2") && drawn.contains("#D55E00"));
    let visible = json!([{ "goes_with": "reflections from <carpet> go with cos_incidence^2", "from_db": 3.25 },
        { "goes_with": "what is recorded goes with file_time_s / t", "from_db": null }]);
    let search = json!({ "vault": [], "fallen": [], "visible": visible });
    let none = html(&findings("adequate", &json!({ "causes": [], "law_search": search })), None).unwrap();
    assert!(none.contains("No law is named beside the catalogue.") && none.contains("six are needed"));
    assert!(
        none.contains(
            "<td>Reflections from &lt;carpet&gt; go with cos_incidence^2</td><td>from 3.2 dB on</td>"
        )
    );
    assert!(none.contains("file_time_s / t</td><td>not at all</td>"));
}
