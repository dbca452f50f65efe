//! The texts of a new effect. What `Effect` and `Case` ask for stands here alone.

/// The names of an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Names {
    /// `lost_channel`
    pub id: String,
    /// `LostChannel`
    pub type_name: String,
    /// `Lost channel`
    pub title: String,
}

impl Names {
    /// All names from the identifier.
    pub fn new(id: &str) -> Result<Self, String> {
        let words: Vec<&str> = id.split('_').collect();
        let is_word = |word: &&str| {
            word.starts_with(|c: char| c.is_ascii_lowercase())
                && word.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit())
        };
        if !words.iter().all(is_word) {
            return Err(format!("{id}: an identifier is words of lower-case letters joined by `_`"));
        }
        let capital = |word: &str| word[..1].to_uppercase() + &word[1..];
        Ok(Self {
            id: id.to_owned(),
            type_name: words.iter().map(|word| capital(word)).collect(),
            title: capital(&words.join(" ")),
        })
    }
}

/// The effect's file.
pub fn effect(names: &Names) -> String {
    fill(names, EFFECT)
}

/// Its test in a room of the laboratory.
pub fn test(names: &Names) -> String {
    fill(names, TEST)
}

/// Its row in the glossary.
pub fn row(names: &Names) -> String {
    fill(names, "| TITLE | `ID` | - | TODO: what it is, in one line, with the source |")
}

/// What the author still has to do.
pub fn what_is_left(names: &Names) -> String {
    fill(names, LEFT)
}

fn fill(names: &Names, text: &str) -> String {
    text.replace("TYPE", &names.type_name).replace("TITLE", &names.title).replace("ID", &names.id)
}

const EFFECT: &str = r#"//! `ID`: TODO what differs from the room file.

use crate::effect::EffectInfo;
use crate::effect::{Case, DecayTerm, Effect, Parameter};
use crate::simulate::views::BandView;
use crate::survey::Survey;
use std::f64::consts::LN_10;

/// TODO the physics, with its source.
///
/// Mark: TODO what it leaves in the data. Mimicked by: TODO which effects, and which measurement tells them apart.
#[derive(Clone, Copy, Debug, Default)]
pub struct TYPE;

impl Effect for TYPE {
    fn info(&self) -> EffectInfo {
        EffectInfo::new("ID", "TITLE", "TODO: one sentence for the user, and what to check.")
    }

    fn cases(&self, _: &Survey) -> Vec<Case> {
        let level = Parameter::new("level", "dB", 0.0, 3.0, (-20.0, 20.0)).typically(3.0);
        // TODO `changing`, so that what is named renders.
        vec![Case::decay(vec![level], *self)]
    }
}

impl DecayTerm for TYPE {
    fn apply(&self, values: &[f64], _: &BandView<'_>, ln_energy: &mut [f64]) {
        for ln in ln_energy.iter_mut() {
            *ln += LN_10 / 10.0 * values[0];
        }
    }
}
"#;

const TEST: &str = r#"#[test]
#[ignore = "until the laboratory hides ID"]
fn ID_is_found() {
    let lab = lab(901);
    let hidden = Hidden::random("ID", 1.0, &lab, 1).unwrap();
    only_cause(&diagnose(&lab, &[hidden]), "ID");
}
"#;

const LEFT: &str = r#"What is left:
1. crates/diagnose/src/effects/ID.rs: the physics in place of a level, and every TODO.
2. crates/testkit/src/laboratory/hidden.rs: a variant `Hidden::TYPE` that hides it by other physics, written without a look at the
   fit; its name in `name` and `CATALOGUE`, its size in typical.rs, its range and what it changes of the truth in at_work.rs.
3. The test in hidden_effects.rs: the `ignore` goes, the parameter must hold the truth; a room without it must not name it.
4. docs/glossary.md: the row; CHANGELOG.md: a line.
docs/how-to/own-effect.md says what must hold.
"#;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_follow_from_the_identifier() {
        let names = Names::new("lost_channel2").unwrap();
        assert_eq!((names.type_name.as_str(), names.title.as_str()), ("LostChannel2", "Lost channel2"));
        for bad in ["", "Lost", "lost-channel", "_lost", "lost__channel", "2lost", "lost channel"] {
            assert!(Names::new(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn no_placeholder_is_left_in_the_texts() {
        let names = Names::new("lost_channel").unwrap();
        for text in [effect(&names), test(&names), row(&names), what_is_left(&names)] {
            assert!(!text.contains("TYPE") && !text.contains("TITLE") && !text.contains("ID"), "{text}");
            assert!(text.contains("lost_channel"));
        }
    }
}
