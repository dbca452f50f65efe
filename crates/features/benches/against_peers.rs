//! Best and median time, in ms, of the log-mel spectrogram of 4 s, as one line that `docs/validation/peers/features_peers.py`
//! reads: it runs this program and the peers in turn, so that all see the same machine.

use sabine_features::{LogMel, LogMelConfig};
use std::hint::black_box;
use std::time::Instant;

fn main() {
    let samples: Vec<f32> = (0..64_000).map(|n| ((n * n % 7919) as f32 / 7919.0) - 0.5).collect();
    let log_mel = LogMel::new(LogMelConfig::default()).expect("the default is valid");
    let mut scratch = log_mel.scratch();
    let mut out = vec![0.0; 32 * 499];
    let mut times_ms: Vec<f64> = (0..400)
        .map(|_| {
            let start = Instant::now();
            log_mel.extract_into(black_box(&samples), &mut scratch, &mut out).expect("lengths agree");
            black_box(&out);
            1e3 * start.elapsed().as_secs_f64()
        })
        .collect();
    times_ms.sort_by(f64::total_cmp);
    println!("log_mel {:.4} {:.4}", times_ms[0], times_ms[200]);
}
