//! Training: from a data set to a calibrated model.

use crate::adam::Adam;
use crate::calibrate::{Score, calibrate, score, shrink};
use crate::checkpoint::Checkpoint;
use crate::dataset::{Dataset, Partition};
use crate::graph::Graph;
use crate::labels::{LABEL_COUNT, LabelScale, T60Scale, label_name};
use crate::layout::{FeatureLayout, Normalisation, mean};
use crate::loss::{Loss, Targets, loss};
use crate::model::{Calibration, Model};
use crate::parameters::Parameters;
use crate::perturb::Perturb;
use crate::train_config::{EpochRecord, TrainConfig};
use crate::{DatasetFault, Error};
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use sabine_acoustics::{Observer, report};
use std::path::{Path, PathBuf};

/// What came of a training.
#[derive(Clone, Debug)]
pub struct Trained {
    /// The best model, calibrated on the validation rooms.
    pub model: Model,
    /// The learning curve.
    pub history: Vec<EpochRecord>,
    /// Epoch of the best model, from 1.
    pub best_epoch: usize,
}

/// Trains networks; holds what does not change from epoch to epoch.
pub struct Trainer<'a> {
    config: TrainConfig,
    dataset: &'a Dataset,
    layout: FeatureLayout,
    normalisation: Normalisation,
    labels: LabelScale,
    folder: Option<PathBuf>,
}

impl<'a> Trainer<'a> {
    /// Checks the settings and the data set, and measures what normalises features and labels. With a folder, a checkpoint
    /// is written there after every epoch.
    ///
    /// # Errors
    /// [`Error::Config`]; [`Error::Dataset`] where rooms are too few or no clip of a partition has a label; [`Error::Io`].
    pub fn new(config: TrainConfig, dataset: &'a Dataset, folder: Option<&Path>) -> Result<Self, Error> {
        let mut config = config;
        config.network.outputs = LABEL_COUNT * if config.loss == Loss::Squared { 1 } else { 2 };
        config.check()?;
        for (partition, needed) in [(Partition::Train, 2), (Partition::Validation, 1)] {
            let found = dataset.room_count(partition);
            if found < needed {
                let fault = DatasetFault::Rooms { partition: partition.name(), found, needed };
                return Err(Error::dataset("data set", fault));
            }
        }
        // Without validation clips that have a label its intervals would not be calibrated, and look as if they were.
        for partition in [Partition::Train, Partition::Validation] {
            let clips = || dataset.partition(partition).iter().map(|&clip| &dataset.clips()[clip]);
            if let Some(label) = (0..LABEL_COUNT).find(|&k| clips().all(|clip| clip.labels[k].is_nan())) {
                let fault = DatasetFault::NoLabels { partition: partition.name(), label: label_name(label) };
                return Err(Error::dataset("data set", fault));
            }
        }
        let labels = label_scale(config.t60, dataset)?;
        let layout = FeatureLayout::default();
        let normalisation = normalisation(config.remove_level, dataset)?;
        Ok(Self { config, dataset, layout, normalisation, labels, folder: folder.map(Path::to_owned) })
    }

    /// The settings, with the outputs that follow from the loss.
    pub fn config(&self) -> &TrainConfig {
        &self.config
    }

    /// Trains from the beginning, or from the checkpoint in the folder if `resume`; the result is the same either way.
    ///
    /// # Errors
    /// [`Error::Diverged`], [`Error::Checkpoint`], [`Error::Io`], or a request of `observer` to stop; the last checkpoint
    /// is kept.
    pub fn train(&self, resume: bool, observer: &dyn Observer) -> Result<Trained, Error> {
        let path = self.folder.as_ref().map(|folder| folder.join("checkpoint.safetensors"));
        let mut state = match &path {
            Some(path) if resume && path.exists() => Checkpoint::read(path, &self.config)?,
            _ => Checkpoint::start(&self.config)?,
        };
        let mut graph = Graph::new(&state.parameters)?;
        while state.history.len() < self.config.epochs && !self.is_over(&state) {
            let epoch = state.history.len() + 1;
            let started = web_time::Instant::now();
            let train_loss = self.epoch(epoch, &mut graph, &mut state.adam, observer)?;
            let clips = self.dataset.partition(Partition::Train).len();
            let clips_per_s = clips as f64 / started.elapsed().as_secs_f64();
            state.parameters = graph.parameters()?;
            let model = self.model(&state.parameters);
            let Score { relative, t60_s, eq_db } =
                score(&model, self.dataset, self.dataset.partition(Partition::Validation))?;
            if !relative.is_finite() {
                return Err(Error::Diverged { epoch, step: 0, loss: relative });
            }
            let best = state.history.iter().map(|r| r.validation_error).fold(f64::INFINITY, f64::min);
            state.history.push(EpochRecord {
                epoch,
                train_loss,
                validation_error: relative,
                validation_t60_s: t60_s,
                validation_eq_db: eq_db,
                clips_per_s,
            });
            if relative < best {
                state.best = state.parameters.clone();
                state.best_epoch = epoch;
            }
            if let Some(path) = &path {
                state.write(path, &self.config)?;
            }
            let stage = format!("epoch {epoch}: validation error {relative:.4} of the constant guess");
            report(observer, &stage, epoch as u64, self.config.epochs as u64)?;
        }
        let mut model = self.model(&state.best);
        model.parameters = shrink(&model, self.dataset)?;
        model.calibration = calibrate(&model, self.dataset)?;
        Ok(Trained { model, history: state.history, best_epoch: state.best_epoch })
    }

