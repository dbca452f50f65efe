//! A law that was found against the one that is hidden: sign, edge of the octaves, and level at random points.

use crate::kinds::Edge;
use crate::truth::{Point, level_db};
use rand::{Rng, SeedableRng, rngs::SmallRng};
use sabine::acoustics::Bands;
use sabine::diagnose::FoundLaw;
use sabine::paths::laws::{Law, LawParameter, LawTarget};
use sabine_testkit::Hidden;

/// Points at which levels are compared, and the seed that they are drawn from.
const POINTS: usize = 2000;
const SEED: u64 = 24;
/// Paths of the points are so long, in metres.
const LENGTHS_M: (f64, f64) = (3.0, 60.0);
/// A sum of levels over octaves below this has no sign, in dB.
const NO_SIGN_DB: f64 = 0.01;

/// How a law that was found agrees with the hidden one; none where that cannot be said.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Agreement {
    /// Whether it takes where the hidden one takes.
    pub sign: Option<bool>,
    /// Whether its edge, or its peak, over the octaves is right within an octave.
    pub edge: Option<bool>,
    /// Root mean square of the difference in dB.
    pub rms_db: Option<f64>,
    /// The same of no law at all: the root mean square of the hidden one.
    pub hidden_rms_db: Option<f64>,
}

/// The law as an object that can be evaluated.
pub fn law_of(found: &FoundLaw) -> Option<Law> {
    let target = LawTarget::of_name(&found.target)?;
    let parameters = found.parameters.iter().map(|p| {
        let interval = [p.low.min(p.value), p.high.max(p.value)];
        (p.name.clone(), LawParameter::new(p.value, interval, p.unit.clone()))
    });
    Law::new("found", target, found.surface.as_deref(), &found.formula, parameters).ok()
}

/// Compares a law that goes with the right covariate; `responses` is the number of recordings.
pub fn agreement(found: &Law, hidden: &Hidden, edge: Edge, bands: Bands, responses: usize) -> Agreement {
    let own = |at: &Point, band: usize| level_db(hidden, at, band);
    let other = |at: &Point, _: usize| found.value(|name| at.variable(name)).ok();
    let profiles = profile(hidden, bands, responses, &own)
        .and_then(|own| Some((own, profile(hidden, bands, responses, &other)?)));
    let (sign, edge) = match profiles {
        Some((own, other)) => (same_sign(&own, &other), same_edge(hidden, edge, bands, &own, &other)),
        None => (None, None),
    };
    let reflections = found.target() == LawTarget::Reflection;
    let [rms_db, hidden_rms_db] =
        rms(bands, responses, reflections, &own, &other).map_or([None; 2], |r| r.map(Some));
    Agreement { sign, edge, rms_db, hidden_rms_db }
}

/// Level by point and number of the octave.
type Level<'l> = dyn Fn(&Point, usize) -> Option<f64> + 'l;

/// What a law does in each octave where the hidden one does much, less what it does where the hidden one does little.
fn profile(hidden: &Hidden, bands: Bands, responses: usize, level: &Level<'_>) -> Option<Vec<f64>> {
    let plain = Point {
        frequency_hz: 1000.0,
        cos_incidence: 1.0,
        length_m: 5.0,
        arrival_cos: -1.0,
        departure_elevation_deg: 0.0,
        recording_order: 0.0,
    };
    let (strong, differs) = match hidden {
        Hidden::GrazingAbsorption { .. } | Hidden::SeatDip { .. } => {
            (Point { cos_incidence: 0.2, ..plain }, false)
        }
        Hidden::HelmholtzAbsorber { .. } | Hidden::LimpWall { .. } => {
            (Point { cos_incidence: 0.7, ..plain }, false)
        }
        Hidden::Fog { .. } => (Point { length_m: 40.0, ..plain }, true),
        Hidden::ReceiverDirectivity { .. } => (Point { arrival_cos: 1.0, ..plain }, true),
        Hidden::ColumnLoudspeaker { .. } => (Point { departure_elevation_deg: 60.0, ..plain }, true),
        Hidden::WarmingLoudspeaker { .. } => {
            (Point { recording_order: responses.saturating_sub(1) as f64, ..plain }, true)
        }
        // A swell has no sign of its own, and a delay no level.
        _ => return None,
    };
    let of_band = |b: usize| {
        let at = |point: Point| level(&Point { frequency_hz: bands.nominal_hz(b), ..point }, b);
        Some(at(strong)? - if differs { at(plain)? } else { 0.0 })
    };
    (0..bands.len()).map(of_band).collect()
}

fn same_sign(own: &[f64], other: &[f64]) -> Option<bool> {
    let [own, other]: [f64; 2] = [own, other].map(|profile| profile.iter().sum());
    (own.abs() > NO_SIGN_DB).then_some(own * other > 0.0)
}

fn same_edge(hidden: &Hidden, edge: Edge, bands: Bands, own: &[f64], other: &[f64]) -> Option<bool> {
    let known_hz = match hidden {
        Hidden::HelmholtzAbsorber { f0_hz, .. } | Hidden::SeatDip { f0_hz, .. } => Some(*f0_hz),
        _ => edge_hz(edge, bands, own),
    }?;
    let found_hz = edge_hz(edge, bands, other)?;
    // Nominal centres lie up to 1 % off.
    Some((found_hz / known_hz).log2().abs() < 1.05)
}

