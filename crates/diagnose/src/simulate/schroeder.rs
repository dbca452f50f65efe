//! Which bands lie below the Schroeder frequency, and what few modes leave to chance.

use sabine_acoustics::{Air, Bands, Material};
use sabine_scene::Scene;
use std::f64::consts::PI;

/// Schroeder's constant (1962): modes overlap above 2000 sqrt(T / V).
const SCHROEDER: f64 = 2000.0;

/// How many of the lowest bands lie below the Schroeder frequency, T by Eyring's formula; the lowest counts if it reaches below.
pub(crate) fn bands_of_modes(scene: &Scene, air: &Air) -> usize {
    let materials: Vec<&Material> = scene.materials().iter().map(|m| &m.material).collect();
    let Some(bands) = materials.first().map(|m| m.bands()) else { return 0 };
    let areas = scene.material_areas_m2();
    let (surface, volume_m3) = (areas.iter().sum::<f64>(), scene.volume_m3().abs());
    let schroeder_hz = |band: usize| {
        let absorbed: f64 =
            areas.iter().zip(&materials).map(|(area, m)| area * m.absorption().values()[band]).sum();
        let mean = (absorbed / surface).clamp(1e-3, 0.99);
        let t60_s = 24.0 * std::f64::consts::LN_10 / air.speed_of_sound_m_s() * volume_m3
            / (-surface * (1.0 - mean).ln());
        SCHROEDER * (t60_s / volume_m3).sqrt()
    };
    let below = |band: &usize| {
        let (low_hz, high_hz) = bands.edges_hz(*band);
        (if *band == 0 { low_hz } else { high_hz }) < schroeder_hz(*band)
    };
    (0..bands.len()).take_while(below).count()
}

/// Relative variance of the energy that one mode carries from a source to a receiver, over places anywhere in a rectangular room
/// (Lyon 1969: mean fourth powers of the three cosines at both ends are (27/8)^2 of the squared mean squares).
const MODE_VARIANCE: f64 = 27.0 / 8.0 * 27.0 / 8.0 - 1.0;
/// As much as a single diffuse sound has.
const MOST_VARIANCE: f64 = 1.0;

/// Relative variance of the energy in each band over places, for the modes that share it are few. Rays know nothing of it.
pub(crate) fn modal_variance(scene: &Scene, air: &Air, bands: &Bands) -> Vec<f64> {
    let surface_m2: f64 = scene.material_areas_m2().iter().sum();
    let (volume_m3, speed_m_s) = (scene.volume_m3().abs(), air.speed_of_sound_m_s());
    // Modes below a frequency (Weyl's law with its term for surfaces; Kuttruff, Room Acoustics, 6th ed., 3.2).
    let below = |hz: f64| {
        let waves_m = hz / speed_m_s;
        PI * (4.0 / 3.0 * volume_m3 * waves_m.powi(3) + 0.25 * surface_m2 * waves_m.powi(2))
    };
    let variance =
        |(low_hz, high_hz): (f64, f64)| (MODE_VARIANCE / (below(high_hz) - below(low_hz))).min(MOST_VARIANCE);
    (0..bands.len()).map(|band| variance(bands.edges_hz(band))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_are_as_many_as_are_counted_one_by_one_and_each_varies_as_much() {
        let size_m = [5.2, 4.0, 3.1];
        let air = Air::default();
        let bands = Bands::octaves(125.0, 500.0).unwrap();
        let wall = || Material::uniform(bands, 0.1, 0.1).unwrap();
        let scene = Scene::shoebox(size_m, std::array::from_fn(|_| wall())).unwrap();
        let found = modal_variance(&scene, &air, &bands);
        for (band, found) in found.iter().enumerate().take(2) {
            let (low_hz, high_hz) = bands.edges_hz(band);
            let hz = |n: [u32; 3]| -> f64 {
                let squares = (0..3).map(|a| (f64::from(n[a]) / size_m[a]).powi(2)).sum::<f64>();
                0.5 * air.speed_of_sound_m_s() * squares.sqrt()
            };
            let numbers = (0..30).flat_map(|x| (0..30).flat_map(move |y| (0..30).map(move |z| [x, y, z])));
            let counted = numbers.filter(|&n| (low_hz..high_hz).contains(&hz(n))).count() as f64;
            // Of one oblique mode: mean squares of cosines, and of their squares, along three axes at two ends.
            let steps = 1000;
            let mean = |power: i32| -> f64 {
                (0..steps).map(|i| (PI * f64::from(i) / f64::from(steps)).cos().powi(power)).sum::<f64>()
                    / f64::from(steps)
            };
            let of_one = (mean(4) / mean(2).powi(2)).powi(6) - 1.0;
            assert!((of_one / counted / found - 1.0).abs() < 0.06, "{band}: {counted} modes, {found}");
        }
    }
}
