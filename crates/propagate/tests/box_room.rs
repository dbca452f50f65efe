//! The box of known answers: 10 x 7 x 3 m, absorption 0.1, no air.

use sabine_acoustics::*;
use sabine_propagate::*;

/// Energy of one band in bins of `bin_s`, without air: exp(log weight + log reflectance), nothing else.
pub fn energy_without_air(
    paths: &PathSet,
    materials: &[Material],
    band: usize,
    speed: f64,
    bin_s: f64,
) -> Vec<f64> {
    let gain = paths.log_reflectance(materials, band).unwrap();
    let mut bins = vec![0.0; (paths.max_length_m() / speed / bin_s) as usize + 1];
    for i in 0..paths.len() {
        let bin = (f64::from(paths.lengths_m()[i]) / speed / bin_s) as usize;
        bins[bin] += f64::from(paths.log_weights()[i] + gain[paths.chains()[i] as usize]).exp();
    }
    bins
}

fn t30_s(scattering: f64, rays: usize, seed: u64) -> f64 {
    let bands = OctaveBands::new(1000.0, 1000.0).unwrap();
    let m = Material::uniform(bands, 0.1, scattering).unwrap();
    let scene = Scene::shoebox([10.0, 7.0, 3.0], std::array::from_fn(|_| m.clone())).unwrap();
    let tracer = PathTracer::new(TracerConfig { rays, duration_s: 2.5, seed, ..Default::default() }).unwrap();
    let source = Source::omni("S", [2.0, 3.0, 1.5]).unwrap();
    let receiver = Receiver::omni("R", [7.0, 4.0, 1.6]).unwrap();
    let air = Air::default();
    let start = std::time::Instant::now();
    let paths = tracer.trace(&scene, &source, &receiver, &air, &()).unwrap();
    let materials: Vec<Material> = scene.materials().iter().map(|m| m.material.clone()).collect();
    let energy = energy_without_air(&paths, &materials, 0, air.speed_of_sound_m_s(), 1e-3);
    let t = EnergyDecayCurve::from_energy(&energy, 1e-3).decay_time_s(-5.0, -35.0).unwrap();
    eprintln!(
        "s {scattering} seed {seed}: T30 {t:.4} s, {} paths, {} chains, {:?}",
        paths.len(),
        paths.chain_count(),
        start.elapsed()
    );
    t
}

#[test]
fn probe() {
    for s in [0.0, 0.1, 0.3, 0.5, 1.0] {
        for seed in 0..3 {
            t30_s(s, 20_000, seed);
        }
    }
}