    /// Whether the validation error has stopped falling.
    fn is_over(&self, state: &Checkpoint) -> bool {
        let mut best = f64::INFINITY;
        let mut last = 0;
        for record in &state.history {
            if record.validation_error < best * (1.0 - self.config.minimum_improvement) {
                best = record.validation_error;
                last = record.epoch;
            }
        }
        state.history.len() >= last + self.config.patience.max(1)
    }

    fn model(&self, parameters: &Parameters) -> Model {
        let mels = self.layout.mels;
        Model {
            layout: self.layout.clone(),
            normalisation: self.normalisation.clone(),
            labels: self.labels.clone(),
            calibration: Calibration::uncalibrated(mels),
            combination: None,
            detectors: None,
            parameters: parameters.clone(),
        }
    }

    /// One pass over the training set; gives the mean loss.
    fn epoch(
        &self,
        epoch: usize,
        graph: &mut Graph,
        adam: &mut Adam,
        observer: &dyn Observer,
    ) -> Result<f64, Error> {
        let mut order = self.dataset.partition(Partition::Train).to_vec();
        order.shuffle(&mut self.rng(epoch as u64, 0));
        // A last batch of one would have no deviation to be normalised by.
        let batches: Vec<&[usize]> = order.chunks(self.config.batch).filter(|b| b.len() > 1).collect();
        let perturb = self.config.perturb.map(|perturb| Perturb::new(perturb, &self.layout));
        let mut total = 0.0;
        for (index, batch) in batches.iter().enumerate() {
            let progress = (epoch - 1) as f64 + index as f64 / batches.len() as f64;
            let rate = self.config.rate(progress / self.config.epochs as f64);
            let step = (epoch * batches.len() + index + 1) as u64;
            let mut targets = Targets::default();
            let mut failed = Ok(());
            let fill = |inputs: &mut Vec<f32>| {
                failed = self.gather(batch, step, perturb.as_ref(), inputs).map(|t| targets = t);
            };
            let out = graph.forward(fill, self.keep(batch.len(), step))?;
            failed?;
            let loss = loss(&out, &targets, self.config.loss)?;
            let value = f64::from(loss.to_scalar::<f32>()?);
            if !value.is_finite() {
                return Err(Error::Diverged { epoch, step: index + 1, loss: value });
            }
            total += value;
            adam.update(graph.variables(), &loss.backward()?, rate, self.config.weight_decay)?;
            let stage = format!("epoch {epoch} of {}", self.config.epochs);
            report(observer, &stage, index as u64 + 1, batches.len() as u64)?;
        }
        Ok(total / batches.len() as f64)
    }

    /// Reads, changes and normalises the clips of a batch.
    fn gather(
        &self,
        batch: &[usize],
        step: u64,
        perturb: Option<&Perturb>,
        inputs: &mut Vec<f32>,
    ) -> Result<Targets, Error> {
        let length = self.layout.mels * self.layout.frames;
        inputs.resize(batch.len() * length, 0.0);
        let labels: Vec<[f32; LABEL_COUNT]> = inputs
            .par_chunks_exact_mut(length)
            .zip(batch.par_iter())
            .enumerate()
            .map_init(Vec::new, |window, (position, (input, &clip))| {
                self.dataset.read(clip, window)?;
                let mut labels = self.dataset.clips()[clip].labels;
                if let Some(perturb) = perturb {
                    perturb.apply(window, &mut labels, &mut self.rng(step, 2 + position as u64));
                }
                self.normalisation.apply(window);
                input.copy_from_slice(window);
                Ok(labels)
            })
            .collect::<Result<_, Error>>()?;
        let mut targets = Targets::default();
        for labels in labels {
            for (k, label) in labels.into_iter().enumerate() {
                let value = self.labels.encode(k, f64::from(label)) as f32;
                targets.mask.push(if value.is_nan() { 0.0 } else { 1.0 });
                targets.values.push(if value.is_nan() { 0.0 } else { value });
            }
        }
        Ok(targets)
    }

