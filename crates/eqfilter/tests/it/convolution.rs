//! Convolution, offline and block by block, against the plain sum.

use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;
use sabine_eqfilter::{Error, PartitionedConfig, PartitionedConvolver, convolve};

/// The definition.
fn plain_sum(a: &[f32], b: &[f32]) -> Vec<f64> {
    let mut out = vec![0.0; a.len() + b.len() - 1];
    for (i, &x) in a.iter().enumerate() {
        for (j, &y) in b.iter().enumerate() {
            out[i + j] += f64::from(x) * f64::from(y);
        }
    }
    out
}

fn noise(length: usize, seed: u32) -> Vec<f32> {
    let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(1);
    (0..length)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state as f32 / u32::MAX as f32 - 0.5
        })
        .collect()
}

fn run(convolver: &mut PartitionedConvolver, input: &[f32]) -> Vec<f32> {
    let block = convolver.config().block;
    let mut out = vec![0.0; input.len()];
    for (x, y) in input.chunks_exact(block).zip(out.chunks_exact_mut(block)) {
        convolver.process_block(x, y).expect("whole blocks");
    }
    out
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 40,
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..Default::default()
    })]

    #[test]
    fn overlap_add_is_the_sum(
        a in prop::collection::vec(-1.0_f32..1.0, 1..700),
        b in prop::collection::vec(-1.0_f32..1.0, 1..120),
    ) {
        let expected = plain_sum(&a, &b);
        for found in [convolve(&a, &b), convolve(&b, &a)] {
            prop_assert_eq!(found.len(), expected.len());
            for (x, y) in found.iter().zip(&expected) {
                prop_assert!((f64::from(*x) - y).abs() < 1e-6 * (1.0 + y.abs()), "{} != {}", x, y);
            }
        }
    }

    #[test]
    fn partitions_are_the_sum_without_latency(
        block in prop::sample::select(vec![16_usize, 24, 32]),
        length in 1_usize..3000,
        spare in 0_usize..2000,
        seed: u32,
    ) {
        let (response, input) = (noise(length, seed), noise(block * 150, seed ^ 1));
        let config = PartitionedConfig { block, longest_response: length + spare, fade_blocks: 3 };
        let mut convolver = PartitionedConvolver::new(&response, config).unwrap();
        prop_assert_eq!(convolver.latency_samples(), 0);
        let found = run(&mut convolver, &input);
        let expected = plain_sum(&input, &response);
        // Single precision: the error grows with the energy of the response, not with the sample.
        let tolerance = 2e-6 * (length as f64).sqrt().max(1.0);
        for (n, (x, y)) in found.iter().zip(&expected).enumerate() {
            prop_assert!((f64::from(*x) - y).abs() < tolerance, "sample {}: {} != {}", n, x, y);
        }
        convolver.clear();
        prop_assert!(run(&mut convolver, &input) == found, "past input is forgotten, to the bit");
    }
}

#[test]
fn nothing_convolved_is_nothing() {
    assert_eq!(convolve(&[], &[1.0]), Vec::<f32>::new());
    assert_eq!(convolve(&[1.0], &[]), Vec::<f32>::new());
    assert_eq!(convolve(&[2.0], &[3.0]), [6.0]);
}

/// After an exchange the output is that of the new response alone; during it, a mix of the two, each at full length.
#[test]
fn an_exchange_fades_from_the_old_response_to_the_new() {
    for length in [200, 4000] {
        let config = PartitionedConfig { block: 32, longest_response: length, fade_blocks: 5 };
        let (old, new) = (noise(length, 1), noise(length, 2));
        let mut convolver = PartitionedConvolver::new(&old, config).unwrap();
        let prepared = convolver.preparer().prepare(&new).unwrap();
        let input = noise(32 * 400, 3);
        let (by_old, by_new) = (plain_sum(&input, &old), plain_sum(&input, &new));
        let mut out = vec![0.0; 32];
        let (mut prepared, mut begun, mut ended) = (Some(prepared), None, None);
        for (b, block) in input.chunks_exact(32).enumerate() {
            if b == 203 {
                convolver.exchange(prepared.take().unwrap()).unwrap();
            }
            convolver.process_block(block, &mut out).unwrap();
            for (i, &x) in out.iter().enumerate() {
                let (n, x) = (b * 32 + i, f64::from(x));
                let off = |expected: &[f64]| (x - expected[n]).abs();
                if ended.is_some() {
                    assert!(off(&by_new) < 1e-3, "sample {n}: not the new response");
                } else if off(&by_old) > 1e-3 {
                    assert!(b >= 203, "sample {n}: faded before it was asked to");
                    let first = *begun.get_or_insert(n);
                    let share = (n - first + 1) as f64 / 160.0;
                    let mixed = by_old[n] + share * (by_new[n] - by_old[n]);
                    // The first difference may be too small to be seen: a few samples' doubt about where it began.
                    let slack = 1e-3 + 3.0 / 160.0 * (by_new[n] - by_old[n]).abs();
                    assert!((x - mixed).abs() < slack, "sample {n}: {x} != {mixed}");
                }
            }
            if b >= 203 && !convolver.is_exchanging() {
                ended.get_or_insert(b);
            }
        }
        let ended = ended.expect("the exchange ends");
        // At once and five blocks long; or when the tail is ready, 16 to 32 blocks later.
        let expected = if length == 200 { 207..=207 } else { 203 + 16..=203 + 32 + 5 };
        assert!(expected.contains(&ended), "length {length}: ended in block {ended}");
        assert!(convolver.take_retired().is_some());
        assert!(convolver.take_retired().is_none());
    }
}

#[test]
fn one_exchange_at_a_time() {
    let config = PartitionedConfig { block: 16, longest_response: 64, fade_blocks: 2 };
    let mut convolver = PartitionedConvolver::new(&[1.0], config).unwrap();
    let preparer = convolver.preparer();
    let two = || preparer.prepare(&[2.0]).unwrap();
    convolver.exchange(two()).unwrap();
    let back = convolver.exchange(two());
    assert!(back.is_err(), "the first is under way");
    run(&mut convolver, &[0.0; 64]);
    assert!(!convolver.is_exchanging());
    assert!(convolver.exchange(two()).is_err(), "the old response has not been taken");
    convolver.take_retired().unwrap();
    convolver.exchange(two()).unwrap();
    let other = PartitionedConvolver::new(&[1.0], PartitionedConfig { block: 32, ..config }).unwrap();
    assert!(convolver.exchange(other.preparer().prepare(&[1.0]).unwrap()).is_err(), "another block size");
}

#[test]
fn wrong_settings_and_lengths_are_named() {
    let good = PartitionedConfig { block: 16, longest_response: 64, fade_blocks: 2 };
    for bad in [
        PartitionedConfig { block: 0, ..good },
        PartitionedConfig { longest_response: 0, ..good },
        PartitionedConfig { fade_blocks: 0, ..good },
    ] {
        assert!(matches!(PartitionedConvolver::new(&[1.0], bad), Err(Error::OutOfRange(_))), "{bad:?}");
    }
    for bad in [&[][..], &[0.5; 65]] {
        let result = PartitionedConvolver::new(bad, good);
        assert!(matches!(result, Err(Error::ResponseLength { most: 64, .. })));
    }
    let mut convolver = PartitionedConvolver::new(&[1.0], good).unwrap();
    assert!(convolver.process_block(&[0.0; 15], &mut [0.0; 16]).is_err());
    assert!(convolver.process_block(&[0.0; 16], &mut [0.0; 17]).is_err());
}
