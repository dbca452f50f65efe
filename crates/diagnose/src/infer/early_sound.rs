//! The early sound of a room as it was measured, beside what its model predicts: what a box that the mesh lacks is sought in.

use crate::effect::{Case, Observable};
use crate::infer::baseline::Baseline;
use crate::infer::candidates::{Candidate, cases_of};
use crate::infer::direct_evidence::{Fitted, reflection_evidence, shifts, values_of};
use crate::likelihood::arrivals::peak_partners::{PeakPartners, TimeAxis};
use crate::likelihood::arrivals::{self, ArrivalModel};
use crate::likelihood::reflection_gates::{
    AttenuatedGate, ExpectedDirect, FittedReflections, attenuated, half_gate_s,
};
use crate::likelihood::standing_boxes::floor_map::FloorMap;
use crate::likelihood::standing_boxes::mirror_ways::{Mirror, MirrorWay};
use crate::likelihood::standing_boxes::{
    DirectLevel, EarlyResponse, EarlySound, GatedPath, PeakPath, WITHIN_S,
};
use crate::observe::early_energy::is_fast;
use crate::statistics::median;
use crate::survey::planes::{Plane, dot};
use crate::survey::surfaces::{minus, mirrored_in, unit};
use crate::survey::{Survey, SurveyedResponse};
use sabine_propagate::MeshScene;
use sabine_scene::Levels;

/// Surfaces of the mesh that reflect before or after a box, the largest; directions of walls, likewise.
const MAX_MIRRORS: usize = 10;
const MAX_WALLS: usize = 6;
/// Normals of walls are level to this, and directions nearer to each other than this in degrees are one.
const LEVEL: f64 = 0.1;
const SAME_DEG: f64 = 1.0;
/// Fewer direct sounds have no typical level.
const MIN_DIRECTS: usize = 5;
/// Levels of direct sounds scatter by so much at least, in dB.
const LEVEL_SD_DB: f64 = 1.5;
/// A direct sound that is not there at all counts as so much below the others, in dB.
const NOTHING_DB: f64 = -30.0;
/// From here on what was taken for the direct sound is another sound, in dB below where it should be.
const MISSING_DB: f64 = -8.0;
/// Median absolute deviation of a normal distribution with the standard deviation one.
const MAD: f64 = 0.6745;
/// Paths whose lengths differ by less than this are one, in metres.
const SAME_PATH_M: f64 = 1e-3;

