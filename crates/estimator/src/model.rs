//! Everything that an estimator needs to know, in one file.

use crate::checksum::{FIELD, seal, verify};
use crate::combination::Combination;
use crate::config::NetworkConfig;
use crate::detectors::Detectors;
use crate::labels::{LABEL_COUNT, LabelScale, T60_COUNT, T60Scale};
use crate::layout::{FeatureLayout, Normalisation};
use crate::parameters::Parameters;
use crate::{Error, WeightsFault};
use half::f16;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};

/// Name and version of the format.
const FORMAT: &str = "sabine-estimator-2";

/// How far the estimates can be trusted, learned on rooms that the training did not see.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Factor on the standard deviation of each label, on the network's scale: of the learned deviation where the network
    /// gives one, else the deviation itself.
    pub deviation: Vec<f64>,
    /// Correlation, label by label, of the errors of different windows of one recording, 0..=1: with 1, many windows are no
    /// surer than one. Training leaves 1; [`Estimator::calibrated`](crate::Estimator::calibrated) measures it.
    pub window_correlation: Vec<f64>,
    /// Range of each reverberation time that was trained on, in seconds: 1st and 99th percentile.
    pub t60_range_s: Vec<[f64; 2]>,
    /// Mean of each long-term statistic (mean and deviation over time of each normalised mel band) over the training set.
    pub statistic_mean: Vec<f64>,
    /// Standard deviation of each.
    pub statistic_deviation: Vec<f64>,
    /// Root-mean-square of the standardised statistics above which a window counts as unlike anything trained on: 99.5th
    /// percentile over validation windows.
    pub novelty_limit: f64,
}

/// A network with all that belongs to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Features.
    pub layout: FeatureLayout,
    /// Their normalisation.
    pub normalisation: Normalisation,
    /// Scale of the labels.
    pub labels: LabelScale,
    /// Trust.
    pub calibration: Calibration,
    /// How recordings of one room are joined; files without it are read, too.
    pub combination: Option<Combination>,
    /// What hears music, noise and the like; files without it are read, too.
    pub detectors: Option<Detectors>,
    /// The network's numbers; it has 13 outputs, or 26 if it learned the logarithm of its own variance as well.
    pub parameters: Parameters,
}

/// The part of a model that is no array.
#[derive(Serialize, Deserialize)]
struct Header {
    format: String,
    layout: FeatureLayout,
    network: NetworkConfig,
    t60: T60Scale,
    remove_level: bool,
    novelty_limit: f64,
}

impl Model {
    /// Whether the network gives the logarithm of its variance.
    pub fn learned_variance(&self) -> bool {
        self.parameters.config().outputs == 2 * LABEL_COUNT
    }

    /// Writes the model as safetensors with a checksum (SHA-256 over header, names and tensors); network weights in half
    /// precision if `half`.
    ///
    /// # Errors
    /// [`Error::Weights`] if a number is not finite or the container cannot be made.
    pub fn to_safetensors(&self, half: bool) -> Result<Vec<u8>, Error> {
        let fault = |fault| Error::Weights { name: "to be written".into(), fault: Box::new(fault) };
        let header = Header {
            format: FORMAT.into(),
            layout: self.layout.clone(),
            network: self.parameters.config().clone(),
            t60: self.labels.t60,
            remove_level: self.normalisation.remove_level,
            novelty_limit: self.calibration.novelty_limit,
        };
        let header =
            serde_json::to_string(&header).map_err(|_| fault(WeightsFault::Metadata { field: FIELD }))?;
        let mut arrays: Vec<(String, Vec<usize>, Dtype, Vec<u8>)> = Vec::new();
        for (name, shape) in self.parameters.config().parameter_shapes()? {
            let values = self.parameters.tensor(&name);
            // The running moments keep their precision.
            let (dtype, bytes) = if half && name.ends_with(".weight") {
                (Dtype::F16, values.iter().flat_map(|v| f16::from_f32(*v).to_le_bytes()).collect())
            } else {
                (Dtype::F32, values.iter().flat_map(|v| v.to_le_bytes()).collect())
            };
            arrays.push((format!("network.{name}"), shape, dtype, bytes));
        }
        let mut vectors = self.vectors();
        vectors.extend(self.combination.iter().flat_map(|c| c.parts().map(|(name, _, v)| (name, v.clone()))));
        vectors.extend(self.detectors.iter().flat_map(|d| d.parts().map(|(name, v)| (name, v.clone()))));
        for (name, values) in vectors {
            let bytes = values.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect();
            arrays.push((name.into(), vec![values.len()], Dtype::F32, bytes));
        }
        let views = arrays
            .iter()
            .map(|(name, shape, dtype, bytes)| {
                Ok((name.clone(), TensorView::new(*dtype, shape.clone(), bytes)?))
            })
            .collect::<Result<Vec<_>, _>>()
            .map_err(|source| fault(WeightsFault::Container { source }))?;
        let metadata = HashMap::from([(FIELD.to_owned(), seal(&header, &views))]);
        safetensors::serialize(views, Some(metadata))
            .map_err(|source| fault(WeightsFault::Container { source }))
    }

