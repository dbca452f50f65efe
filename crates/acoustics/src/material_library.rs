//! Common surfaces, from the literature.

use crate::bands::Bands;
use crate::error::Error;
use crate::material::Material;
use crate::per_band::PerBand;

/// A surface of the library: absorption from a published table, scattering from the depth of its relief.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LibraryMaterial {
    /// Name to look it up by.
    pub name: &'static str,
    /// What was measured.
    pub description: &'static str,
    /// Where the absorption was published.
    pub source: &'static str,
    /// Random-incidence absorption at 125 Hz to 8 kHz, 0 to 1 (ISO 354, or its predecessors).
    pub absorption: [f64; 7],
    /// Typical depth of the surface's relief in metres, from which scattering is estimated: an estimate, not a measurement.
    pub depth_m: f64,
}

impl LibraryMaterial {
    /// The surface on a run of bands.
    ///
    /// Tables begin at 125 Hz: the bands at 62.5 and 31.5 Hz take the value at 125 Hz, and 16 kHz that at 8 kHz. A table that
    /// ends at 4 kHz was continued to 8 kHz with its last value. Scattering is 0.5 sqrt(depth / wavelength), within 0.05 to 0.99: the
    /// estimate of the BRAS benchmark (Aspöck et al. 2019), whose values at 707 Hz are those that Odeon recommends (Zeng,
    /// Christensen and Rindel 2006: 0.02-0.05 smooth, 0.1-0.2 open brickwork, 0.3 bookshelves, 0.6-0.7 audience).
    ///
    /// # Errors
    /// None in practice: the tables are tested to lie within 0 to 1.
    pub fn material(&self, bands: Bands) -> Result<Material, Error> {
        let absorption = PerBand::new(Bands::T60, self.absorption.to_vec())?.resampled(bands);
        let scattering = PerBand::from_fn(bands, |i| scattering_of_depth(self.depth_m, bands.exact_hz(i)));
        Material::new(absorption, scattering)
    }
}

/// Speed of sound at 20 C, in m/s: an estimate of scattering needs no better.
const SPEED_M_S: f64 = 343.2;

fn scattering_of_depth(depth_m: f64, frequency_hz: f64) -> f64 {
    let estimate = (0.5 * (depth_m * frequency_hz / SPEED_M_S).sqrt()).clamp(0.05, 0.99);
    // More digits would pretend to know more.
    (estimate * 1e3).round() / 1e3
}

/// All surfaces of the library.
///
/// ```
/// use sabine_acoustics::{Bands, library_material, material_library};
/// assert!(material_library().len() >= 25);
/// let carpet = library_material("carpet_thin")?.material(Bands::SIMULATION)?;
/// // A thin carpet on concrete swallows a fifth at 1 kHz and next to nothing in the bass.
/// assert_eq!(carpet.absorption().at_hz(1000.0), Some(&0.2));
/// assert_eq!(carpet.absorption().at_hz(62.5), Some(&0.02));
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
///
/// The values are facts, re-entered from the tables named at each surface: M. Vorländer, *Auralization* (Springer 2008), annex;
/// M. D. Egan, *Architectural Acoustics* (McGraw-Hill 1988), chapter 2. Laboratories differ by 0.1 and more on the same kind of surface: trust
/// them to a standard deviation of about 0.1.
pub fn material_library() -> &'static [LibraryMaterial] {
    &LIBRARY
}

/// The surface of this name.
///
/// # Errors
/// [`Error::UnknownMaterial`] if there is none.
pub fn library_material(name: &str) -> Result<&'static LibraryMaterial, Error> {
    let unknown = || Error::UnknownMaterial { name: name.to_owned(), nearest: nearest(name) };
    LIBRARY.iter().find(|m| m.name == name).ok_or_else(unknown)
}

/// The three names that are most like another: those that share its words, then those that take the fewest changes.
fn nearest(name: &str) -> Vec<&'static str> {
    let name = name.to_lowercase();
    let words = |text: &str| text.split(['_', '-', ' ']).map(str::to_owned).collect::<Vec<_>>();
    let asked: Vec<String> = words(&name).into_iter().filter(|word| word.len() > 2).collect();
    let rank = |other: &str| {
        let shared =
            words(other).iter().filter(|word| asked.iter().any(|a| word.contains(a.as_str()))).count();
        (std::cmp::Reverse(shared), changes(&name, other))
    };
    let mut names: Vec<&str> = LIBRARY.iter().map(|m| m.name).collect();
    names.sort_by_key(|other| rank(other));
    names.truncate(3);
    names
}

