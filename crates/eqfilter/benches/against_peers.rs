//! Times of a design, and the taps of many, for `docs/validation/peers/eqfilter_peers.py`, which runs this program and the peers
//! in turn so that all see the same machine.

use sabine_acoustics::{Bands, PerBand};
use sabine_eqfilter::{EqDesigner, EqFilter, EqFilterConfig};
use std::hint::black_box;
use std::io::Write;
use std::time::Instant;

/// The sets of gains that the script also makes: 200 uniform within 15 dB, and two that alternate.
fn gain_sets() -> Vec<PerBand<f64>> {
    let mut state = 1_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 31) * 30.0 - 15.0
    };
    let mut sets: Vec<_> = (0..200).map(|_| PerBand::from_fn(Bands::EQ, |_| uniform())).collect();
    for sign in [15.0, -15.0] {
        sets.push(PerBand::from_fn(Bands::EQ, |b| if b % 2 == 0 { sign } else { -sign }));
    }
    sets
}

fn report(name: &str, sets: &[PerBand<f64>], mut design: impl FnMut(&PerBand<f64>) -> EqFilter) {
    let mut times_ms: Vec<f64> = sets
        .iter()
        .cycle()
        .take(1000)
        .map(|gains| {
            let start = Instant::now();
            black_box(design(black_box(gains)));
            1e3 * start.elapsed().as_secs_f64()
        })
        .collect();
    times_ms.sort_by(f64::total_cmp);
    println!("{name} {:.4} {:.4}", times_ms[0], times_ms[500]);
}

fn main() {
    let (sets, config) = (gain_sets(), EqFilterConfig::default());
    let designer = EqDesigner::new(Bands::EQ, 16_000, config).expect("valid");
    if std::env::args().any(|argument| argument == "--taps") {
        let mut out = std::io::stdout().lock();
        for gains in &sets {
            for tap in designer.design(gains).expect("valid").taps() {
                out.write_all(&tap.to_le_bytes()).expect("the script reads");
            }
        }
        return;
    }
    report("design_planned", &sets, |gains| designer.design(gains).expect("valid"));
    report("design", &sets, |gains| EqFilter::design(gains, 16_000, config).expect("valid"));
}