    fn vectors(&self) -> Vec<(&'static str, Vec<f64>)> {
        let wide = |values: &[f32]| values.iter().map(|v| f64::from(*v)).collect();
        let range = |end: usize| self.calibration.t60_range_s.iter().map(|range| range[end]).collect();
        vec![
            ("normalisation.mean_db", wide(&self.normalisation.mean_db)),
            ("normalisation.deviation_db", wide(&self.normalisation.deviation_db)),
            ("labels.mean", self.labels.mean.clone()),
            ("labels.deviation", self.labels.deviation.clone()),
            ("calibration.deviation", self.calibration.deviation.clone()),
            ("calibration.window_correlation", self.calibration.window_correlation.clone()),
            ("calibration.t60_low_s", range(0)),
            ("calibration.t60_high_s", range(1)),
            ("calibration.statistic_mean", self.calibration.statistic_mean.clone()),
            ("calibration.statistic_deviation", self.calibration.statistic_deviation.clone()),
        ]
    }

    /// Reads a model and checks every part of it. `name` says in errors where the bytes came from.
    ///
    /// # Errors
    /// [`Error::Weights`] with the reason: truncated, without a checksum or with one that does not fit, of another layout, a tensor missing or of another shape, NaN, ...
    pub fn from_safetensors(name: &str, bytes: &[u8]) -> Result<Self, Error> {
        Self::read(bytes).map_err(|fault| match fault {
            ReadFault::Weights(fault) => Error::Weights { name: name.into(), fault: Box::new(fault) },
            ReadFault::Other(error) => error,
        })
    }

