//! What a diagnosis says.

use crate::extend::extended_model::ExtendedModel;
use crate::found_parameter::FoundParameter;
use crate::report::compared_values::ComparedValue;
use sabine_acoustics::{Bands, PerBand};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The answer in one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Verdict {
    /// The simulation explains the measurement within its expected spread.
    Adequate,
    /// One or more causes are named, and what they leave is no more than chance leaves; or it may be the sound that a named surface adds, without
    /// which decays are predicted (a note says so).
    Explained,
    /// One or more causes are named, and chance does not explain what they leave: something else acts as well, or in the place of one of them.
    Incomplete,
    /// Causes are named that nothing confirms: one place was measured, and what bears on decays everywhere is confirmed at positions left out.
    Unconfirmed,
    /// A law that no catalogue lists is named, by itself or beside causes that are listed; see [`Diagnosis::laws`].
    Law,
    /// Several causes explain the misfit alike; see [`Diagnosis::alternatives`] and [`Diagnosis::would_decide`].
    Ambiguous,
    /// Something is wrong that no effect of the catalogue explains.
    Unexplained,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Adequate => "adequate",
            Self::Explained => "explained",
            Self::Incomplete => "incomplete",
            Self::Unconfirmed => "unconfirmed",
            Self::Law => "law",
            Self::Ambiguous => "ambiguous",
            Self::Unexplained => "unexplained",
        })
    }
}

/// Whether chance explains what is left.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LackOfFit {
    /// Probability of a misfit at least as large by chance, under the baseline, from simulated measurements.
    pub p_value: f64,
    /// The same once the named causes are at work.
    pub p_value_explained: f64,
    /// Evidence for a smooth unnamed discrepancy beside the baseline, in nats.
    pub discrepancy_nats: f64,
    /// The same beside the named causes.
    pub discrepancy_nats_explained: f64,
    /// Variance of the compared bins over that expected, by octave, under the named causes (1: chance alone).
    pub dispersion: Vec<f64>,
    /// How far single responses drift from the simulation along their decay, each in its own way, by octave: standard deviation of the
    /// slowest change, in dB. Above 0 where sound keeps its phase (flutter between parallel walls, few modes): no cause explains it.
    #[serde(default)]
    pub drift_sd_db: Vec<f64>,
    /// The tests behind the probability under the named causes, which is the smallest of theirs times their number.
    #[serde(default)]
    pub tests: Vec<FitTest>,
}

/// One way in which the fit may lack.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FitTest {
    /// What was tested, in words.
    pub name: String,
    /// Where it stands out most, if that can be said: a response, a material, an octave.
    #[serde(default)]
    pub subject: Option<String>,
    /// Probability of as much by chance, corrected for the places looked at, not for the number of tests.
    pub p_value: f64,
}

/// What is gained at positions that the fit has not seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct HeldOutGain {
    /// Mean gain of the logarithm of the predictive density, per compared bin.
    pub nats_per_bin: f64,
    /// Ends of the 90 % interval of the mean over positions (Student's t over groups that were left out together), per compared bin. One
    /// position has none: its ends are infinite, and null in JSON.
    #[serde(deserialize_with = "infinite_ends::low")]
    pub low: f64,
    /// Upper end.
    #[serde(deserialize_with = "infinite_ends::high")]
    pub high: f64,
    /// Root mean square error of the decay curves at held-out positions without the cause, in dB; not a number (null in JSON) where tables of
    /// parameters are compared.
    #[serde(deserialize_with = "or_null::number")]
    pub db_rmse_before: f64,
    /// The same with it.
    #[serde(deserialize_with = "or_null::number")]
    pub db_rmse_after: f64,
    /// Root mean square error of the values of tables at held-out positions, in just-noticeable differences, without the cause and with it.
    #[serde(default)]
    pub values_jnd: Option<[f64; 2]>,
    /// Whether every group of positions that was left out gains: one that gains far more than the others takes the interval below zero.
    #[serde(default)]
    pub in_every_group: bool,
}

/// Nor has it what is not a number.
mod or_null {
    use serde::{Deserialize, Deserializer};

    pub fn number<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
    }

    pub fn numbers<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 3], D::Error> {
        let found: [Option<f64>; 3] = Deserialize::deserialize(from)?;
        Ok(found.map(|x| x.unwrap_or(f64::NAN)))
    }
}

/// JSON has no infinity: an end that is null is infinite.
mod infinite_ends {
    use serde::{Deserialize, Deserializer};

