//! What the audio thread costs, through the host's interface. A figure, hence not run with the others:
//! `cargo test --release -p sabine-clap-plugin --test cost -- --ignored --nocapture`

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod host;

use host::{Rack, decay, noise};
use sabine_acoustics::{SampleFormat, write_wav_channels};
use std::time::{Duration, Instant};

#[test]
#[ignore = "states a time: in release, on a quiet machine"]
fn three_seconds_of_stereo_at_48_khz_take_less_than_3_percent_of_a_core() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.wav");
    let sides = [decay(3 * 48_000, 1), decay(3 * 48_000, 2)];
    write_wav_channels(&path, &[&sides[0], &sides[1]], 48_000, SampleFormat::Float32).unwrap();
    let input = noise(64, 3, 0.5);
    for block in [64, 480] {
        let mut rack = Rack::with_room(&path, 0.0, 0.0);
        let mut player = rack.start(48e3, block, 2);
        let input: Vec<f32> = input.iter().copied().cycle().take(block as usize).collect();
        let (mut spent, mut longest) = (Duration::ZERO, Duration::ZERO);
        let seconds = 20;
        let calls = seconds * 48_000 / block;
        for _ in 0..calls {
            player.call(&[&input, &input], &[], |call| {
                let start = Instant::now();
                call();
                let took = start.elapsed();
                spent += took;
                longest = longest.max(took);
            });
        }
        let share = 100.0 * spent.as_secs_f64() / f64::from(seconds);
        let due_ms = 1e3 * f64::from(block) / 48e3;
        println!(
            "blocks of {block}: {share:.2} % of a core; the longest call {:.3} ms of {due_ms:.2} ms",
            1e3 * longest.as_secs_f64()
        );
        assert!(share < 3.0, "{share:.2} %");
        rack.stop(player);
    }
}
