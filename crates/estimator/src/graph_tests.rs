//! Gradients against central differences of a network that is written out naively, in double precision.

use super::*;
use crate::config::Block;
use crate::network::Network;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

type Tensors = BTreeMap<String, Vec<f64>>;

/// The whole network by its definition: loops over every index, nothing shared with the kernels. With `running`, the
/// normalisation uses the running moments; else those of the batch.
fn naive(
    config: &NetworkConfig,
    tensors: &Tensors,
    inputs: &[f64],
    keep: Option<&[f64]>,
    running: bool,
) -> Vec<f64> {
    let samples = inputs.len() / (config.mels * config.frames);
    let (mut channels, mut rows, mut columns) = (1, config.mels, config.frames);
    let mut x = inputs.to_vec();
    for (i, block) in config.blocks.iter().enumerate() {
        let t = |part: &str| &tensors[&format!("block{}.{part}", i + 1)];
        let (kh, kw, ph, pw) = (block.kernel[0], block.kernel[1], block.pool[0], block.pool[1]);
        let (r1, c1) = (rows - kh + 1, columns - kw + 1);
        let (r2, c2) = (r1 / ph, c1 / pw);
        let mut y = vec![0.0; samples * block.channels * r2 * c2];
        for s in 0..samples {
            for o in 0..block.channels {
                for r in 0..r2 {
                    for c in 0..c2 {
                        let mut best = f64::NEG_INFINITY;
                        for dr in 0..ph {
                            for dc in 0..pw {
                                let mut sum = t("conv.bias")[o];
                                for n in 0..channels {
                                    for a in 0..kh {
                                        for b in 0..kw {
                                            let (row, column) = (r * ph + dr + a, c * pw + dc + b);
                                            sum += t("conv.weight")[((o * channels + n) * kh + a) * kw + b]
                                                * x[((s * channels + n) * rows + row) * columns + column];
                                        }
                                    }
                                }
                                best = best.max(sum.max(0.0));
                            }
                        }
                        y[((s * block.channels + o) * r2 + r) * c2 + c] = best;
                    }
                }
            }
        }
        for o in 0..block.channels {
            let at = |s: usize, p: usize| (s * block.channels + o) * r2 * c2 + p;
            let all: Vec<f64> =
                (0..samples).flat_map(|s| (0..r2 * c2).map(move |p| at(s, p))).map(|k| y[k]).collect();
            let (mean, variance) = if running {
                (t("norm.running_mean")[o], t("norm.running_variance")[o])
            } else {
                let mean = all.iter().sum::<f64>() / all.len() as f64;
                (mean, all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / all.len() as f64)
            };
            for s in 0..samples {
                for p in 0..r2 * c2 {
                    let v = (y[at(s, p)] - mean) / (variance + 1e-5).sqrt();
                    y[at(s, p)] = v * t("norm.scale")[o] + t("norm.shift")[o];
                }
            }
        }
        (x, channels, rows, columns) = (y, block.channels, r2, c2);
    }
    let mut out = Vec::new();
    for s in 0..samples {
        let planes = &x[s * channels * rows * columns..][..channels * rows * columns];
        let mut v: Vec<f64> = match config.summary {
            Summary::Flatten => planes.to_vec(),
            Summary::TimeMean => {
                planes.chunks(columns).map(|row| row.iter().sum::<f64>() / columns as f64).collect()
            }
        };
        if config.spectrum {
            let input = &inputs[s * config.mels * config.frames..][..config.mels * config.frames];
            let means: Vec<f64> =
                input.chunks(config.frames).map(|r| r.iter().sum::<f64>() / r.len() as f64).collect();
            let deviations = input
                .chunks(config.frames)
                .zip(&means)
                .map(|(r, m)| (r.iter().map(|v| (v - m).powi(2)).sum::<f64>() / r.len() as f64).sqrt());
            v.extend(means.iter().copied().chain(deviations));
        }
        if let Some(keep) = keep {
            let width = v.len();
            v.iter_mut().zip(&keep[s * width..]).for_each(|(v, k)| *v *= k);
        }
        let dense = |v: &[f64], name: &str| -> Vec<f64> {
            let (w, b) = (&tensors[&format!("{name}.weight")], &tensors[&format!("{name}.bias")]);
            w.chunks(v.len())
                .zip(b)
                .map(|(w, b)| b + w.iter().zip(v).map(|(w, v)| w * v).sum::<f64>())
                .collect()
        };
        if config.hidden.is_some() {
            v = dense(&v, "hidden").into_iter().map(|v| v.max(0.0)).collect();
        }
        out.extend(dense(&v, "output"));
    }
    out
}

/// Parameters in which nothing is 0 or 1 by chance.
fn rough(config: &NetworkConfig, seed: u64) -> Parameters {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let random = Parameters::random(config, seed).unwrap();
    let tensors = random
        .tensors()
        .iter()
        .map(|(name, values)| {
            let shake = |v: &f32| {
                v + rng.random_range(0.05..0.3) as f32 * if name.ends_with("bias") { 1.0 } else { 0.5 }
            };
            (name.clone(), values.iter().map(shake).collect())
        })
        .collect();
    Parameters::new(config.clone(), tensors).unwrap()
}

fn double(parameters: &Parameters) -> Tensors {
    let widen = |v: &Vec<f32>| v.iter().map(|v| f64::from(*v)).collect();
    parameters.tensors().iter().map(|(name, values)| (name.clone(), widen(values))).collect()
}