    pub fn low<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(from)?.unwrap_or(f64::NEG_INFINITY))
    }

    pub fn high<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(from)?.unwrap_or(f64::INFINITY))
    }

    pub fn intervals<'de, D: Deserializer<'de>>(from: D) -> Result<[[f64; 2]; 2], D::Error> {
        let ends: [[Option<f64>; 2]; 2] = Deserialize::deserialize(from)?;
        Ok(ends.map(|[low, high]| [low.unwrap_or(f64::NEG_INFINITY), high.unwrap_or(f64::INFINITY)]))
    }
}

/// Evidence for a cause with fewer rays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RayDependence {
    /// Evidence of the decays alone beside the other causes that bear on them, in nats.
    pub decay_nats: f64,
    /// The same with a quarter of the rays, once for each quarter.
    pub decay_nats_of_quarters: Vec<f64>,
    /// Evidence that rays drawn again would not confirm, in nats, 0 or more: by what the quarters say more, or by their scatter.
    pub owed_nats: f64,
}

/// A named cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Cause {
    /// Identifier in the catalogue.
    pub effect: String,
    /// What it concerns (a receiver, a material ...), where the effect has several cases.
    pub subject: Option<String>,
    /// What it may concern as well: subjects whose evidence came within 3 nats of this one's when it was named, and that add nothing beside
    /// it.
    #[serde(default)]
    pub other_subjects: Vec<String>,
    /// One sentence for people.
    pub explanation: String,
    /// Posterior probability against its absence and all other effects, when it was named; of a cause of the model that the diagnosis started
    /// from, against its absence alone.
    pub probability: f64,
    /// Evidence for it beside the other causes, in nats, before correction for the number tried.
    pub nats: f64,
    /// What its evidence owes to the rays that were drawn. `None` where it does not bear on decays, or nothing is drawn.
    #[serde(default)]
    pub rays: Option<RayDependence>,
    /// Its parameters.
    pub parameters: Vec<FoundParameter>,
    /// What it gains; `None` where no position could be held out.
    pub held_out_gain: Option<HeldOutGain>,
    /// It bears on energies alone, brings decays at positions that were left out nearer by less than 3 % and 1 dB, and makes a hundred bins
    /// there more probable by less than one nat: what the data resolve, and no ear.
    #[serde(default)]
    pub slight: bool,
}

/// A law that was searched for, found, and tried at positions that had no say in its choice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FoundLaw {
    /// Identifier, as in the extended model.
    pub id: String,
    /// What it acts on: `path`, `reflection` or `recorder`.
    pub target: String,
    /// The material, for a law of reflections.
    #[serde(default)]
    pub surface: Option<String>,
    /// The formula as it is rendered, in dB.
    pub formula: String,
    /// The same in words.
    pub words: String,
    /// Parameters of the formula; ends are those of 90 % intervals, and the value itself where it was not fitted.
    pub parameters: Vec<FoundParameter>,
    /// Evidence for it beside the other causes, its parameters integrated out, in nats.
    pub evidence_nats: f64,
    /// What it pays for being one formula of many, in nats: minus the logarithm of its probability beforehand.
    pub prior_nats: f64,
    /// Probability that the best of all formulas does as well, by simulation, where no law acts.
    pub family_p: f64,
    /// Logarithm of how much more probable it makes the responses of the vault, predicted from all others, in nats; `None` without a vault.
    pub vault_gain_nats: Option<f64>,
    /// By how much it leads the best sham, in nats; `None` where there is none.
    #[serde(default)]
    pub sham_nats: Option<f64>,
    /// Formulas that do as well here, the best first, 20 at most: within 3 nats, or the same in the bins that were measured.
    #[serde(default)]
    pub not_told_from: Vec<String>,
    /// What is left without it, against its covariate.
    #[serde(default)]
    pub points: Vec<LawPoint>,
}

/// The mean over bins of like values of what a law goes with, in the octaves in which it is at least half as strong as at its strongest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LawPoint {
    /// What the law goes with: the mean over the paths of the bins, by energy; over all their meetings, for a law of reflections; seconds
    /// since the emission, where a gain swells and sinks along the recording.
    pub covariate: f64,
    /// Measured over predicted energy in dB, the law left out and all else as fitted beside it.
    pub left_db: f64,
    /// Half the width of its 90 % interval, in dB.
    pub half_width_db: f64,
    /// What the law says, in dB.
    pub law_db: f64,
    /// Whether the bins are of receivers that no fit has seen.
    pub vault: bool,
}

