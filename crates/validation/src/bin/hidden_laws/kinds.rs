//! The kinds of hidden laws, and what counts as a right answer to each.

use rand::seq::IndexedRandom;
use rand::{Rng, SeedableRng, rngs::SmallRng};
use sabine::diagnose::Cause;
use sabine_testkit::{Hidden, Laboratory, Truth};
use sabine_validation::AnyError;

/// Materials on less of the surface than this hide nothing.
const LEAST_AREA: f64 = 0.1;

/// How a law goes over the octaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// The same in all octaves, or a course without an edge.
    None,
    /// At least half as strong as anywhere from a frequency up.
    From,
    /// At least half as strong as anywhere up to a frequency.
    UpTo,
    /// Strongest about a frequency.
    Peak,
}

/// A kind of hidden laws.
#[derive(Debug)]
pub struct Kind {
    pub id: &'static str,
    /// Targets that a right law may have.
    pub targets: &'static [&'static str],
    /// A right law speaks of one of these.
    pub covariates: &'static [&'static str],
    /// Effects of the catalogue that are the truth.
    pub catalogue: &'static [&'static str],
    pub edge: Edge,
}

const REFLECTION: &[&str] = &["reflection"];
const PATH: &[&str] = &["path"];
const LEVEL: &[&str] = &["path", "recorder"];
const TIMES: &[&str] = &["length_m", "time_s", "time_after_direct_s", "file_time_s"];

/// All kinds.
pub const KINDS: [Kind; 10] = [
    Kind {
        id: "helmholtz_absorber",
        targets: REFLECTION,
        covariates: &["frequency_hz"],
        catalogue: &["surface_absorption"],
        edge: Edge::Peak,
    },
    Kind {
        id: "temperature_gradient",
        targets: &["delay"],
        covariates: &["mean_height_m", "least_height_m", "source_z_m", "receiver_z_m"],
        catalogue: &["temperature_gradient", "sound_speed"],
        edge: Edge::None,
    },
    Kind { id: "fog", targets: LEVEL, covariates: TIMES, catalogue: &["air_absorption"], edge: Edge::From },
    Kind {
        id: "directional_microphones",
        targets: PATH,
        covariates: &["arrival_cos", "arrival_azimuth_deg", "arrival_elevation_deg"],
        catalogue: &["receiver_directivity"],
        edge: Edge::None,
    },
    Kind {
        id: "warming_loudspeaker",
        targets: LEVEL,
        covariates: &["recording_order"],
        catalogue: &[],
        edge: Edge::None,
    },
    Kind {
        id: "grazing_absorption",
        targets: REFLECTION,
        covariates: &["cos_incidence"],
        catalogue: &[],
        edge: Edge::From,
    },
    Kind {
        id: "seat_dip",
        targets: REFLECTION,
        covariates: &["cos_incidence"],
        catalogue: &[],
        edge: Edge::Peak,
    },
    Kind { id: "gain_drift", targets: LEVEL, covariates: TIMES, catalogue: &[], edge: Edge::None },
    Kind {
        id: "limp_wall",
        targets: REFLECTION,
        covariates: &["cos_incidence", "frequency_hz"],
        catalogue: &[],
        edge: Edge::UpTo,
    },
    Kind {
        id: "column_loudspeaker",
        targets: PATH,
        covariates: &["departure_elevation_deg"],
        catalogue: &["source_directivity"],
        edge: Edge::From,
    },
];

/// Number of a kind.
///
/// # Errors
/// A sentence, for no such kind.
pub fn number(id: &str) -> Result<usize, AnyError> {
    let known = || KINDS.map(|kind| kind.id).join(", ");
    let found = KINDS.iter().position(|kind| kind.id == id);
    found.ok_or_else(|| format!("`{id}` is no kind of hidden law; there are {}", known()).into())
}

/// Share of each material in the surface of the room.
fn shares(truth: &Truth) -> Vec<f64> {
    let [x, y, z] = truth.size_m;
    let areas = [y * z, y * z, x * z, x * z, x * y, x * y];
    let mut shares = vec![0.0; truth.materials.len()];
    for (area, material) in areas.into_iter().zip(truth.faces) {
        shares[material] += area / areas.iter().sum::<f64>();
    }
    shares
}

