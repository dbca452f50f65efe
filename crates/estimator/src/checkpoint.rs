//! The state of a training after an epoch.

use crate::adam::Adam;
use crate::checksum::{seal, verify};
use crate::config::NetworkConfig;
use crate::parameters::Parameters;
use crate::train_config::{EpochRecord, TrainConfig};
use crate::{Error, WeightsFault};
use sabine_acoustics::write_atomically;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::io::Write;
use std::path::Path;

const FIELD: &str = "sabine-checkpoint-1";

/// Everything that the next epoch depends on.
#[derive(Clone, Debug)]
pub(crate) struct Checkpoint {
    pub parameters: Parameters,
    /// Those of the best epoch so far.
    pub best: Parameters,
    pub best_epoch: usize,
    pub adam: Adam,
    pub history: Vec<EpochRecord>,
}

#[derive(Serialize, Deserialize)]
struct Header {
    config: TrainConfig,
    best_epoch: usize,
    step: u64,
    history: Vec<EpochRecord>,
}

impl Checkpoint {
    /// The beginning of a training.
    pub fn start(config: &TrainConfig) -> Result<Self, Error> {
        let parameters = Parameters::random(&config.network, config.seed)?;
        Ok(Self {
            best: parameters.clone(),
            parameters,
            best_epoch: 0,
            adam: Adam::default(),
            history: Vec::new(),
        })
    }

    /// Writes to a temporary name and renames, so that there is always a whole checkpoint.
    pub fn write(&self, path: &Path, config: &TrainConfig) -> Result<(), Error> {
        let fault = |fault| Error::Weights { name: path.display().to_string(), fault: Box::new(fault) };
        let mut arrays: Vec<(String, Vec<u8>)> = Vec::new();
        let mut push = |kind: &str, name: &str, values: &[f32]| {
            arrays.push((format!("{kind}.{name}"), values.iter().flat_map(|v| v.to_le_bytes()).collect()));
        };
        for (name, values) in self.parameters.tensors() {
            push("last", name, values);
        }
        for (name, values) in self.best.tensors() {
            push("best", name, values);
        }
        for (name, (first, second)) in &self.adam.moments {
            push("first", name, first);
            push("second", name, second);
        }
        let header = Header {
            config: config.clone(),
            best_epoch: self.best_epoch,
            step: self.adam.step,
            history: self.history.clone(),
        };
        let header =
            serde_json::to_string(&header).map_err(|_| fault(WeightsFault::Metadata { field: FIELD }))?;
        let views = arrays
            .iter()
            .map(|(name, bytes)| {
                Ok((name.clone(), TensorView::new(Dtype::F32, vec![bytes.len() / 4], bytes)?))
            })
            .collect::<Result<Vec<_>, _>>()
            .map_err(|source| fault(WeightsFault::Container { source }))?;
        let sealed = HashMap::from([(FIELD.to_owned(), seal(&header, &views))]);
        let bytes = safetensors::serialize(views, Some(sealed))
            .map_err(|source| fault(WeightsFault::Container { source }))?;
        Ok(write_atomically(path, |file| file.write_all(&bytes))?)
    }

    /// Reads a checkpoint of the same training.
    pub fn read(path: &Path, config: &TrainConfig) -> Result<Self, Error> {
        let bytes = std::fs::read(path).map_err(Error::io(path))?;
        let fault = |fault| Error::Weights { name: path.display().to_string(), fault: Box::new(fault) };
        let container = |source| fault(WeightsFault::Container { source });
        let (_, metadata) = SafeTensors::read_metadata(&bytes).map_err(container)?;
        let tensors = SafeTensors::deserialize(&bytes).map_err(container)?;
        let missing = || fault(WeightsFault::Metadata { field: FIELD });
        let text = metadata.metadata().as_ref().and_then(|fields| fields.get(FIELD)).ok_or_else(missing)?;
        let header: Header = serde_json::from_str(text).map_err(|_| missing())?;
        verify(text, &tensors).map_err(fault)?;
        if let Some(field) = difference(&header.config, config) {
            return Err(Error::Checkpoint { path: path.to_owned(), field });
        }
        let kind = |kind: &str| -> Result<BTreeMap<String, Vec<f32>>, Error> {
            let mut found = BTreeMap::new();
            for (name, tensor) in tensors.iter() {
                if let Some(name) = name.strip_prefix(kind).and_then(|name| name.strip_prefix('.')) {
                    let floats =
                        tensor.data().chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
                    found.insert(name.to_owned(), floats.collect());
                }
            }
            Ok(found)
        };
        let whole = |network: &NetworkConfig, which: &str| Parameters::new(network.clone(), kind(which)?);
        let mut second = kind("second")?;
        let mut moments = BTreeMap::new();
        for (name, first) in kind("first")? {
            let Some(second) = second.remove(&name).filter(|second| second.len() == first.len()) else {
                return Err(fault(WeightsFault::Missing { tensor: format!("second.{name}") }));
            };
            moments.insert(name, (first, second));
        }
        Ok(Self {
            parameters: whole(&config.network, "last")?,
            best: whole(&config.network, "best")?,
            best_epoch: header.best_epoch,
            adam: Adam { step: header.step, moments },
            history: header.history,
        })
    }
}

/// The first setting that differs and matters; patience may change from run to run.
fn difference(a: &TrainConfig, b: &TrainConfig) -> Option<&'static str> {
    [
        ("network", a.network != b.network),
        ("t60", a.t60 != b.t60),
        ("remove_level", a.remove_level != b.remove_level),
        ("loss", a.loss != b.loss),
        ("batch", a.batch != b.batch),
        ("epochs", a.epochs != b.epochs),
        ("learning_rate", a.learning_rate != b.learning_rate),
        ("schedule", a.schedule != b.schedule),
        ("weight_decay", a.weight_decay != b.weight_decay),
        ("perturb", a.perturb != b.perturb),
        ("seed", a.seed != b.seed),
    ]
    .into_iter()
    .find(|(_, differs)| *differs)
    .map(|(field, _)| field)
}