    /// Factors of dropout, with mean 1.
    fn keep(&self, samples: usize, step: u64) -> Option<Vec<f32>> {
        let dropout = self.config.network.dropout;
        let mut rng = self.rng(step, 1);
        let factor = (1.0 / (1.0 - dropout)) as f32;
        let mut draw = || if rng.random::<f64>() < dropout { 0.0 } else { factor };
        (dropout > 0.0).then(|| (0..samples * self.config.network.summary_len()).map(|_| draw()).collect())
    }

    /// A generator of its own for every purpose: nothing depends on what was drawn before, so that a resumed training goes
    /// the same way, on any number of threads.
    fn rng(&self, step: u64, purpose: u64) -> Pcg64Mcg {
        let mut seed = [0; 16];
        let mix = self.config.seed
            ^ step.wrapping_mul(0x9E37_79B9_7F4A_7C15)
            ^ purpose.wrapping_mul(0xD1B5_4A32_D192_ED03);
        seed[..8].copy_from_slice(&mix.to_le_bytes());
        seed[8..].copy_from_slice(&(step << 20 | purpose).to_le_bytes());
        Pcg64Mcg::from_seed(seed)
    }
}

/// Mean and deviation of the labels over the training set.
fn label_scale(t60: T60Scale, dataset: &Dataset) -> Result<LabelScale, Error> {
    let mut scale = LabelScale { t60, mean: vec![0.0; LABEL_COUNT], deviation: vec![1.0; LABEL_COUNT] };
    let (mut means, mut deviations) = (Vec::new(), Vec::new());
    for label in 0..LABEL_COUNT {
        let values: Vec<f64> = dataset
            .partition(Partition::Train)
            .iter()
            .map(|&clip| scale.encode(label, f64::from(dataset.clips()[clip].labels[label])))
            .filter(|v| !v.is_nan())
            .collect();
        if values.is_empty() {
            let fault =
                DatasetFault::NoLabels { partition: Partition::Train.name(), label: label_name(label) };
            return Err(Error::dataset("data set", fault));
        }
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        means.push(mean);
        // A label that never varies still has a scale.
        deviations.push(variance.sqrt().max(1e-3));
    }
    (scale.mean, scale.deviation) = (means, deviations);
    Ok(scale)
}

/// Mean and deviation of each mel band over at most 4096 training clips, evenly taken.
fn normalisation(remove_level: bool, dataset: &Dataset) -> Result<Normalisation, Error> {
    let train = dataset.partition(Partition::Train);
    let chosen: Vec<usize> = train.iter().copied().step_by(train.len().div_ceil(4096)).collect();
    let mels = dataset.mels();
    let moments: Vec<Vec<[f64; 2]>> = chosen
        .par_iter()
        .map_init(Vec::new, |window, &clip| {
            dataset.read(clip, window)?;
            let level = if remove_level { f64::from(mean(window)) } else { 0.0 };
            let row = |row: &[f32]| {
                let values = row.iter().map(|v| f64::from(*v) - level);
                let n = row.len() as f64;
                [values.clone().sum::<f64>() / n, values.map(|v| v * v).sum::<f64>() / n]
            };
            Ok(window.chunks_exact(dataset.frames()).map(row).collect())
        })
        .collect::<Result<_, Error>>()?;
    let n = moments.len() as f64;
    let average = |mel: usize, k: usize| moments.iter().map(|m| m[mel][k]).sum::<f64>() / n;
    let (mut mean_db, mut deviation_db) = (Vec::new(), Vec::new());
    for mel in 0..mels {
        let mean = average(mel, 0);
        mean_db.push(mean as f32);
        deviation_db.push((average(mel, 1) - mean * mean).max(1e-6).sqrt() as f32);
    }
    Ok(Normalisation { mean_db, deviation_db, remove_level })
}
