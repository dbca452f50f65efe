//! Laws as tables of a file.

use crate::laws::error::{LawError, LawFault};
use crate::laws::law::{Law, LawParameter};
use crate::laws::target::LawTarget;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;

/// One `[[laws]]` of a file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    id: String,
    target: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    surface: Option<String>,
    formula: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    words: String,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    parameters: BTreeMap<String, Parameter>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameter {
    value: f64,
    low: f64,
    high: f64,
    unit: String,
}

/// Reads and writes the table that `[[laws]]` is in TOML.
impl Serialize for Law {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let parameter = |(name, p): (&str, &LawParameter)| {
            let table = Parameter { value: p.value, low: p.low, high: p.high, unit: p.unit.clone() };
            (name.to_owned(), table)
        };
        let table = Table {
            id: self.id().to_owned(),
            target: self.target().name().to_owned(),
            surface: self.surface().map(str::to_owned),
            formula: self.formula().to_owned(),
            words: self.words().to_owned(),
            parameters: self.parameters().map(parameter).collect(),
        };
        table.serialize(serializer)
    }
}

/// What is wrong with a law is named with the law and the column of its formula.
impl<'de> Deserialize<'de> for Law {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let table = Table::deserialize(deserializer)?;
        of_table(table).map_err(serde::de::Error::custom)
    }
}

fn of_table(table: Table) -> Result<Law, LawError> {
    let Table { id, target, surface, formula, words, parameters } = table;
    let Some(known) = LawTarget::of_name(&target) else {
        let names: Vec<&str> = LawTarget::ALL.iter().map(|target| target.name()).collect();
        let expected = "one of the targets path, reflection, delay, added and recorder";
        debug_assert!(names.iter().all(|name| expected.contains(name)));
        let found = format!("`{target}`");
        return Err(LawError { law: id, column: None, fault: LawFault::Expected { expected, found } });
    };
    let parameters =
        parameters.into_iter().map(|(name, p)| (name, LawParameter::new(p.value, [p.low, p.high], p.unit)));
    Ok(Law::new(id, known, surface.as_deref(), &formula, parameters)?.with_words(words))
}
