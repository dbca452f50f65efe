//! A response that changes all the time, as for a listener who walks: no click at any block.

use sabine_eqfilter::{PartitionedConfig, PartitionedConvolver};

const BLOCK: usize = 64;
const LENGTH: usize = 12_000;
/// The longest wait before a fade, and the fade.
const UPDATE_BLOCKS: usize = 48;

/// Direct sound at a fractional delay that grows by a third of a millisecond from update to update, a reflection that comes
/// nearer, and a tail of noise that grows weaker.
fn response(update: usize) -> Vec<f32> {
    let mut samples = vec![0.0f32; LENGTH];
    let mut pulse = |position: f64, amplitude: f64| {
        for (i, sample) in samples.iter_mut().enumerate() {
            let x = i as f64 - position;
            if x.abs() < 16.0 {
                let sinc = if x == 0.0 {
                    1.0
                } else {
                    (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x)
                };
                *sample += (amplitude * sinc * (0.5 + 0.5 * (std::f64::consts::PI * x / 16.0).cos())) as f32;
            }
        }
    };
    pulse(100.0 + 7.3 * update as f64, 1.0);
    pulse(900.0 - 11.7 * update as f64, 0.6);
    let mut state = 77u32;
    for (i, sample) in samples.iter_mut().enumerate().skip(1_000) {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = (state >> 8) as f32 / 8_388_608.0 - 1.0;
        *sample += 0.1 * noise * (-(i as f32) / 2_500.0 - 0.05 * update as f32).exp();
    }
    samples
}

/// Low tones: whatever is left above them after three differences is a click.
#[test]
fn block_boundaries_are_no_louder_than_the_rest() {
    let config =
        PartitionedConfig { block: BLOCK, longest_response: LENGTH, fade_blocks: UPDATE_BLOCKS - 34 };
    let mut convolver = PartitionedConvolver::new(&response(0), config).unwrap();
    let preparer = convolver.preparer();
    let updates = 30;
    let input: Vec<f32> = (0..updates * UPDATE_BLOCKS * BLOCK)
        .map(|i| [0.011, 0.024, 0.037].iter().map(|w| (w * i as f32).sin()).sum())
        .collect();
    let mut output = vec![0.0; input.len()];
    for (index, (from, to)) in input.chunks(BLOCK).zip(output.chunks_mut(BLOCK)).enumerate() {
        if index > 0 && index % UPDATE_BLOCKS == 0 {
            convolver.take_retired();
            let next = preparer.prepare(&response(index / UPDATE_BLOCKS)).unwrap();
            assert!(convolver.exchange(next).is_ok(), "update {index}: the last fade has not ended");
        }
        convolver.process_block(from, to).unwrap();
    }
    // The start of the input is a corner of its own.
    let settled = 2 * LENGTH;
    let third: Vec<f64> = output
        .windows(4)
        .map(|w| f64::from(w[3]) - 3.0 * f64::from(w[2]) + 3.0 * f64::from(w[1]) - f64::from(w[0]))
        .collect();
    let (mut at_boundaries, mut elsewhere) = ((0.0f64, 0.0, 0), (0.0f64, 0.0, 0));
    for (i, d) in third.iter().enumerate().skip(settled) {
        // Differences of samples i to i + 3; a boundary lies before every sample that is a multiple of the block.
        let across = (i + 1..=i + 3).any(|sample| sample % BLOCK == 0);
        let (most, sum, count) = if across { &mut at_boundaries } else { &mut elsewhere };
        *most = most.max(d.abs());
        *sum += d * d;
        *count += 1;
    }
    let rms = |(_, sum, count): (f64, f64, usize)| (sum / count as f64).sqrt();
    let loudest = output.iter().fold(0.0f32, |most, s| most.max(s.abs()));
    println!(
        "at boundaries {:.2e} {:.2e}, elsewhere {:.2e} {:.2e}",
        at_boundaries.0,
        rms(at_boundaries),
        elsewhere.0,
        rms(elsewhere)
    );
    // A fade's corners may be the loudest of all that is left, 80 dB below the sound.
    assert!(rms(at_boundaries) < 1.25 * rms(elsewhere), "{} {}", rms(at_boundaries), rms(elsewhere));
    assert!(at_boundaries.0 < 3.0 * elsewhere.0, "{} {}", at_boundaries.0, elsewhere.0);
    assert!(at_boundaries.0 < 1e-3 * f64::from(loudest), "{} of {loudest}", at_boundaries.0);
}