impl Kind {
    /// The law of a size in a room: 1 is plain, half of it slight, twice of it strong. Details follow from the seed.
    ///
    /// # Errors
    /// For a room without a surface that is large enough.
    pub fn hide(&self, size: f64, lab: &Laboratory, seed: u64) -> Result<Hidden, AnyError> {
        let truth = lab.truth(&[])?;
        let mut random = SmallRng::seed_from_u64(seed);
        let large: Vec<usize> = shares(&truth)
            .iter()
            .enumerate()
            .filter(|(_, share)| **share > LEAST_AREA)
            .map(|(m, _)| m)
            .collect();
        let material = *large.choose(&mut random).ok_or("no material has a tenth of the surface")?;
        let bands = truth.bands_hz.len();
        let x: f64 = random.random();
        let step = random.random_range(0..3);
        // Between the octaves of 250 and 500 Hz, 500 Hz and 1 kHz, or 1 and 2 kHz.
        let between_hz = [354.0, 707.0, 1414.0][step];
        Ok(match self.id {
            "helmholtz_absorber" => Hidden::HelmholtzAbsorber {
                material,
                share: (0.45 * size).min(0.99),
                f0_hz: between_hz,
                q: 2.0 + x,
                resistance: 1.0,
            },
            "temperature_gradient" => {
                Hidden::TemperatureGradient { k_per_m: (1.5 + x) * size, stated_at_m: 1.0 }
            }
            "fog" => Hidden::Fog { water_g_m3: 2.0 * size, radius_um: 4.0 + 2.0 * x },
            "directional_microphones" => {
                let directed =
                    |b: usize| (0.2 + 0.05 * x) * size * (0.4 + 0.6 * b as f64 / (bands - 1) as f64);
                Hidden::ReceiverDirectivity {
                    omni_share: (0..bands).map(|b| (1.0 - directed(b)).max(0.4)).collect(),
                    axis: None,
                }
            }
            "warming_loudspeaker" => Hidden::WarmingLoudspeaker {
                final_db: (1.5 + 0.5 * x) * size,
                time_constant: 0.4 * truth.responses() as f64,
            },
            "grazing_absorption" => Hidden::GrazingAbsorption {
                material,
                db: (6.0 + 2.0 * x) * size,
                from_hz: [500.0, 1000.0, 2000.0][step],
            },
            // The floor, as rows of seats do.
            "seat_dip" => Hidden::SeatDip {
                material: truth.faces[4],
                db: ((14.0 + 4.0 * x) * size).min(40.0),
                f0_hz: between_hz,
                q: 0.5 + 0.5 * x,
            },
            "gain_drift" => Hidden::GainDrift {
                depth_db: 1.5 * size,
                period_s: 0.4 + 0.4 * x,
                phase_rad: random.random_range(0.0..std::f64::consts::TAU),
            },
            "limp_wall" => Hidden::LimpWall { material, kg_m2: (1.2 + 0.6 * x) / size },
            _ => Hidden::ColumnLoudspeaker { length_m: (0.2 + 0.1 * x) * size },
        })
    }

    /// Name of the material that the law is of, where it is of one.
    pub fn surface_of<'t>(&self, hidden: &Hidden, truth: &'t Truth) -> Option<&'t str> {
        let material = match hidden {
            Hidden::HelmholtzAbsorber { material, .. }
            | Hidden::LimpWall { material, .. }
            | Hidden::GrazingAbsorption { material, .. }
            | Hidden::SeatDip { material, .. } => *material,
            _ => return None,
        };
        truth.materials.get(material).map(|m| m.name.as_str())
    }

    /// Whether a named effect of the catalogue is the truth; of a surface, it must be that surface's.
    pub fn is_in_catalogue(&self, cause: &Cause, surface: Option<&str>) -> bool {
        let about =
            |wanted: &str| cause.subject.iter().chain(&cause.other_subjects).any(|subject| subject == wanted);
        self.catalogue.contains(&cause.effect.as_str()) && surface.is_none_or(about)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;
    use sabine_testkit::LabConfig;

    #[test]
    fn every_kind_of_every_size_fits_a_room() {
        for seed in 1..4 {
            let lab = Laboratory::new(LabConfig { seed, receivers: 6, ..LabConfig::default() }).unwrap();
            for kind in &KINDS {
                for size in [0.5, 1.0, 2.0, 3.0] {
                    let hidden = kind.hide(size, &lab, seed).unwrap();
                    let truth = lab.truth(std::slice::from_ref(&hidden)).unwrap();
                    let on_surface = kind.targets == REFLECTION;
                    assert_eq!(kind.surface_of(&hidden, &truth).is_some(), on_surface, "{}", kind.id);
                }
                assert_eq!(number(kind.id).unwrap(), KINDS.iter().position(|k| k.id == kind.id).unwrap());
            }
        }
        assert!(number("gravity").unwrap_err().to_string().contains("`gravity` is no kind"));
    }
}
