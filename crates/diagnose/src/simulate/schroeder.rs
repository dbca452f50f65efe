//! Which bands lie below the Schroeder frequency.

use sabine_acoustics::{Air, Material};
use sabine_scene::Scene;

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