    fn read(bytes: &[u8]) -> Result<Self, ReadFault> {
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(WeightsFault::from)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(WeightsFault::from)?;
        let missing = || WeightsFault::Metadata { field: FIELD };
        let text = metadata.metadata().as_ref().and_then(|fields| fields.get(FIELD)).ok_or_else(missing)?;
        let header: Header = serde_json::from_str(text).map_err(|_| missing())?;
        check_layout("format", &header.format, &FORMAT.to_owned())?;
        verify(text, &tensors)?;
        let network = header.network;
        network.check().map_err(ReadFault::Other)?;
        check_layout("network.mels", &network.mels, &header.layout.mels)?;
        check_layout("network.frames", &network.frames, &header.layout.frames)?;
        if network.outputs != LABEL_COUNT {
            check_layout("network.outputs", &network.outputs, &(2 * LABEL_COUNT))?;
        }
        let mut arrays = BTreeMap::new();
        for (name, shape) in network.parameter_shapes().map_err(ReadFault::Other)? {
            let values = floats(&tensors, &format!("network.{name}"), &shape)?;
            arrays.insert(name, values);
        }
        let vector = |name: &str, count: usize| floats(&tensors, name, &[count]);
        let wide = |name: &str, count: usize| -> Result<Vec<f64>, WeightsFault> {
            Ok(vector(name, count)?.into_iter().map(f64::from).collect())
        };
        let positive = |name: &'static str, values: Vec<f64>| match values.iter().find(|v| **v <= 0.0) {
            Some(value) => Err(WeightsFault::Layout {
                field: name,
                found: value.to_string(),
                expected: "a positive number".into(),
            }),
            None => Ok(values),
        };
        let mels = header.layout.mels;
        let deviation_db = positive("normalisation.deviation_db", wide("normalisation.deviation_db", mels)?)?;
        let low = wide("calibration.t60_low_s", T60_COUNT)?;
        let high = wide("calibration.t60_high_s", T60_COUNT)?;
        let novelty_limit = header.novelty_limit;
        if !novelty_limit.is_finite() || novelty_limit < 0.0 {
            return Err(ReadFault::Weights(WeightsFault::Metadata { field: "novelty_limit" }));
        }
        let window_correlation = wide("calibration.window_correlation", LABEL_COUNT)?;
        if let Some(value) = window_correlation.iter().find(|v| !(0.0..=1.0).contains(*v)) {
            return Err(ReadFault::Weights(WeightsFault::Layout {
                field: "calibration.window_correlation",
                found: value.to_string(),
                expected: "0 to 1".into(),
            }));
        }
        // A file has all of a part or nothing of it.
        let has = |beginning: &str| tensors.names().iter().any(|name| name.starts_with(beginning));
        let combination = has("combination.").then(|| Combination::read(wide)).transpose()?;
        let detectors = has("detectors.").then(|| Detectors::read(wide)).transpose()?;
        Ok(Self {
            combination,
            detectors,
            normalisation: Normalisation {
                mean_db: vector("normalisation.mean_db", mels)?,
                deviation_db: deviation_db.into_iter().map(|v| v as f32).collect(),
                remove_level: header.remove_level,
            },
            labels: LabelScale {
                t60: header.t60,
                mean: wide("labels.mean", LABEL_COUNT)?,
                deviation: positive("labels.deviation", wide("labels.deviation", LABEL_COUNT)?)?,
            },
            calibration: Calibration {
                deviation: positive("calibration.deviation", wide("calibration.deviation", LABEL_COUNT)?)?,
                window_correlation,
                t60_range_s: low.into_iter().zip(high).map(|(low, high)| [low, high]).collect(),
                statistic_mean: wide("calibration.statistic_mean", 2 * mels)?,
                statistic_deviation: positive(
                    "calibration.statistic_deviation",
                    wide("calibration.statistic_deviation", 2 * mels)?,
                )?,
                novelty_limit,
            },
            parameters: Parameters::new(network, arrays).map_err(ReadFault::Other)?,
            layout: header.layout,
        })
    }
}

enum ReadFault {
    Weights(WeightsFault),
    Other(Error),
}

impl From<WeightsFault> for ReadFault {
    fn from(fault: WeightsFault) -> Self {
        Self::Weights(fault)
    }
}

fn check_layout<T: PartialEq + std::fmt::Display>(
    field: &'static str,
    found: &T,
    expected: &T,
) -> Result<(), WeightsFault> {
    if found == expected {
        return Ok(());
    }
    Err(WeightsFault::Layout { field, found: found.to_string(), expected: expected.to_string() })
}

/// The finite floats of a tensor of this shape.
fn floats(tensors: &SafeTensors<'_>, name: &str, shape: &[usize]) -> Result<Vec<f32>, WeightsFault> {
    let Ok(tensor) = tensors.tensor(name) else {
        return Err(WeightsFault::Missing { tensor: name.into() });
    };
    let bytes = tensor.data();
    let values: Vec<f32> = match tensor.dtype() {
        Dtype::F32 if tensor.shape() == shape => {
            bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
        }
        Dtype::F16 if tensor.shape() == shape => {
            bytes.chunks_exact(2).map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32()).collect()
        }
        other => {
            return Err(WeightsFault::Shape {
                tensor: name.into(),
                found_type: format!("{other:?}"),
                found: tensor.shape().to_vec(),
                expected: shape.to_vec(),
            });
        }
    };
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(WeightsFault::NotFinite { tensor: name.into(), index }),
        None => Ok(values),
    }
}
