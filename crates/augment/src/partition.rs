//! Who may be heard where: rooms and speakers are dealt out before anything else happens.

use crate::error::{Error, check};
use crate::seed::{derive, generator};
use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// One of the three parts of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Partition {
    /// What the network is fitted to.
    Train,
    /// What decides when to stop.
    Validation,
    /// What is looked at once.
    Test,
}

impl Partition {
    /// All three, in order.
    pub const ALL: [Self; 3] = [Self::Train, Self::Validation, Self::Test];

    /// The name in file names and manifests.
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Validation => "validation",
            Self::Test => "test",
        }
    }
}

impl fmt::Display for Partition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// How names (of rooms, of speakers) are dealt out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartitionConfig {
    /// Names that belong to the validation partition.
    pub validation: Vec<String>,
    /// Names that belong to the test partition.
    pub test: Vec<String>,
    /// Share of the names for validation, 0 to 0.8, where [`PartitionConfig::validation`] is empty. At least one name.
    pub validation_share: f64,
    /// Share of the names for test, 0 to 0.8, where [`PartitionConfig::test`] is empty. At least one name.
    pub test_share: f64,
}

impl Default for PartitionConfig {
    fn default() -> Self {
        Self { validation: Vec::new(), test: Vec::new(), validation_share: 0.15, test_share: 0.15 }
    }
}

impl PartitionConfig {
    /// Deals out names. Named ones go where they are named; if a partition is not named, it gets its share at random, by
    /// the seed; all others train.
    ///
    /// # Errors
    /// [`Error::Leak`] for a name in two partitions, [`Error::Unknown`] for a name that is not among `names`,
    /// [`Error::TooFew`] where a partition would be empty: one speaker cannot be partitioned.
    pub fn deal(
        &self,
        what: &'static str,
        purpose: &'static str,
        names: &[String],
        seed: u64,
    ) -> Result<BTreeMap<String, Partition>, Error> {
        check("validation_share", self.validation_share, 0.0, 0.8, "between 0 and 0.8")?;
        check("test_share", self.test_share, 0.0, 0.8, "between 0 and 0.8")?;
        let mut dealt: BTreeMap<String, Partition> = BTreeMap::new();
        for (list, partition) in [(&self.validation, Partition::Validation), (&self.test, Partition::Test)] {
            for name in list {
                if !names.contains(name) {
                    return Err(Error::Unknown { what, name: name.clone(), partition });
                }
                match dealt.insert(name.clone(), partition) {
                    Some(first) if first != partition => {
                        return Err(Error::Leak { what, name: name.clone(), first, second: partition });
                    }
                    _ => {}
                }
            }
        }
        let mut free: Vec<&String> = names.iter().filter(|n| !dealt.contains_key(*n)).collect();
        free.sort();
        free.dedup();
        let known = free.len() + dealt.len();
        free.shuffle(&mut generator(derive(seed, 0x5eed)));
        let mut free = free.into_iter();
        for (list, share, partition) in [
            (&self.test, self.test_share, Partition::Test),
            (&self.validation, self.validation_share, Partition::Validation),
        ] {
            if list.is_empty() {
                let count = ((share * known as f64).round() as usize).max(1);
                dealt.extend(free.by_ref().take(count).map(|name| (name.clone(), partition)));
            }
        }
        dealt.extend(free.map(|name| (name.clone(), Partition::Train)));
        for partition in Partition::ALL {
            if !dealt.values().any(|&p| p == partition) {
                return Err(Error::TooFew { what: plural(what), purpose, needed: 3, found: known });
            }
        }
        Ok(dealt)
    }
}

/// What is dealt out, as a sentence about several of them has it.
fn plural(what: &'static str) -> &'static str {
    match what {
        "speaker" => "speakers",
        "room" => "rooms",
        "traced room" => "traced rooms",
        "noise" => "noise files",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(n: usize) -> Vec<String> {
        (0..n).map(|i| format!("n{i:03}")).collect()
    }

    #[test]
    fn everyone_is_dealt_once_and_the_shares_hold() {
        let dealt = PartitionConfig::default().deal("speaker", "three partitions", &names(100), 1).unwrap();
        let count = |p| dealt.values().filter(|&&q| q == p).count();
        assert_eq!(
            (count(Partition::Train), count(Partition::Validation), count(Partition::Test)),
            (70, 15, 15)
        );
        assert_eq!(
            dealt,
            PartitionConfig::default().deal("speaker", "three partitions", &names(100), 1).unwrap()
        );
        assert_ne!(
            dealt,
            PartitionConfig::default().deal("speaker", "three partitions", &names(100), 2).unwrap()
        );
    }

    #[test]
    fn a_name_in_two_partitions_is_a_leak() {
        let config = PartitionConfig {
            validation: vec!["n001".into()],
            test: vec!["n001".into()],
            ..PartitionConfig::default()
        };
        let refused = config.deal("room", "three partitions", &names(9), 1);
        assert!(matches!(refused, Err(Error::Leak { what: "room", .. })), "{refused:?}");
    }

    #[test]
    fn one_speaker_cannot_be_partitioned() {
        let refused = PartitionConfig::default().deal("speaker", "three partitions", &names(1), 1);
        assert!(matches!(refused, Err(Error::TooFew { needed: 3, found: 1, .. })), "{refused:?}");
    }

    #[test]
    fn an_unknown_name_is_refused() {
        let config = PartitionConfig { test: vec!["elsewhere".into()], ..PartitionConfig::default() };
        assert!(matches!(config.deal("room", "p", &names(9), 1), Err(Error::Unknown { .. })));
    }
}
