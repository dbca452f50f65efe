//! What the wave equation says of the lowest bands, in the bins in which they are measured.

use crate::observe::band_pulse::{BandPulse, CELL_S};
use crate::observe::observed_response;
use crate::observe::time_bins::Bins;
use crate::simulate::tables::Tables;
use crate::simulate::tables::Unprepared;
use crate::simulate::traced_views::TracedRoomView;
use sabine_acoustics::FilterBank;
use sabine_propagate::wave::{WaveConfig, WaveRoom, WaveSolver};
use sabine_scene::Receiver;

/// The filter of an octave lets in what lies this far above its centre, as a factor of frequency: there it has lost 20 dB. That of a third
/// octave lets in a third as much of the logarithm.
const LET_IN: f64 = 1.9;
/// Voxels per wave length at the limit: modes of the octave's middle are too low by 0.2 %.
const POINTS_PER_WAVELENGTH: f64 = 14.0;
/// Sample rate of the solutions, in Hz.
const RATE_HZ: u32 = 4000;
/// Beyond the compared bins, in seconds: the filter rings.
const MARGIN_S: f64 = 0.05;
/// Periods of the lowest mode that the solver wants to see, and a little more.
const PERIODS: f64 = 4.2;
/// Memory that a grid may take, in bytes: with it goes the time.
const MEMORY_BYTES: u64 = 128 << 20;
/// Updates of voxels that all solutions of a table may take together: a minute on one core.
const MAX_UPDATES: f64 = 2e10;
/// Largest change that counts, in nepers of energy: a node of the waves is never so deep where it is measured.
const MAX_CHANGE: f64 = 5.0;

/// Logarithm of a wave solution's energy over that of the paths in the bins of one band and pair, both as the filter passes them; empty
/// where there is no solution.
pub(super) struct WaveTable(Vec<f64>);

