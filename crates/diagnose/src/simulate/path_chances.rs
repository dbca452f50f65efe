//! Which paths a prediction can do without: most carry nothing until something scatters, or far less than others that come with them.

use crate::simulate::scattering_share::scattering_more;
use sabine_acoustics::LocalReaction;
use sabine_acoustics::{Air, Bands, Error, Material, PerBand};
use sabine_paths::{Conditions, PathSet};

/// Exact paths keep their place for so long after the direct sound, in seconds: they are compared one by one.
const EXACT_S: f64 = 0.06;
/// Paths that come within so long of each other compete, in seconds.
const CELL_S: f64 = 1e-3;
/// Extra scattering at which paths must serve ([`scattering_more`]): late paths scatter so often that those of one serve no other.
pub(crate) const EXTRA_SCATTERING: [f64; 8] = [-1.0, -0.5, 0.0, 0.1, 0.25, 0.45, 0.7, 0.95];
/// Paths that carry the energy of a cell as stated, and with each other scattering.
const WANTED: (f32, f32) = (60.0, 25.0);
/// Bands in which shares are looked at.
const TYPICAL_BANDS: usize = 4;

/// The chance of each path to be kept, `[path]`: in proportion to its largest share of its cell's energy in any octave, as stated or with
/// other scattering. `stated` are the materials as far as they are known.
pub(crate) fn of(paths: &PathSet, stated: &[Material], air: &Air, direct_m: f64) -> Result<Vec<f32>, Error> {
    let speed_m_s = air.speed_of_sound_m_s();
    let cell_m = (speed_m_s * CELL_S) as f32;
    let cells: Vec<u32> = paths.lengths_m().iter().map(|length| (length / cell_m) as u32).collect();
    let count = cells.iter().max().map_or(0, |&last| last as usize + 1);
    let stated = &typical_bands(stated)?[..];
    let mut chances = vec![0.0f32; paths.len()];
    let mut add = |all: &[Vec<f32>], wanted: f32| {
        let mut largest = vec![0.0f32; paths.len()];
        for energies in all {
            let mut sums = vec![0.0f64; count];
            cells.iter().zip(energies).for_each(|(&cell, &e)| sums[cell as usize] += f64::from(e));
            let per_energy: Vec<f32> =
                sums.iter().map(|&sum| if sum > 0.0 { (1.0 / sum) as f32 } else { 0.0 }).collect();
            for ((largest, &cell), &e) in largest.iter_mut().zip(&cells).zip(energies) {
                *largest = largest.max(e * per_energy[cell as usize]);
            }
        }
        chances.iter_mut().zip(&largest).for_each(|(chance, share)| *chance += wanted * share);
    };
    for extra in EXTRA_SCATTERING {
        let materials: Vec<Material> =
            stated.iter().map(|m| scattering_more(m, extra)).collect::<Result<_, _>>()?;
        if extra != 0.0 && materials.as_slice() == stated {
            continue;
        }
        let mut energies = paths.energies(&Conditions::new(&materials, air))?;
        add(&energies, if extra == 0.0 { WANTED.0 } else { WANTED.1 });
        if extra == 0.0 {
            react_locally(&mut energies, paths, &materials);
            add(&energies, WANTED.0);
        }
    }
    let early_m = direct_m + EXACT_S * speed_m_s;
    for (i, chance) in chances.iter_mut().enumerate() {
        if paths.is_exact(i) && f64::from(paths.lengths_m()[i]) <= early_m {
            *chance = 1.0;
        }
    }
    Ok(chances)
}

/// Energies in up to [`TYPICAL_BANDS`] bands as they would be between walls that react locally: these leave most to paths that meet them at
/// angles of which other walls make nothing.
fn react_locally(energies: &mut [Vec<f32>], paths: &PathSet, materials: &[Material]) {
    let walls: Vec<[LocalReaction; TYPICAL_BANDS]> = materials
        .iter()
        .map(|m| {
            let absorption = m.absorption().values();
            std::array::from_fn(|i| LocalReaction::new(absorption[i.min(absorption.len() - 1)]))
        })
        .collect();
    let log_changes =
        paths.sums_by_angle(|material, cosine| walls[material].map(|wall| wall.log_change(cosine)));
    for (band, energies) in energies.iter_mut().enumerate() {
        energies.iter_mut().zip(&log_changes).for_each(|(e, change)| *e *= change[band].exp());
    }
}

