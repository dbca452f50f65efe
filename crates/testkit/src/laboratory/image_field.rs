//! What mirrors send: image sources, each with a sign of its own or all with the same.

use super::box_decay::BoxDecay;
use super::column_loudspeaker::ColumnLoudspeaker;
use super::columns::Columns;
use super::layered_air::LayeredAir;
use super::panel::{self, Panel};
use super::patch::{self, Patch};
use super::reflection_by_angle::ReflectionByAngle;
use super::stream::{Purpose, key, mix, unit};
use super::truth::{Medium, Truth};
use super::unfolded::times_met;
use std::f64::consts::PI;

/// At least this many pulses stand for the images of one sample's duration, where there are more.
const PULSES_PER_SAMPLE: f64 = 4.0;
/// Images arrive at their exact instants until there are this many in a sample's duration; then each goes to the nearest sample.
const EXACT_PER_SAMPLE: f64 = 2.0;
/// Images whose octaves have all fallen by this much are left out, in dB.
const LEAST_DB: f64 = 85.0;

/// Adds all image sources of a pair.
///
/// Where images are denser than any filter can tell, only some are kept, with a probability that follows their energy, and weigh so
/// much more: energies stay right in the mean, and no pulse carries more than a quarter of what a sample is due.
pub(crate) fn add_images(
    truth: &Truth,
    medium: &Medium,
    decay: &BoxDecay,
    pair: (usize, usize),
    columns: &mut Columns,
) {
    // All that there are of octaves, and of third octaves.
    if truth.bands_hz.len() <= 10 {
        add_images_of::<10>(truth, medium, decay, pair, columns);
    } else {
        add_images_of::<30>(truth, medium, decay, pair, columns);
    }
}