/// The search for a law that no catalogue lists.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LawSearch {
    /// Receivers, by name, that no fit of the search saw; none where fewer than six are measured.
    pub vault: Vec<String>,
    /// Laws that were chosen and did not stand, and why.
    pub fallen: Vec<FallenLaw>,
    /// What the positions of the search would have shown, where no law stands; the most visible first.
    #[serde(default)]
    pub visible: Vec<VisibleLaw>,
}

/// How strong a law would have to be to be found at these positions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct VisibleLaw {
    /// What it would go with, in words.
    pub goes_with: String,
    /// Its amplitude, the same in all octaves, at which it would move the decays by ten standard deviations once everything is taken out that a
    /// diagnosis leaves open (d' of 10: weaker ones are found less often), in dB where the quantity is 1. `None` beyond 100 dB: these positions
    /// do not show it.
    pub from_db: Option<f64>,
}

/// A law that was chosen and did not stand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FallenLaw {
    /// What decays seemed to go with, in words.
    pub goes_with: String,
    /// Why it is not named, in words.
    pub reason: String,
}

/// How much speaks for one effect of the catalogue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct CandidateScore {
    /// Identifier.
    pub effect: String,
    /// Its best case.
    pub subject: Option<String>,
    /// Evidence beside the baseline, corrected for the number of its cases, in nats.
    pub nats: f64,
    /// Size found beside the baseline in units of its standard deviation, materials and everything else left free (d').
    pub d_prime: f64,
    /// The same beside all named causes; `None` for those.
    pub nats_beside_causes: Option<f64>,
}

/// Whether these positions can tell two effects apart, known before the residuals are looked at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Isolability {
    /// Identifiers of the two.
    pub effects: [String; 2],
    /// Cosine of the angle between their signatures once what is refitted has been projected out: 1 for twins, 0 for strangers.
    pub cosine: f64,
    /// Whether they can be told apart (cosine below 0.95).
    pub separable: bool,
    /// The measurement that would tell them apart.
    pub would_decide: String,
}

/// A material after the fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FittedMaterial {
    /// Absorption that the room file states (or the stand-in for an unknown one).
    pub stated: Vec<f64>,
    /// Fitted under the baseline.
    pub absorption_before: Vec<f64>,
    /// Fitted beside the named causes.
    pub absorption: Vec<f64>,
    /// Its standard deviation.
    pub absorption_sd: Vec<f64>,
}

/// Prediction of positions that were not fitted: baseline, named causes, and the free discrepancy side by side.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct HeldOut {
    /// Receivers, each predicted from the others.
    pub receivers: Vec<String>,
    /// True if they were named by the user and never fitted; else each was left out in turn.
    pub never_fitted: bool,
    /// Root mean square error of decay curves in dB: baseline refitted, named causes, free discrepancy. Not numbers (null in JSON) where no
    /// decay is compared; nor are the next two where none of their kind can be read.
    #[serde(deserialize_with = "or_null::numbers")]
    pub db_rmse: [f64; 3],
    /// Mean error of T20 in just-noticeable differences (5 %), likewise.
    #[serde(deserialize_with = "or_null::numbers")]
    pub t20_jnd: [f64; 3],
    /// Mean error of C50 in just-noticeable differences (1 dB), likewise.
    #[serde(deserialize_with = "or_null::numbers")]
    pub c50_jnd: [f64; 3],
    /// Root mean square error of the values of tables in just-noticeable differences, likewise, where tables of parameters are compared.
    #[serde(default)]
    pub values_jnd: Option<[f64; 3]>,
    /// Gain of the logarithm of the predictive density over the baseline, per compared bin: named causes, free discrepancy.
    pub nats_per_bin: [f64; 2],
    /// 90 % intervals of these (Student's t over groups of positions that were left out together); infinite, and null in JSON, for one
    /// position.
    #[serde(deserialize_with = "infinite_ends::intervals")]
    pub nats_interval: [[f64; 2]; 2],
}

/// Mean residual of one octave at one time, for a map of where it is wrong.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ResidualCell {
    /// Response, by name; `None` for the mean over all.
    pub response: Option<String>,
    /// Nominal octave centre.
    pub band_hz: f64,
    /// Middle of the bin, in seconds after the direct sound.
    pub time_s: f64,
    /// Measured over predicted energy in dB, under the baseline.
    pub before_db: f64,
    /// The same under the named causes.
    pub after_db: f64,
    /// Expected spread in dB.
    pub expected_sd_db: f64,
}