/// Letters to insert, remove or replace to turn one word into another (Levenshtein 1966).
fn changes(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().collect();
    // What can be asked for has no limit, what is compared has one.
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (i, a) in from.chars().take(100).enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, &b) in to.iter().enumerate() {
            let replaced = diagonal + usize::from(a != b);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[to.len()]
}

const VORLAENDER: &str = "Vorländer 2008, annex";
const EGAN: &str = "Egan 1988, chapter 2";

const fn surface(
    name: &'static str,
    description: &'static str,
    source: &'static str,
    absorption: [f64; 7],
    depth_m: f64,
) -> LibraryMaterial {
    LibraryMaterial { name, description, source, absorption, depth_m }
}

#[rustfmt::skip] // one line for a surface reads as the table that it is
static LIBRARY: [LibraryMaterial; 34] = [
    // Walls and floors of stone and its like.
    surface("rendered_brick", "brickwork, rendered", VORLAENDER, [0.01, 0.02, 0.02, 0.03, 0.03, 0.04, 0.04], 0.002),
    surface("brick_painted", "smooth brickwork, flush joints, painted", VORLAENDER, [0.01, 0.01, 0.02, 0.02, 0.02, 0.02, 0.02], 0.005),
    surface("brick_open_joints", "smooth brickwork, joints 10 mm deep", VORLAENDER, [0.08, 0.09, 0.12, 0.16, 0.22, 0.24, 0.24], 0.04),
    surface("stucco_rough", "brick wall, stuccoed with a rough finish", VORLAENDER, [0.03, 0.03, 0.03, 0.04, 0.05, 0.07, 0.07], 0.01),
    surface("concrete_smooth", "smooth concrete, unpainted", VORLAENDER, [0.01, 0.01, 0.02, 0.02, 0.02, 0.05, 0.05], 0.002),
    surface("concrete_rough", "rough concrete", VORLAENDER, [0.02, 0.03, 0.03, 0.03, 0.04, 0.07, 0.07], 0.01),
    surface("concrete_block_coarse", "concrete block, coarse, unpainted", EGAN, [0.36, 0.44, 0.31, 0.29, 0.39, 0.25, 0.25], 0.01),
    surface("limestone", "limestone walls", VORLAENDER, [0.02, 0.02, 0.03, 0.04, 0.05, 0.05, 0.05], 0.005),
    surface("ceramic_tiles", "ceramic tiles with a smooth surface", VORLAENDER, [0.01, 0.01, 0.01, 0.02, 0.02, 0.02, 0.02], 0.002),
    surface("marble_floor", "marble floor", VORLAENDER, [0.01, 0.01, 0.01, 0.02, 0.02, 0.02, 0.02], 0.001),
    // Light constructions, glass, wood.
    surface("plasterboard", "2 x 13 mm plasterboard on steel frame, 50 mm mineral wool in the cavity, painted", VORLAENDER, [0.15, 0.10, 0.06, 0.04, 0.04, 0.05, 0.05], 0.002),
    surface("plasterboard_ceiling", "plasterboard ceiling on battens with a large air space above", VORLAENDER, [0.20, 0.15, 0.10, 0.08, 0.04, 0.02, 0.02], 0.002),
    surface("plaster_on_lath", "plaster, rough finish on lath", EGAN, [0.14, 0.10, 0.06, 0.05, 0.04, 0.03, 0.03], 0.005),
    surface("glass_3mm", "single pane of glass, 3 mm", VORLAENDER, [0.08, 0.04, 0.03, 0.03, 0.02, 0.02, 0.02], 0.002),
    surface("glass_window", "window, ordinary glass", EGAN, [0.35, 0.25, 0.18, 0.12, 0.07, 0.04, 0.04], 0.01),
    surface("double_glazing", "double glazing, 2 to 3 mm glass, gap wider than 30 mm", VORLAENDER, [0.15, 0.05, 0.03, 0.03, 0.02, 0.02, 0.02], 0.005),
    surface("wood_lining", "wooden lining, 12 mm, fixed on frame", VORLAENDER, [0.27, 0.23, 0.22, 0.15, 0.10, 0.07, 0.06], 0.01),
    surface("wood_16mm", "wood, 16 mm, on 40 mm studs", VORLAENDER, [0.18, 0.12, 0.10, 0.09, 0.08, 0.07, 0.07], 0.01),
    surface("plywood_thin", "thin plywood panelling", VORLAENDER, [0.42, 0.21, 0.10, 0.08, 0.06, 0.06, 0.06], 0.005),
    surface("wooden_door", "solid wooden door", VORLAENDER, [0.14, 0.10, 0.06, 0.08, 0.10, 0.10, 0.10], 0.01),
    // Floors and what lies on them.
    surface("stage_floor", "wood, two layers, 27 mm, over air space", VORLAENDER, [0.10, 0.07, 0.06, 0.06, 0.06, 0.06, 0.06], 0.002),
    surface("parquet_on_concrete", "wood parquet on concrete", EGAN, [0.04, 0.04, 0.07, 0.06, 0.06, 0.07, 0.07], 0.002),
    surface("linoleum_on_concrete", "linoleum, asphalt, rubber or cork tiles on concrete", VORLAENDER, [0.02, 0.03, 0.03, 0.03, 0.03, 0.02, 0.02], 0.001),
    surface("carpet_thin", "thin carpet, cemented to concrete", VORLAENDER, [0.02, 0.04, 0.08, 0.20, 0.35, 0.40, 0.40], 0.005),
    surface("carpet_on_felt", "tufted carpet, pile 9 mm, on felt underlay", VORLAENDER, [0.08, 0.08, 0.30, 0.60, 0.75, 0.80, 0.80], 0.009),
    // Absorbers.
    surface("curtain_light", "curtain, 0.2 kg/m2, 90 mm from the wall", VORLAENDER, [0.05, 0.06, 0.39, 0.63, 0.70, 0.73, 0.73], 0.09),
    surface("curtain_heavy", "heavy velour, 0.6 kg/m2, draped to half its area", EGAN, [0.14, 0.35, 0.55, 0.72, 0.70, 0.65, 0.65], 0.1),
    surface("mineral_wool_50mm", "rock wool, 50 mm, 80 kg/m3, on a hard wall", VORLAENDER, [0.22, 0.60, 0.92, 0.90, 0.88, 0.88, 0.88], 0.01),
    surface("acoustic_plaster", "acoustical plaster, about 25 mm", VORLAENDER, [0.17, 0.36, 0.66, 0.65, 0.62, 0.68, 0.68], 0.005),
    surface("ceiling_tiles", "fissured ceiling tiles", VORLAENDER, [0.49, 0.53, 0.53, 0.75, 0.92, 0.99, 0.99], 0.01),
    surface("perforated_gypsum", "gypsum board, 27 mm, 16 % perforated, 300 mm below the ceiling", VORLAENDER, [0.45, 0.55, 0.60, 0.90, 0.86, 0.75, 0.75], 0.005),
    // Seats and people, per area of floor.
    surface("seats_wooden", "wooden chairs without cushion, 2 per m2", VORLAENDER, [0.05, 0.08, 0.10, 0.12, 0.12, 0.12, 0.12], 0.6),
    surface("seats_upholstered", "concert chairs, medium upholstered, empty, 2 per m2", VORLAENDER, [0.49, 0.66, 0.80, 0.88, 0.82, 0.70, 0.70], 0.8),
    surface("audience", "audience, orchestra or choir, narrow aisles included", VORLAENDER, [0.60, 0.74, 0.88, 0.96, 0.93, 0.85, 0.85], 0.8),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_surface_is_a_material_under_a_name_of_its_own() {
        for (i, surface) in LIBRARY.iter().enumerate() {
            let material = surface.material(Bands::SIMULATION).expect(surface.name);
            assert_eq!(material.absorption().values()[1..], surface.absorption);
            assert_eq!(library_material(surface.name).unwrap(), surface);
            assert!(LIBRARY[i + 1..].iter().all(|other| other.name != surface.name));
            assert!(!surface.source.is_empty() && !surface.description.is_empty());
        }
        assert!(matches!(library_material("unobtainium"), Err(Error::UnknownMaterial { .. })));
    }

    #[test]
    fn a_name_that_is_not_there_brings_the_nearest() {
        for (asked, first) in [
            ("carpt_thin", "carpet_thin"),
            ("Carpet_Thin", "carpet_thin"),
            ("parquet", "parquet_on_concrete"),
            ("thick curtain", "curtain_light"),
            ("brick-painted", "brick_painted"),
        ] {
            assert_eq!(nearest(asked)[0], first, "{asked}: {:?}", nearest(asked));
            assert!(library_material(asked).unwrap_err().to_string().contains(first));
        }
        assert_eq!((changes("kitten", "sitting"), changes("", "ab"), changes("ab", "ab")), (3, 2, 0));
    }

    #[test]
    fn scattering_meets_the_recommended_values_at_707_hz() {
        for (name, low, high) in
            [("marble_floor", 0.02, 0.05), ("brick_open_joints", 0.1, 0.2), ("audience", 0.6, 0.7)]
        {
            let found = scattering_of_depth(library_material(name).unwrap().depth_m, 707.0);
            assert!(found >= low && found <= high, "{name}: {found}");
        }
    }
}