/// What there is to see of a box: none where the mesh cannot be asked, or where no octave tells single reflections apart.
pub(crate) fn read(
    baseline: &Baseline,
    (candidates, fit_used): (&[Candidate<'_>], &[bool]),
    chosen: &[usize],
    fitted: Fitted<'_>,
) -> Option<EarlySound> {
    let survey = baseline.survey();
    let data = baseline.arrival_data();
    let of_times = cases_of(candidates, chosen, Observable::Arrivals);
    let model = arrivals::at_fit(&data, &of_times, fit_used);
    let values = &fitted.arrivals.values;
    let fast: Vec<usize> = (0..survey.bands.len())
        .filter(|&b| is_fast(survey.bands, b) && b < baseline.observations.pulses.len())
        .collect();
    let mesh = MeshScene::new(baseline.simulation.traced_scene()).ok()?;
    let frequency = fast.iter().map(|&b| survey.bands.exact_hz(b).ln()).sum::<f64>() / fast.len() as f64;
    if fast.is_empty() {
        return None;
    }
    let of_pair = |pair: usize| Pair::of(baseline, &model, values, pair, &fast);
    let pairs: Vec<Pair> = (0..baseline.pairs()).map(of_pair).collect();
    let directs = Directs::of(&pairs, survey, fit_used, fast.len());
    let (decays, own) = values_of(candidates, chosen, fitted);
    let acting = |case: &&Case| reflection_evidence(case).is_none();
    let (cases, own): (Vec<&Case>, Vec<Vec<f64>>) =
        decays.iter().copied().zip(own).filter(|(case, _)| acting(case)).unzip();
    let shift_s = shifts(baseline, &model, values);
    let reflections = FittedReflections { absorption: &fitted.energy.values, shift_s: &shift_s };
    let expected: Vec<Option<ExpectedDirect>> =
        pairs.iter().map(|pair| directs.as_ref()?.expected(pair, survey.bands.len(), &fast)).collect();
    let gates =
        attenuated(&baseline.observations, &baseline.simulation, (&cases, &own), reflections, &expected);
    // What is missing in a hole is not missing behind a box.
    let holes: Vec<usize> =
        decays.iter().filter_map(|case| reflection_evidence(case)).filter_map(|e| e.plane()).collect();
    let mirrors = mirrors(baseline, &fast);
    let responses = pairs
        .iter()
        .zip(gates)
        .map(|(pair, gates)| {
            let in_a_hole = |gate: &AttenuatedGate| gate.plane.is_some_and(|plane| holes.contains(&plane));
            let gates = gates.into_iter().filter(|gate| !in_a_hole(gate)).collect();
            pair.response(baseline, directs.as_ref(), gates, &mirrors)
        })
        .collect();
    let places = survey.sources.iter().chain(&survey.receivers).map(|place| place.position_m);
    let speed_m_s = survey.air.speed_of_sound_m_s();
    let floor = FloorMap::of(&mesh, survey.box_m);
    let places_m = places.collect();
    let walls_deg = walls_deg(&survey.planes);
    let wave_length_m = speed_m_s / frequency.exp();
    Some(EarlySound::new(
        responses,
        Box::new(mesh),
        floor,
        survey.box_m,
        (walls_deg, places_m),
        wave_length_m,
    ))
}

/// What fits say of a pair.
struct Pair {
    index: usize,
    ends_m: [[f64; 3]; 2],
    axis: TimeAxis,
    /// When the direct sound should come, in seconds of the file; none where the mesh blocks it.
    direct_s: Option<f64>,
    /// Level in the gate of each fast band at that instant, the distance counted, in dB.
    levels_db: Vec<f64>,
    /// The same where the direct sound was found.
    found_db: Vec<f64>,
    direct_m: f64,
    peaks: Vec<PeakPartners>,
}

impl Pair {
    fn of(
        baseline: &Baseline,
        model: &ArrivalModel<'_>,
        values: &[f64],
        pair: usize,
        fast: &[usize],
    ) -> Self {
        let survey = baseline.survey();
        let SurveyedResponse { source, receiver, .. } = survey.responses[pair];
        let moved = |place: [f64; 3], first: usize| std::array::from_fn(|k| place[k] + values[first + k]);
        let ends_m = [
            moved(survey.sources[source].position_m, model.layout.source(source).start),
            moved(survey.receivers[receiver].position_m, model.layout.receiver(receiver).start),
        ];
        let axis = model.time_axis(values, pair);
        let way = minus(ends_m[1], ends_m[0]);
        let direct_m = dot(way, way).sqrt();
        let direct = baseline.simulation.arrivals[pair].first();
        let direct_s = direct.map(|a| axis.at_s(a.length_m, a.departure, a.arrival));
        let measured = &baseline.observations.measured[pair];
        let level_db = |band: usize, at_s: f64| {
            let half_s = half_gate_s(&baseline.observations.pulses[band]);
            let energy = measured.early.gate(band, at_s, half_s).unwrap_or(0.0);
            10.0 * (energy * direct_m * direct_m).max(1e-12).log10()
        };
        let levels = |at_s: Option<f64>| {
            at_s.map_or_else(Vec::new, |at_s| fast.iter().map(|&b| level_db(b, at_s)).collect())
        };
        Self {
            index: pair,
            ends_m,
            axis,
            direct_s,
            levels_db: levels(direct_s),
            found_db: levels(direct_s.and(Some(measured.direct_s))),
            direct_m,
            peaks: model.peak_partners(values, pair),
        }
    }

    fn response(
        &self,
        baseline: &Baseline,
        directs: Option<&Directs>,
        gates: Vec<AttenuatedGate>,
        mirrors: &[Mirror],
    ) -> EarlyResponse {
        let later = baseline.simulation.arrivals[self.index].get(1..).unwrap_or_default();
        let amplitude: f64 = later.iter().map(|a| a.energy.sqrt()).sum();
        let mut indices: Vec<usize> = self.peaks.iter().flat_map(|p| &p.partners).map(|p| p.0).collect();
        indices.sort_unstable();
        indices.dedup();
        let reflections = &baseline.simulation.isolated_reflections[self.index].0;
        let stops = |surfaces: &[usize]| stops(baseline.survey(), self.ends_m, surfaces);
        let gated = |gate: AttenuatedGate| {
            let stops_m = stops(&reflections[gate.reflection].surfaces);
            (!stops_m.is_empty()).then_some(GatedPath { stops_m, gate })
        };
        let gates: Vec<GatedPath> = gates.into_iter().filter_map(gated).collect();
        let path = |&index: &usize| {
            let arrival = &later[index];
            let is_it = |g: &GatedPath| {
                (reflections[g.gate.reflection].length_m - arrival.length_m).abs() < SAME_PATH_M
            };
            // What stands in its way its gate says, where it has one.
            let stops_m = if gates.iter().any(is_it) { Vec::new() } else { stops(&arrival.surfaces) };
            PeakPath { stops_m, share: arrival.energy.sqrt() / amplitude.max(1e-300) }
        };
        let paths = indices.iter().map(path).collect();
        let mut peaks = self.peaks.clone();
        for partner in peaks.iter_mut().flat_map(|p| &mut p.partners) {
            partner.0 = indices.partition_point(|&index| index < partner.0);
        }
        let speed_m_s = 1.0 / self.axis.per_m_s.max(1e-6);
        let beside = directs.and_then(|d| Some((d, d.beside_db(&self.levels_db)?)));
        let is_missing = beside.is_some_and(|(_, beside_db)| beside_db < MISSING_DB);
        let lacks = beside.filter(|_| is_missing).and_then(|(d, _)| d.beside_db(&self.found_db));
        EarlyResponse {
            ends_m: self.ends_m,
            direct: beside.map(|(d, beside_db)| DirectLevel { beside_db, sd_db: d.sd_db }),
            gates,
            paths,
            peaks,
            axis: self.axis,
            height_lacks_db: lacks.unwrap_or(0.0),
            ways: MirrorWay::all(self.ends_m, mirrors, self.direct_m + speed_m_s * WITHIN_S),
        }
    }
}

/// The typical level of a direct sound, by fast band, and how levels scatter.
struct Directs {
    typical_db: Vec<f64>,
    sd_db: f64,
}

impl Directs {
    /// None where levels of responses are free, or where too few direct sounds are in sight.
    fn of(pairs: &[Pair], survey: &Survey, used: &[bool], bands: usize) -> Option<Self> {
        let seen: Vec<&Pair> = pairs
            .iter()
            .zip(used)
            .filter(|(p, used)| **used && p.direct_s.is_some())
            .map(|(p, _)| p)
            .collect();
        if seen.len() < MIN_DIRECTS || survey.measurement.levels == Levels::PerResponse {
            return None;
        }
        let typical = |band: usize| median(seen.iter().map(|p| p.levels_db[band]).collect());
        let mut directs = Self { typical_db: (0..bands).map(typical).collect(), sd_db: 0.0 };
        let off = seen.iter().filter_map(|p| directs.beside_db(&p.levels_db)).map(f64::abs).collect();
        directs.sd_db = (median(off) / MAD).max(LEVEL_SD_DB);
        Some(directs)
    }

    /// A level beside the typical one, in the mean over the bands.
    fn beside_db(&self, levels_db: &[f64]) -> Option<f64> {
        if levels_db.is_empty() {
            return None;
        }
        let off: f64 = levels_db.iter().zip(&self.typical_db).map(|(l, t)| l - t).sum();
        Some((off / levels_db.len() as f64).max(NOTHING_DB))
    }

    /// The direct sound of a pair as it should be, where it is not there.
    fn expected(&self, pair: &Pair, bands: usize, fast: &[usize]) -> Option<ExpectedDirect> {
        let missing = self.beside_db(&pair.levels_db)? < MISSING_DB;
        let time_s = pair.direct_s.filter(|_| missing)?;
        let mut energy = vec![0.0; bands];
        for (&band, typical_db) in fast.iter().zip(&self.typical_db) {
            energy[band] = 10f64.powf(0.1 * typical_db) / (pair.direct_m * pair.direct_m);
        }
        Some(ExpectedDirect { time_s, energy })
    }
}

/// Where a path leaves, is mirrored and arrives, in metres; empty where it could not be followed.
fn stops(survey: &Survey, [source, receiver]: [[f64; 3]; 2], surfaces: &[usize]) -> Vec<[f64; 3]> {
    let mirror = |&s: &usize| (survey.surfaces[s].axes[0], survey.surfaces[s].centre_m);
    let planes: Vec<([f64; 3], [f64; 3])> = surfaces.iter().map(mirror).collect();
    let mut images = vec![source];
    for (normal, point) in &planes {
        images.push(mirrored_in(images[images.len() - 1], *normal, *point));
    }
    let mut all = vec![receiver];
    for (k, (normal, point)) in planes.iter().enumerate().rev() {
        let from = all[all.len() - 1];
        let way = minus(images[k + 1], from);
        let towards = dot(*normal, way);
        if towards.abs() < 1e-9 {
            return Vec::new();
        }
        let share = dot(*normal, minus(*point, from)) / towards;
        all.push(std::array::from_fn(|i| from[i] + share * way[i]));
    }
    if planes.is_empty() {
        return Vec::new();
    }
    all.push(source);
    all.reverse();
    all
}

/// The largest surfaces, and what is lost at each in the fast bands.
fn mirrors(baseline: &Baseline, fast: &[usize]) -> Vec<Mirror> {
    let survey = baseline.survey();
    let one = |plane: &Plane| {
        let absorption = &baseline.simulation.absorption[plane.material];
        let scattering = baseline.simulation.materials[plane.material].scattering();
        let kept = |b: usize| (1.0 - absorption[b]) * (1.0 - scattering.values()[b]).max(1e-3);
        let level_db = fast.iter().map(|&b| 10.0 * kept(b).log10()).sum::<f64>() / fast.len() as f64;
        let normal = unit(plane.axes[0]);
        Mirror { point_m: normal.map(|c| c * plane.offset_m), normal, level_db }
    };
    survey.planes.iter().take(MAX_MIRRORS).map(one).collect()
}

/// Directions of upright surfaces in plan, in degrees from 0 to 90, the largest first.
fn walls_deg(planes: &[Plane]) -> Vec<f64> {
    let mut found: Vec<f64> = Vec::new();
    for plane in planes.iter().filter(|p| p.axes[0][2].abs() < LEVEL) {
        let angle = plane.axes[0][1].atan2(plane.axes[0][0]).to_degrees().rem_euclid(90.0);
        let apart = |other: &f64| {
            let off = (angle - other).rem_euclid(90.0);
            off.min(90.0 - off)
        };
        if found.len() < MAX_WALLS && found.iter().all(|other| apart(other) > SAME_DEG) {
            found.push(angle);
        }
    }
    found
}