/// The octave in which a course over the octaves has its edge or its peak.
fn edge_hz(edge: Edge, bands: Bands, profile: &[f64]) -> Option<f64> {
    let most = profile.iter().map(|db| db.abs()).fold(0.0, f64::max);
    if most < NO_SIGN_DB {
        return None;
    }
    let half = |b: &usize| profile[*b].abs() >= 0.5 * most;
    let all = 0..profile.len();
    let band = match edge {
        Edge::None => None,
        Edge::From => all.clone().find(half),
        Edge::UpTo => all.clone().rfind(half),
        Edge::Peak => all.clone().max_by(|a, b| profile[*a].abs().total_cmp(&profile[*b].abs())),
    }?;
    Some(bands.nominal_hz(band))
}

/// Root mean squares of the difference and of the hidden law at random points. The mean of each octave is taken off laws that are none of
/// reflections: gains are open.
fn rms(
    bands: Bands,
    responses: usize,
    reflections: bool,
    own: &Level<'_>,
    other: &Level<'_>,
) -> Option<[f64; 2]> {
    let mut random = SmallRng::seed_from_u64(SEED);
    let mut octaves: Vec<Vec<[f64; 2]>> = vec![Vec::new(); bands.len()];
    for _ in 0..POINTS {
        let band = random.random_range(0..bands.len());
        let at = Point {
            frequency_hz: bands.nominal_hz(band),
            cos_incidence: random.random_range(0.05..1.0),
            length_m: random.random_range(LENGTHS_M.0..LENGTHS_M.1),
            arrival_cos: random.random_range(-1.0..1.0),
            // As many in each part of the sphere.
            departure_elevation_deg: f64::asin(random.random_range(-1.0..1.0)).to_degrees(),
            recording_order: random.random_range(0..responses.max(1)) as f64,
        };
        let hidden_db = own(&at, band)?;
        octaves[band].push([other(&at, band)? - hidden_db, hidden_db]);
    }
    Some([0, 1].map(|which| {
        let sum = |values: &Vec<[f64; 2]>| {
            let mean = values.iter().map(|v| v[which]).sum::<f64>() / values.len().max(1) as f64;
            let open = if reflections { 0.0 } else { mean };
            values.iter().map(|v| (v[which] - open).powi(2)).sum::<f64>()
        };
        (octaves.iter().map(sum).sum::<f64>() / POINTS as f64).sqrt()
    }))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;

    fn grazing(a: f64, f0_hz: f64) -> Law {
        let parameters = [
            ("a", LawParameter::new(a, [a, a], "dB")),
            ("f0", LawParameter::new(f0_hz, [f0_hz, f0_hz], "Hz")),
        ];
        let formula = "-a * (1 - cos_incidence)^2 * above(frequency_hz, f0)";
        Law::new("found", LawTarget::Reflection, Some("floor"), formula, parameters).unwrap()
    }

    #[test]
    fn the_hidden_law_itself_agrees_and_others_by_as_much_as_they_differ() {
        let hidden = Hidden::GrazingAbsorption { material: 0, db: 8.0, from_hz: 1000.0 };
        let with = |a, f0_hz| agreement(&grazing(a, f0_hz), &hidden, Edge::From, Bands::T60, 8);
        let same = with(8.0, 1000.0);
        assert_eq!((same.sign, same.edge), (Some(true), Some(true)));
        assert!(same.rms_db.unwrap() < 1e-9);
        // The square of (1 - cos)^2 has the mean 1/5; four octaves of seven.
        let expected_db = 8.0 * f64::sqrt(0.95f64.powi(5) / 0.95 / 5.0 * 4.0 / 7.0);
        assert!((same.hidden_rms_db.unwrap() / expected_db - 1.0).abs() < 0.1, "{same:?}");
        assert!((with(4.0, 1000.0).rms_db.unwrap() / same.hidden_rms_db.unwrap() - 0.5).abs() < 1e-9);
        assert_eq!(with(8.0, 2000.0).edge, Some(true));
        assert_eq!(with(8.0, 4000.0).edge, Some(false));
        assert_eq!(with(-8.0, 1000.0).sign, Some(false));
    }

    #[test]
    fn what_goes_with_something_else_has_no_level() {
        let hidden = Hidden::Fog { water_g_m3: 2.0, radius_um: 5.0 };
        let law = Law::new(
            "found",
            LawTarget::Path,
            None,
            "-a * reflections",
            [("a", LawParameter::new(1.0, [0.0, 2.0], "dB"))],
        );
        let found = agreement(&law.unwrap(), &hidden, Edge::From, Bands::T60, 8);
        assert_eq!((found.sign, found.rms_db), (None, None));
        let a = LawParameter::new(0.1, [0.0, 1.0], "dB/m");
        let law = Law::new("found", LawTarget::Path, None, "-a * length_m", [("a", a)]).unwrap();
        let found = agreement(&law, &hidden, Edge::From, Bands::T60, 8);
        assert_eq!(found.sign, Some(true));
        assert!(found.rms_db.unwrap() < found.hidden_rms_db.unwrap());
    }
}
