//! Trains the estimator of reverberation time and equalisation on a data set.
//!
//! `sabine train --data DIR --out DIR [--resume]` writes `model.safetensors`, `history.json`, `curve.svg` and, after every
//! epoch, a checkpoint to go on from.

use crate::chart::{Chart, Look, Scale, Series};
use crate::failure::Failure;
use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use sabine::acoustics::write_atomically;
use sabine::estimator::{
    Dataset, EpochRecord, Loss, NetworkConfig, PerturbConfig, Schedule, T60Scale, TrainConfig, Trainer,
};
use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Which network.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Architecture {
    /// 18 thousand parameters (the code of Tang et al. 2020).
    Small,
    /// The same with a hidden layer of 64 units (their text).
    Dense64,
    /// Averaged over time, with the long-term spectrum.
    Averaged,
}

/// Trains the estimator of reverberation time and equalisation.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Folder of the data set (`manifest.json` and shards).
    #[arg(long)]
    data: PathBuf,
    /// Folder for the model, the learning curve and the checkpoint.
    #[arg(long)]
    out: PathBuf,
    /// Go on from the checkpoint in the folder.
    #[arg(long)]
    resume: bool,
    /// Begin anew in a folder that holds a model or a checkpoint, and replace them.
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Passes over the training set.
    #[arg(long, default_value_t = 60)]
    epochs: usize,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Which network.
    #[arg(long, value_enum, default_value = "averaged")]
    arch: Architecture,
    /// Clips in a step.
    #[arg(long, default_value_t = 64)]
    batch: usize,
    /// Length of the first steps of the optimiser.
    #[arg(long, default_value_t = 2e-3)]
    rate: f64,
    /// Share of the inputs of the dense layers that is dropped.
    #[arg(long)]
    dropout: Option<f64>,
    /// Decay of the weights.
    #[arg(long, default_value_t = 1e-2)]
    decay: f64,
    /// Epochs without improvement after which training ends.
    #[arg(long, default_value_t = 30)]
    patience: usize,
    /// Standard deviation of the octave gains that are added to the features, dB; 0 for none.
    #[arg(long, default_value_t = 3.0)]
    eq_db: f64,
    /// Minimise the squared error instead of learning the variance as well.
    #[arg(long)]
    squared: bool,
    /// Teach seconds instead of their logarithm.
    #[arg(long)]
    linear: bool,
    /// Factor on the number of filters of every block.
    #[arg(long, default_value_t = 1.0)]
    width: f64,
    /// Units of the hidden layer, if there is one.
    #[arg(long)]
    hidden: Option<usize>,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    std::fs::create_dir_all(&arguments.out)?;
    refuse_to_overwrite(arguments)?;
    println!("checking {}", arguments.data.display());
    let dataset = Dataset::open(&arguments.data)?;
    let trainer = Trainer::new(config(arguments), &dataset, Some(&arguments.out))?;
    println!("{} parameters, {} clips", trainer.config().network.parameter_count()?, dataset.clips().len());
    let bar = ProgressBar::new(1);
    bar.set_style(ProgressStyle::with_template("{msg} [{bar:30}] {pos}/{len} {per_sec} {eta}")?);
    let observe = |stage: &str, done: u64, total: u64| {
        if stage.contains("validation") {
            bar.suspend(|| println!("{stage}"));
        } else {
            bar.set_length(total);
            bar.set_position(done);
            bar.set_message(stage.to_owned());
        }
        ControlFlow::Continue(())
    };
    let trained = trainer.train(arguments.resume, &observe)?;
    bar.finish_and_clear();
    let weights = trained.model.to_safetensors(true)?;
    write_atomically(&arguments.out.join("model.safetensors"), |file| file.write_all(&weights))?;
    let history = serde_json::to_vec_pretty(&trained.history)?;
    write_atomically(&arguments.out.join("history.json"), |file| file.write_all(&history))?;
    draw(&arguments.out.join("curve.svg"), &trained.history)?;
    let best = &trained.history[trained.best_epoch.max(1) - 1];
    println!(
        "best epoch {}: T60 {:.3} s, EQ {:.2} dB, {:.1} % of the constant guess's error",
        best.epoch,
        best.validation_t60_s,
        best.validation_eq_db,
        100.0 * best.validation_error
    );
    Ok(())
}

/// Hours of training are not replaced by accident.
fn refuse_to_overwrite(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.resume || arguments.overwrite {
        return Ok(());
    }
    for name in ["model.safetensors", "checkpoint.safetensors"] {
        let path = arguments.out.join(name);
        if path.exists() {
            return Err(format!(
                "{} is there already: go on from it with --resume, or replace it with --overwrite",
                path.display()
            )
            .into());
        }
    }
    Ok(())
}

fn config(arguments: &Arguments) -> TrainConfig {
    let mut network = match arguments.arch {
        Architecture::Small => NetworkConfig::small(),
        Architecture::Dense64 => NetworkConfig::dense64(),
        Architecture::Averaged => NetworkConfig::averaged(),
    };
    if let Some(dropout) = arguments.dropout {
        network.dropout = dropout;
    }
    if arguments.hidden.is_some() {
        network.hidden = arguments.hidden;
    }
    for block in &mut network.blocks {
        block.channels = ((block.channels as f64 * arguments.width / 4.0).round() as usize * 4).max(4);
    }
    let perturb = PerturbConfig { eq_db: arguments.eq_db, ..PerturbConfig::default() };
    TrainConfig {
        network,
        t60: if arguments.linear { T60Scale::Linear } else { T60Scale::Log },
        remove_level: true,
        loss: if arguments.squared { Loss::Squared } else { Loss::Gaussian },
        batch: arguments.batch,
        epochs: arguments.epochs,
        learning_rate: arguments.rate,
        schedule: Schedule::Cosine,
        weight_decay: arguments.decay,
        patience: arguments.patience,
        minimum_improvement: 0.0,
        perturb: (arguments.eq_db > 0.0).then_some(perturb),
        seed: arguments.seed,
    }
}

fn draw(path: &Path, history: &[EpochRecord]) -> Result<(), Failure> {
    let points = history.iter().map(|r| (r.epoch as f64, r.validation_error)).collect();
    let chart = Chart {
        x_label: "Epoch".to_owned(),
        y_label: "Validation error / constant guess".to_owned(),
        x: Scale::Linear(0.0, history.len() as f64),
        y: None,
        series: vec![Series { in_legend: false, ..Series::new("validation", Look::Line, 0, points) }],
        small: false,
    };
    let svg = chart.plain_svg()?;
    Ok(write_atomically(path, |file| file.write_all(svg.as_bytes()))?)
}