/// Decay curves of one octave of one response.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct DecayCurves {
    /// Response, by name.
    pub response: String,
    /// Nominal octave centre.
    pub band_hz: f64,
    /// Seconds after the direct sound, at the beginnings of the bins.
    pub time_s: Vec<f64>,
    /// Measured energy that is still to come, in dB re its total.
    pub measured_db: Vec<f64>,
    /// The same as predicted before; the level is relative to the measured total.
    pub before_db: Vec<f64>,
    /// The same as predicted after.
    pub after_db: Vec<f64>,
    /// Whether this response was predicted from others alone.
    pub held_out: bool,
}

/// A predicted reflection that named causes bring to a peak of a response to which none comes without them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct MovedReflection {
    /// The response that shows the peak.
    pub response: String,
    /// Number of surfaces that it is known to meet.
    pub order: usize,
    /// Where it runs as found: source, places of reflection, receiver, in metres; empty where that is not known.
    pub stops_m: Vec<[f64; 3]>,
    /// When it comes in the file without the causes, in ms.
    pub stated_ms: f64,
    /// The same under the causes.
    pub found_ms: f64,
    /// The peak.
    pub measured_ms: f64,
}

/// What is wrong, why, and what mending it gains.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Diagnosis {
    /// The answer in one word.
    pub verdict: Verdict,
    /// Whether chance explains the misfit.
    pub lack_of_fit: LackOfFit,
    /// Selection causes, in the order in which they were found. For [`Verdict::Ambiguous`] the last one stands for the set.
    pub causes: Vec<Cause>,
    /// Laws among the causes that no catalogue lists, in the same order.
    pub laws: Vec<FoundLaw>,
    /// What became of the search for such laws, where there was one.
    pub law_search: Option<LawSearch>,
    /// Effects that explain as much as the last cause: the set of which one is at work.
    pub alternatives: Vec<String>,
    /// Measurements that would decide, in plain words.
    pub would_decide: Vec<String>,
    /// Every effect of the catalogue, the strongest first.
    pub candidates: Vec<CandidateScore>,
    /// Which effects these positions can tell apart.
    pub isolability: Vec<Isolability>,
    /// Materials, by name, in the order of the scene.
    pub materials: Vec<(String, FittedMaterial)>,
    /// Prediction of positions not seen; `None` with fewer than two receivers.
    pub held_out: Option<HeldOut>,
    /// Octaves of everything by band.
    pub bands: Bands,
    /// Where it is wrong.
    pub residuals: Vec<ResidualCell>,
    /// Decay curves at held-out positions, or at all where none could be held out.
    pub decays: Vec<DecayCurves>,
    /// Values of tables of parameters, where these take the place of responses: at held-out positions, or at all where none could be held out.
    pub values: Vec<ComparedValue>,
    /// Reflections that causes of arrival times bring to peaks, the farthest moved first.
    pub moved_reflections: Vec<MovedReflection>,
    /// Gain of the recording over the simulation, in dB, where the room file leaves it open.
    pub common_gain_db: Option<f64>,
    /// What must be said besides.
    pub notes: Vec<String>,
    /// The model with the named causes at work.
    pub model: ExtendedModel,
    /// Seconds spent, by stage; `waves` are part of other stages.
    pub seconds: Vec<(String, f64)>,
}

impl FittedMaterial {
    /// The fitted absorption in its bands.
    pub fn per_band(&self, bands: Bands) -> PerBand<f64> {
        PerBand::from_fn(bands, |b| self.absorption[b])
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;

    #[test]
    fn intervals_of_one_position_come_back_from_json() {
        let (low, high) = (f64::NEG_INFINITY, f64::INFINITY);
        let gain = HeldOutGain {
            nats_per_bin: 0.1,
            low,
            high,
            db_rmse_before: 1.0,
            db_rmse_after: 0.5,
            values_jnd: None,
            in_every_group: true,
        };
        let text = serde_json::to_string(&gain).unwrap();
        assert!(text.contains("\"low\":null"), "{text}");
        assert_eq!(serde_json::from_str::<HeldOutGain>(&text).unwrap(), gain);
        let held = HeldOut {
            receivers: vec!["r1".to_owned()],
            never_fitted: true,
            db_rmse: [1.0, 0.5, 0.6],
            t20_jnd: [1.0, 0.5, 0.6],
            values_jnd: None,
            c50_jnd: [1.0, 0.5, 0.6],
            nats_per_bin: [0.1, 0.2],
            nats_interval: [[low, high], [0.1, 0.3]],
        };
        let text = serde_json::to_string(&held).unwrap();
        assert_eq!(serde_json::from_str::<HeldOut>(&text).unwrap(), held);
    }
}