/// The same for `LANES` bands at most, so that they fit an array.
fn add_images_of<const LANES: usize>(
    truth: &Truth,
    medium: &Medium,
    decay: &BoxDecay,
    pair: (usize, usize),
    columns: &mut Columns,
) {
    let (source, receiver) = (&truth.sources[pair.0], truth.receivers_m[pair.1]);
    let microphone = &truth.microphones[pair.1];
    let bands = truth.bands_hz.len();
    let seed = key(truth.seed, Purpose::Signs, pair.0 * truth.receivers_m.len() + pair.1);
    let end_s = columns.start_s + columns.samples[0].len() as f64 / columns.rate_hz;
    let longest_m = end_s.min(decay.all_fallen_s(medium, LEAST_DB)) * medium.speed_m_s;
    let axes = [0, 1, 2].map(|a| Axis::<LANES>::new(truth, a, source.position_m[a], receiver[a], longest_m));
    let gains: Vec<f64> = truth.source_gains_db.iter().map(|db| 10f64.powf(db / 20.0)).collect();
    let volume_m3 = truth.volume_m3();
    // Images in a second at an age t: 4 pi c^3 t^2 / V.
    let exact_s =
        (EXACT_PER_SAMPLE * columns.rate_hz * volume_m3 / (4.0 * PI * medium.speed_m_s.powi(3))).sqrt();
    let share = PULSES_PER_SAMPLE * columns.rate_hz * volume_m3 / (4.0 * PI * medium.speed_m_s);
    let (panels, patches) = (Panel::all(truth), Patch::all(truth));
    panel::add_reflections(truth, medium, &panels, pair, columns);
    let reflection = ReflectionByAngle::of(truth);
    let layers = LayeredAir::of(truth);
    let column = column_of(truth);
    let weights = decay.weights::<LANES>(medium);
    let mut row = [0.0; LANES];
    let mut by_angle = [1.0; LANES];
    let mut amplitudes = vec![0.0; bands];
    for x in &axes[0].images {
        let row_x = mix(seed ^ x.index as u64);
        for y in &axes[1].images {
            let flat = x.offset_m * x.offset_m + y.offset_m * y.offset_m;
            if flat > longest_m * longest_m {
                continue;
            }
            let row_seed = mix(row_x ^ y.index as u64);
            (0..LANES).for_each(|b| row[b] = x.walls[b] * y.walls[b]);
            for z in &axes[2].images {
                let square = flat + z.offset_m * z.offset_m;
                if square > longest_m * longest_m {
                    continue;
                }
                let length_m = square.sqrt();
                let time_s = layers
                    .as_ref()
                    .map_or(length_m / medium.speed_m_s, |air| air.time_s(length_m, receiver[2], z.offset_m));
                let hash = mix(row_seed ^ z.index as u64);
                let mut worth = *weights.at(time_s);
                let offset = [x.offset_m, y.offset_m, z.offset_m];
                if let Some(reflection) = &reflection {
                    let met = [x.index, y.index, z.index].map(times_met);
                    let met = [met[0][0], met[0][1], met[1][0], met[1][1], met[2][0], met[2][1]];
                    let cosines = offset.map(|o| o / length_m);
                    (0..bands).for_each(|b| by_angle[b] = reflection.factor(b, met, cosines));
                }
                (0..LANES).for_each(|b| worth[b] *= by_angle[b] * row[b] * z.walls[b]);
                let strongest = worth.into_iter().fold(0.0, f64::max);
                // What adds in phase cannot be thinned.
                let kept =
                    if truth.positive_reflections { 1.0 } else { (share * strongest / square).min(1.0) };
                if unit(hash) >= kept {
                    continue;
                }
                if !patches.is_empty() && patch::is_lost(truth, &patches, receiver, offset) {
                    continue;
                }
                let direct = x.index == 0 && y.index == 0 && z.index == 0;
                // Bits that `unit` does not look at.
                let sign = if direct || truth.positive_reflections || hash & 1 == 0 { 1.0 } else { -1.0 };
                let along = x.departure * source.axis[0]
                    + y.departure * source.axis[1]
                    + z.departure * source.axis[2];
                let cosine = along / length_m;
                let heard = (0..3).map(|k| offset[k] * microphone.axis[k]).sum::<f64>() / length_m;
                let scale = sign / length_m / kept.sqrt();
                for b in 0..bands {
                    let energy =
                        by_angle[b] * row[b] * z.walls[b] * (-medium.exponents_per_m[b] * length_m).exp();
                    amplitudes[b] =
                        scale * energy.sqrt() * gains[b] * source.gain(b, cosine) * microphone.gain(b, heard);
                }
                if let Some(column) = &column {
                    let sine = z.departure / length_m;
                    amplitudes.iter_mut().enumerate().for_each(|(b, a)| *a *= column.gain(b, sine));
                }
                if !panels.is_empty() && panel::concerns([x.index, y.index, z.index]) {
                    panel::shade(truth, &panels, receiver, offset, &mut amplitudes);
                }
                if time_s < exact_s || kept == 1.0 {
                    columns.add_exactly(time_s, &amplitudes);
                } else {
                    columns.add_nearby(time_s, &amplitudes);
                }
            }
        }
    }
}

/// The column that the loudspeakers are, if they are.
fn column_of(truth: &Truth) -> Option<ColumnLoudspeaker> {
    let bands = truth.bands().ok()?;
    let edges: Vec<(f64, f64)> = (0..bands.len()).map(|b| bands.edges_hz(b)).collect();
    ColumnLoudspeaker::of(truth, &edges)
}

/// The images of a source along one axis.
struct Axis<const LANES: usize> {
    images: Vec<AxisImage<LANES>>,
}

struct AxisImage<const LANES: usize> {
    index: i64,
    /// From the receiver to the image.
    offset_m: f64,
    /// Where the path leaves, times its length.
    departure: f64,
    /// Energy that the two walls leave, by band.
    walls: [f64; LANES],
}

impl<const LANES: usize> Axis<LANES> {
    fn new(truth: &Truth, axis: usize, source: f64, receiver: f64, longest_m: f64) -> Self {
        let side = truth.size_m[axis];
        let reach = (longest_m / side).ceil() as i64 + 1;
        let mirrored = truth.log_mirrored();
        let image = |index: i64| {
            let turned = index % 2 != 0;
            let offset_m = index as f64 * side + if turned { side - source } else { source } - receiver;
            let [low, high] = times_met(index);
            let mut walls = [0.0; LANES];
            for (left, logs) in walls.iter_mut().zip(&mirrored) {
                *left = (low * logs[2 * axis] + high * logs[2 * axis + 1]).exp();
            }
            AxisImage { index, offset_m, departure: if turned { offset_m } else { -offset_m }, walls }
        };
        Self { images: (-reach..=reach).map(image).collect() }
    }
}
