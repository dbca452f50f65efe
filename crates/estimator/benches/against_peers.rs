//! The network beside its peers; `docs/validation/peers/estimator_peers.py` runs this program and them in turn.
//!
//! `infer WEIGHTS INPUTS OUTPUTS` hears the inputs (normalised windows, 32-bit floats), writes the outputs and prints best and
//! median time in ms for one window and for all of them in one call; `train` prints clips per second over an epoch of a
//! synthetic set, reading and label handling included.

#[allow(dead_code)] // the tests use more of it
#[path = "../tests/it/support/mod.rs"]
mod support;

use sabine_estimator::{Dataset, Model, Network, NetworkConfig, Scratch, TrainConfig, Trainer};
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;
use support::Shard;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["infer", weights, inputs, outputs] => infer(weights, inputs, outputs),
        ["train"] => train(),
        _ => {
            println!("run by docs/validation/peers/estimator_peers.py");
            Ok(())
        }
    }
}

fn infer(weights: &str, inputs: &str, outputs: &str) -> Result<(), Box<dyn Error>> {
    let network = Network::new(&Model::from_safetensors(weights, &std::fs::read(weights)?)?.parameters);
    let inputs: Vec<f32> = std::fs::read(inputs)?
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect();
    let found = network.infer_batch(&inputs);
    std::fs::write(outputs, found.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())?;
    let mut scratch = Scratch::default();
    let one = &inputs[..network.input_len()];
    print_times("one", 400, || {
        black_box(network.infer_with_scratch(black_box(one), &mut scratch));
    });
    print_times("all", 12, || {
        black_box(network.infer_batch(black_box(&inputs)));
    });
    Ok(())
}

fn print_times(name: &str, repeats: usize, mut work: impl FnMut()) {
    let mut times_ms: Vec<f64> = (0..repeats)
        .map(|_| {
            let start = Instant::now();
            work();
            1e3 * start.elapsed().as_secs_f64()
        })
        .collect();
    times_ms.sort_by(f64::total_cmp);
    println!("{name} {:.5} {:.5}", times_ms[0], times_ms[repeats / 2]);
}

fn train() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    support::write(
        folder.path(),
        &[("train", Shard::synthetic(512, 0, 1)), ("validation", Shard::synthetic(4, 5000, 2))],
    );
    let config = TrainConfig {
        network: NetworkConfig::averaged(),
        epochs: 3,
        perturb: None,
        ..TrainConfig::default()
    };
    let trained = Trainer::new(config, &Dataset::open(folder.path())?, None)?.train(false, &())?;
    let fastest = trained.history.iter().map(|epoch| epoch.clips_per_s).fold(0.0, f64::max);
    println!("train {fastest:.1}");
    Ok(())
}
