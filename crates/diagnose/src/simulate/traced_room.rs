//! The measured room traced: one set of paths for each response, good for any material.

use crate::error::Error;
use crate::observe::observed_response::Measured;
use crate::simulate::edges::Edges;
use crate::simulate::scattering_share::scattering_more;
use crate::simulate::scene_tracer::PreparedTracer;
use crate::simulate::traced_pair::TracedPair;
use crate::survey::Survey;
use rayon::prelude::*;
use sabine_acoustics::{Material, Observer, PerBand, report};
use sabine_scene::{MeasuredRoom, Receiver, Scene, Source};
use std::sync::atomic::{AtomicU64, Ordering};

/// Extra scattering of the bands of the traced scene, in turn: its paths then serve any scattering. Rays are drawn for a scattering as often as
/// bands have it: half of them and more for the stated one.
const TRACED_SCATTERING: [f64; 7] = [0.0, 0.12, 0.0, 0.4, 0.0, 0.85, 0.0];
/// The same in too few bands for that: each scattering once before one comes again.
const IN_FEW_BANDS: [f64; 4] = [0.0, 0.12, 0.4, 0.85];
/// Share of the stated absorption at which images are chosen.
const CAUTION: f64 = 0.7;
/// Longest time that is traced after the direct sound, in seconds.
const MAX_TRACED_S: f64 = 2.5;
/// Shortest.
const MIN_TRACED_S: f64 = 0.2;
/// Decay beyond the compared range that is still traced, in dB.
const MARGIN_DB: f64 = 12.0;

/// How long paths must be followed after the direct sound: until the slowest measured decay is through.
pub(crate) fn traced_s(survey: &Survey, measured: &[Measured], range_db: f64) -> f64 {
    let mut longest = MIN_TRACED_S;
    for m in measured {
        if m.table.is_some() {
            longest = longest.max(m.duration_s);
            continue;
        }
        for (band, energies) in m.energies.iter().enumerate() {
            let Some(energies) = energies else { continue };
            let bins = crate::observe::time_bins::Bins::new(survey.bands, band);
            let total: f64 = energies.iter().sum();
            let floor = total * 10f64.powf(-(range_db + MARGIN_DB) / 10.0);
            let mut left = total;
            let end = energies.iter().position(|e| {
                left -= e;
                left < floor
            });
            longest = longest.max(bins.edge_s(end.unwrap_or(energies.len())));
        }
    }
    longest.min(MAX_TRACED_S)
}

/// Extra scattering of so many bands, in turn.
fn traced_scattering(bands: usize) -> &'static [f64] {
    if bands < TRACED_SCATTERING.len() - 1 { &IN_FEW_BANDS } else { &TRACED_SCATTERING }
}

/// The scene with scattering spread over the bands.
pub(crate) fn traced_scene(
    room: &MeasuredRoom,
    survey: &Survey,
    materials: &[Material],
) -> Result<Scene, Error> {
    let bands = survey.bands;
    let extra = traced_scattering(bands.len());
    let spread: Vec<Material> = materials
        .iter()
        .map(|m| {
            let columns: Vec<Material> =
                extra.iter().map(|&extra| scattering_more(m, extra)).collect::<Result<_, _>>()?;
            let scattering = PerBand::from_fn(bands, |b| columns[b % columns.len()].scattering().values()[b]);
            // Absorption only says which images of a cuboid matter: less than stated, for it may be fitted so.
            let absorption = PerBand::from_fn(bands, |b| CAUTION * m.absorption().values()[b]);
            Material::new(absorption, scattering)
        })
        .collect::<Result<_, sabine_acoustics::Error>>()?;
    Ok(room.scene().with_materials(spread)?)
}

/// How long paths must be followed after the emission: the pairs differ in length by metres, the longest direct path sets the duration.
pub(crate) fn traced_until_s(survey: &Survey, traced_s: f64) -> f64 {
    let slowest = survey.responses.iter().map(|r| r.air.speed_of_sound_m_s()).fold(f64::INFINITY, f64::min);
    let diagonal: f64 = (0..3).map(|k| (survey.box_m[1][k] - survey.box_m[0][k]).powi(2)).sum::<f64>().sqrt();
    traced_s + diagonal / slowest + 0.05
}

/// Traces all pairs of sources and receivers that stand where they are given.
pub(crate) fn trace(
    (sources, receivers): (&[Source], &[Receiver]),
    survey: &Survey,
    materials: &[Material],
    (tracer, edges): (&dyn PreparedTracer, Option<&Edges>),
    observer: &dyn Observer,
) -> Result<Vec<TracedPair>, Error> {
    let (done, total) = (AtomicU64::new(0), survey.responses.len() as u64);
    survey
        .responses
        .par_iter()
        .map(|response| {
            report(observer, "tracing", done.fetch_add(1, Ordering::Relaxed), total)?;
            let (source, receiver) = (&sources[response.source], &receivers[response.receiver]);
            let paths = tracer.trace(source, receiver, &response.air)?;
            let places_m = [source.position_m, receiver.position_m];
            let diffracted = Edges::paths(edges, places_m, paths.max_length_m());
            Ok(TracedPair::new(paths, diffracted, response.air, materials)?)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scattering_is_traced_wherever_there_are_bands_enough() {
        for bands in 4..=10 {
            let extra: Vec<f64> = traced_scattering(bands).iter().copied().cycle().take(bands).collect();
            assert!(IN_FEW_BANDS.iter().all(|wanted| extra.contains(wanted)), "{bands}: {extra:?}");
            let stated = extra.iter().filter(|&&extra| extra == 0.0).count();
            assert!(bands < 6 || 2 * stated >= bands, "{bands}: {extra:?}");
        }
    }
}