fn noise(count: usize, seed: u64) -> Vec<f32> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    (0..count).map(|_| rng.random_range(-1.5..1.5)).collect()
}

/// Odd sizes, sizes that pooling does not divide, channel counts that are no multiple of the kernels' tiles.
fn cases() -> Vec<NetworkConfig> {
    let block = |channels, kernel, pool| Block { channels, kernel, pool };
    let base = NetworkConfig {
        mels: 6,
        frames: 43,
        blocks: vec![block(4, [1, 2], [1, 2]), block(5, [2, 2], [2, 2])],
        summary: Summary::Flatten,
        spectrum: false,
        hidden: None,
        dropout: 0.5,
        outputs: 3,
    };
    vec![
        base.clone(),
        NetworkConfig { summary: Summary::TimeMean, spectrum: true, hidden: Some(6), ..base.clone() },
        NetworkConfig {
            blocks: vec![block(3, [1, 3], [1, 3]), block(8, [2, 1], [1, 1]), block(6, [3, 2], [2, 3])],
            hidden: Some(4),
            ..base.clone()
        },
        NetworkConfig { mels: 5, frames: 20, blocks: vec![block(9, [3, 3], [2, 2])], ..base },
    ]
}

#[test]
fn every_gradient_meets_central_differences() {
    for (case, config) in cases().into_iter().enumerate() {
        let parameters = rough(&config, 7 + case as u64);
        let samples = 3;
        let inputs = noise(samples * config.mels * config.frames, 1);
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        let keep: Vec<f32> = (0..samples * config.summary_len())
            .map(|_| if rng.random::<f64>() < config.dropout { 0.0 } else { 2.0 })
            .collect();
        let weights = noise(samples * config.outputs, 2);
        let mut graph = Graph::new(&parameters).unwrap();
        let out = graph.forward(|x| *x = inputs.clone(), Some(keep.clone())).unwrap();
        let seed = Tensor::from_vec(weights.clone(), (samples, config.outputs), &Device::Cpu).unwrap();
        let gradients = (out * seed).unwrap().sum_all().unwrap().backward().unwrap();

        let wide = |v: &[f32]| v.iter().map(|v| f64::from(*v)).collect::<Vec<_>>();
        let (inputs, keep, weights) = (wide(&inputs), wide(&keep), wide(&weights));
        let mut tensors = double(&parameters);
        let loss = |tensors: &Tensors| -> f64 {
            let out = naive(&config, tensors, &inputs, Some(&keep), false);
            out.iter().zip(&weights).map(|(o, w)| o * w).sum()
        };
        for (name, variable) in graph.variables() {
            let found: Vec<f32> = gradients.get(variable).unwrap().flatten_all().unwrap().to_vec1().unwrap();
            let scale = found.iter().map(|g| f64::from(g.abs())).fold(0.0, f64::max);
            for index in 0..found.len() {
                let step = 1e-6;
                let value = tensors[name][index];
                let mut at = |v: f64| {
                    tensors.get_mut(name).unwrap()[index] = v;
                    loss(&tensors)
                };
                let expected = (at(value + step) - at(value - step)) / (2.0 * step);
                at(value);
                // Single precision in sums of a few hundred terms of order 1, which may cancel (a bias before a
                // normalisation): 1e-4 of the largest gradient of the tensor, and 1e-5 of the terms.
                let tolerance = 1e-4 * scale + 1e-5;
                assert!(
                    (f64::from(found[index]) - expected).abs() < tolerance,
                    "case {case} {name}[{index}]: {} against {expected}",
                    found[index]
                );
            }
        }
    }
}

#[test]
fn training_and_folded_networks_meet_the_naive_one() {
    for (case, config) in cases().into_iter().chain([NetworkConfig::small()]).enumerate() {
        let parameters = rough(&config, 11);
        let samples = 2;
        let inputs = noise(samples * config.mels * config.frames, 4);
        let wide: Vec<f64> = inputs.iter().map(|v| f64::from(*v)).collect();
        let folded = Network::new(&parameters).infer_batch(&inputs);
        let trained: Vec<f32> = Graph::new(&parameters)
            .unwrap()
            .forward(|x| *x = inputs, None)
            .unwrap()
            .flatten_all()
            .unwrap()
            .to_vec1()
            .unwrap();
        for (found, running) in [(folded, true), (trained, false)] {
            let expected = naive(&config, &double(&parameters), &wide, None, running);
            let scale = expected.iter().fold(1.0, |s: f64, v| s.max(v.abs()));
            for (found, expected) in found.iter().zip(&expected) {
                assert!(
                    (f64::from(*found) - expected).abs() < 2e-5 * scale,
                    "case {case}, running {running}: {found} against {expected}"
                );
            }
        }
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let config = NetworkConfig::averaged();
    let parameters = rough(&config, 5);
    let inputs = noise(5 * config.mels * config.frames, 6);
    let run = |threads| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let mut graph = Graph::new(&parameters).unwrap();
            let out = graph.forward(|x| x.clone_from(&inputs), None).unwrap();
            let gradients = out.sqr().unwrap().sum_all().unwrap().backward().unwrap();
            let bits = |v: &Var| -> Vec<u32> {
                let g: Vec<f32> = gradients.get(v).unwrap().flatten_all().unwrap().to_vec1().unwrap();
                g.into_iter().map(f32::to_bits).collect()
            };
            graph.variables().values().map(bits).collect::<Vec<_>>()
        })
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(5));
}