impl WaveTable {
    /// The change of a bin's energy.
    pub fn change(&self, bin: usize) -> f64 {
        self.0.get(bin).copied().unwrap_or(0.0)
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    #[cfg(test)]
    pub fn by_hand(bins: usize) -> Self {
        Self((0..bins).map(|bin| 0.4 * (1.3 * bin as f64 + 1.0).sin()).collect())
    }
}

/// Solves the wave equation in the lowest bands for every source at the materials of the expansion, and tabulates by how much its energies
/// differ from those of the paths.
pub(super) fn prepare(room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
    let refused =
        |reason: String| Unprepared::Refused(format!("Standing waves are not looked for: {reason}."));
    let count = room.survey().bands_of_modes;
    let plan = plan(room, count);
    if plan.updates > MAX_UPDATES {
        return Err(refused(format!("{:.0e} steps of voxels would be too many", plan.updates)));
    }
    let energies = wave_energies(room, count, plan).map_err(|error| refused(error.to_string()))?;
    let bands = room.survey().bands.len();
    let of_pair = |(pair, energies): (usize, &Vec<Vec<f64>>)| -> Vec<WaveTable> {
        let of_band = |band: usize| {
            let one = |(bin, waves): (usize, &f64)| {
                let paths = room.pair(pair).filtered_energy(band, bin);
                (waves.max(1e-300) / paths.max(1e-300)).ln().clamp(-MAX_CHANGE, MAX_CHANGE)
            };
            // Both lists end where the shorter does.
            let count = room.pair(pair).ln_energy(band).len();
            let waves = energies.get(band).map_or(&[][..], Vec::as_slice);
            WaveTable(waves.iter().take(count).enumerate().map(one).collect())
        };
        (0..bands).map(of_band).collect()
    };
    Ok(Tables::of_bins(energies.iter().enumerate().map(of_pair).collect()))
}

struct Plan {
    config: WaveConfig,
    /// Pairs that one solution serves.
    solutions: Vec<Vec<usize>>,
    updates: f64,
}

/// What is to be solved, and what it takes.
fn plan(room: &TracedRoomView<'_>, count: usize) -> Plan {
    let (scene, survey) = (room.scene(), room.survey());
    let corner = |fold: fn(f64, f64) -> f64, from: f64, k: usize| {
        scene.vertices().iter().map(|v| v[k]).fold(from, fold)
    };
    let side = |k: usize| corner(f64::max, f64::NEG_INFINITY, k) - corner(f64::min, f64::INFINITY, k);
    let longest_m = (0..3).map(side).fold(0.0, f64::max);
    let compared_s = |pair: usize| {
        let end = |band: usize| room.pair(pair).compared_s(band);
        room.pair(pair).direct_s() + (0..count).map(end).fold(0.0, f64::max) + MARGIN_S
    };
    let speeds = survey.responses.iter().map(|r| r.air.speed_of_sound_m_s());
    let slowest_m_s = speeds.fold(f64::INFINITY, f64::min);
    let least_s = PERIODS * 2.0 * longest_m / slowest_m_s;
    let config = WaveConfig {
        limit_hz: LET_IN.powf(1.0 / survey.bands.per_octave() as f64) * survey.bands.exact_hz(count - 1),
        points_per_wavelength: POINTS_PER_WAVELENGTH,
        duration_s: (0..room.len()).map(compared_s).fold(least_s, f64::max),
        sample_rate_hz: RATE_HZ,
        memory_bytes: MEMORY_BYTES,
    };
    let mut solutions: Vec<Vec<usize>> = Vec::new();
    for pair in 0..room.len() {
        // One solution serves all receivers of a source in the same air.
        let source = |p: usize| survey.responses[p].source;
        let alike = |other: &&mut Vec<usize>| {
            source(other[0]) == source(pair) && room.pair(other[0]).air() == room.pair(pair).air()
        };
        match solutions.iter_mut().find(alike) {
            Some(known) => known.push(pair),
            None => solutions.push(vec![pair]),
        }
    }
    let spacing_m = slowest_m_s / (config.limit_hz * POINTS_PER_WAVELENGTH);
    let steps = config.duration_s * slowest_m_s * 3f64.sqrt() / spacing_m;
    // A band more lies partly below the limit.
    let runs = (solutions.len() * (count + 1)) as f64;
    Plan { updates: runs * steps * scene.volume_m3().abs() / spacing_m.powi(3), config, solutions }
}

/// Energies of the wave solution, `[pair][band][bin]`.
fn wave_energies(
    room: &TracedRoomView<'_>,
    count: usize,
    plan: Plan,
) -> Result<Vec<Vec<Vec<f64>>>, sabine_propagate::Error> {
    let (survey, materials) = (room.survey(), room.materials());
    let bands = survey.bands;
    let low = bands.part(0..count);
    let bank = FilterBank::new(low, RATE_HZ)?;
    let kernels = BandPulse::all(low, RATE_HZ, CELL_S)?;
    let solver = WaveSolver::new(plan.config)?;
    let scene = room.scene();
    let mut found = vec![Vec::new(); room.len()];
    for now in plan.solutions {
        let (source, air) = (survey.responses[now[0]].source, room.pair(now[0]).air());
        let place = room.source(source);
        let voxels: WaveRoom = solver.prepare(scene, place, &air)?;
        let hearing: Vec<Receiver> =
            now.iter().map(|&p| room.receiver(survey.responses[p].receiver).clone()).collect();
        let responses = solver.solve(&voxels, materials, place, &hearing, &air, &())?;
        for (&pair, response) in now.iter().zip(&responses) {
            let samples: Vec<f32> = response.samples().iter().map(|&s| s as f32).collect();
            let rate = f64::from(RATE_HZ);
            let direct = response.lead() as f64 + room.pair(pair).direct_s() * rate;
            let filtered = bank.analyse(&samples);
            found[pair] = (0..count)
                .map(|band| {
                    let bins = Bins::new(bands, band);
                    observed_response::energies(
                        &filtered.values()[band],
                        direct,
                        rate,
                        bins,
                        kernels[band].energy,
                    )
                })
                .collect();
        }
    }
    Ok(found)
}
