use sabine_acoustics::{OctaveBands, PerBand};
use sabine_eqfilter::*;
#[test]
fn look() {
    let bands = OctaveBands::new(62.5, 8000.0).unwrap();
    for fs in [16000u32, 48000] {
        for sign in [15.0, -15.0] {
            let g = PerBand::from_fn(bands, |i| if i % 2 == 0 { sign } else { -sign });
            let f = EqFilter::design(&g, fs, EqFilterConfig::default()).unwrap();
            println!(
                "{:?}",
                f.realised_db().values().iter().map(|x| format!("{:.2}", x.unwrap())).collect::<Vec<_>>()
            );
        }
        let mut worst = [0.0f64; 8];
        let mut seed = 1u64;
        let d = EqDesigner::new(bands, fs, EqFilterConfig::default()).unwrap();
        let t = std::time::Instant::now();
        for _ in 0..2000 {
            let g = PerBand::from_fn(bands, |_| {
                seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                ((seed >> 33) as f64 / (1u64 << 31) as f64) * 30.0 - 15.0
            });
            let f = d.design(&g).unwrap();
            for b in 0..8 {
                worst[b] = worst[b].max((f.realised_db().values()[b].unwrap() - g.values()[b]).abs());
            }
        }
        println!("{worst:.3?} {:?}", t.elapsed() / 2000);
        let g = PerBand::uniform(bands, 1.0);
        let t = std::time::Instant::now();
        for _ in 0..200 {
            EqFilter::design(&g, fs, EqFilterConfig::default()).unwrap();
        }
        println!("cold {:?}", t.elapsed() / 200);
    }
}