/// The materials in so many of their bands as are worked on together, from the lowest to the highest. Within a cell all paths are as
/// long: what the air takes has no bearing, and so the bands' frequencies have none.
fn typical_bands(materials: &[Material]) -> Result<Vec<Material>, Error> {
    let all = materials[0].bands().len();
    if all <= TYPICAL_BANDS {
        return Ok(materials.to_vec());
    }
    let bands = Bands::octaves(125.0, 1000.0)?;
    let place = |b: usize| b * (all - 1) / (TYPICAL_BANDS - 1);
    let one = |m: &Material| {
        let absorption = PerBand::from_fn(bands, |b| m.absorption().values()[place(b)]);
        Material::new(absorption, PerBand::from_fn(bands, |b| m.scattering().values()[place(b)]))
    };
    materials.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sabine_paths::Propagator;
    use sabine_propagate::{PathTracer, TracerConfig};
    use sabine_scene::{Receiver, Scene, Source};

    #[test]
    fn a_fraction_of_the_paths_keeps_every_decay() {
        let bands = Bands::octaves(125.0, 8000.0).unwrap();
        let walls = [0.05, 0.1, 0.15, 0.2, 0.3, 0.1].map(|a| Material::uniform(bands, a, 0.0).unwrap());
        // As a diagnosis traces: each octave with scattering of its own.
        let traced = walls.clone().map(|m| {
            let scattering = PerBand::from_fn(bands, |b| [0.0, 0.12, 0.4, 0.85][b % 4]);
            Material::new(m.absorption().clone(), scattering).unwrap()
        });
        let scene = Scene::shoebox([6.0, 4.5, 2.8], traced).unwrap();
        let air = Air::default();
        let config =
            TracerConfig { rays: 2000, duration_s: 0.4, cuboid_paths: 50_000, ..TracerConfig::default() };
        let (source, receiver) =
            (Source::omni("s", [1.0, 1.2, 1.5]).unwrap(), Receiver::omni("r", [4.4, 3.1, 1.2]).unwrap());
        let all = PathTracer::new(config).unwrap().trace(&scene, &source, &receiver, &air, &()).unwrap();
        let stated = &walls[..];
        let mut thinned = all.clone();
        let chances = of(&all, stated, &air, 3.9).unwrap();
        thinned.thin(&chances, 1).unwrap();
        assert!(2 * thinned.len() < all.len(), "{} of {}", thinned.len(), all.len());
        let decay = |paths: &PathSet, extra: f64, softer: f64| -> Vec<f64> {
            let materials: Vec<Material> = stated
                .iter()
                .map(|m| {
                    let absorption = PerBand::from_fn(bands, |b| softer * m.absorption().values()[b]);
                    scattering_more(&m.with_absorption(absorption).unwrap(), extra).unwrap()
                })
                .collect();
            let response = paths.energy_response(&Conditions::new(&materials, &air), 0.01).unwrap();
            response.band(3)[2..35].to_vec()
        };
        // At what is stated and at what a fit may come to.
        for (extra, softer, allowed_db) in
            [(0.0, 1.0, 0.2), (0.25, 1.0, 0.3), (0.95, 1.0, 0.4), (0.1, 2.0, 0.4)]
        {
            let (before, after) = (decay(&all, extra, softer), decay(&thinned, extra, softer));
            let off = before.iter().zip(&after).map(|(a, b)| (10.0 * (b / a).log10()).powi(2));
            let rms_db = (off.sum::<f64>() / before.len() as f64).sqrt();
            assert!(rms_db < allowed_db, "extra {extra}, absorption times {softer}: {rms_db} dB");
        }
    }
}
