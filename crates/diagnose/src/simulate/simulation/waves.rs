//! What the wave equation says of the lowest bands, in the bins in which they are measured.

use super::Simulation;
use crate::error::Error;
use crate::observe::band_pulse::{BandPulse, CELL_S};
use crate::observe::observed_response;
use crate::observe::time_bins::Bins;
use crate::survey::Survey;
use sabine_acoustics::{Air, FilterBank, Material, Receiver, Scene};
use sabine_propagate::wave::{WaveConfig, WaveRoom, WaveSolver};

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
/// Schroeder's constant (1962): modes overlap above 2000 sqrt(T / V).
const SCHROEDER: f64 = 2000.0;
/// Updates of voxels that all solutions of a table may take together: a minute on one core.
const MAX_UPDATES: f64 = 2e10;
/// Largest change that counts, in nepers of energy: a node of the waves is never so deep where it is measured.
const MAX_CHANGE: f64 = 5.0;

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

struct Plan {
    config: WaveConfig,
    /// Pairs that one solution serves.
    solutions: Vec<Vec<usize>>,
    updates: f64,
}

impl Simulation {
    /// Solves the wave equation in the `count` lowest bands for every source at the materials of the expansion, and tabulates by how much
    /// its energies differ from those of the paths. The tables stay empty where there is a reason, which is returned.
    pub fn tabulate_waves(&mut self, count: usize, survey: &Survey) -> Result<Option<String>, Error> {
        let materials = self.expanded_materials()?;
        let plan = self.plan(count, survey);
        if plan.updates > MAX_UPDATES {
            return Ok(Some(format!("{:.0e} steps of voxels would be too many", plan.updates)));
        }
        match self.wave_energies(count, plan, &materials, survey) {
            Ok(tables) => {
                for (states, energies) in self.states.iter_mut().zip(tables) {
                    for (state, energies) in states.iter_mut().zip(energies) {
                        state.compare_with_waves(&energies);
                    }
                }
                Ok(None)
            }
            Err(error) => Ok(Some(error.to_string())),
        }
    }

    /// What is to be solved, and what it takes.
    fn plan(&self, count: usize, survey: &Survey) -> Plan {
        let scene = self.resized.as_ref().unwrap_or(&self.scene);
        let corner = |fold: fn(f64, f64) -> f64, from: f64, k: usize| {
            scene.vertices().iter().map(|v| v[k]).fold(from, fold)
        };
        let side = |k: usize| corner(f64::max, f64::NEG_INFINITY, k) - corner(f64::min, f64::INFINITY, k);
        let longest_m = (0..3).map(side).fold(0.0, f64::max);
        let compared_s = |pair: usize| {
            let end = |band: usize| self.states[pair][band].bins.edge_s(self.ends[pair][band]);
            self.direct_s[pair] + (0..count).map(end).fold(0.0, f64::max) + MARGIN_S
        };
        let slowest_m_s = self.speed_m_s.iter().copied().fold(f64::INFINITY, f64::min);
        let least_s = PERIODS * 2.0 * longest_m / slowest_m_s;
        let config = WaveConfig {
            limit_hz: LET_IN.powf(1.0 / survey.bands.per_octave() as f64) * survey.bands.exact_hz(count - 1),
            points_per_wavelength: POINTS_PER_WAVELENGTH,
            duration_s: (0..self.pairs.len()).map(compared_s).fold(least_s, f64::max),
            sample_rate_hz: RATE_HZ,
            memory_bytes: MEMORY_BYTES,
        };
        let mut solutions: Vec<Vec<usize>> = Vec::new();
        for pair in 0..self.pairs.len() {
            // One solution serves all receivers of a source in the same air.
            let source = |p: usize| survey.responses[p].source;
            let alike = |other: &&mut Vec<usize>| {
                source(other[0]) == source(pair) && self.pairs[other[0]].air == self.pairs[pair].air
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
        &self,
        count: usize,
        plan: Plan,
        materials: &[Material],
        survey: &Survey,
    ) -> Result<Vec<Vec<Vec<f64>>>, sabine_propagate::Error> {
        let bands = survey.bands;
        let low = bands.part(0..count);
        let bank = FilterBank::new(low, RATE_HZ)?;
        let kernels = BandPulse::all(low, RATE_HZ, CELL_S)?;
        let solver = WaveSolver::new(plan.config)?;
        let scene = self.resized.as_ref().unwrap_or(&self.scene);
        let mut found = vec![Vec::new(); self.pairs.len()];
        for now in plan.solutions {
            let (source, air) = (survey.responses[now[0]].source, self.pairs[now[0]].air);
            let place = &self.sources[source];
            let room: WaveRoom = solver.prepare(scene, place, &air)?;
            let hearing: Vec<Receiver> =
                now.iter().map(|&p| self.receivers[survey.responses[p].receiver].clone()).collect();
            let responses = solver.solve(&room, materials, place, &hearing, &air, &())?;
            for (&pair, response) in now.iter().zip(&responses) {
                let samples: Vec<f32> = response.samples().iter().map(|&s| s as f32).collect();
                let rate = f64::from(RATE_HZ);
                let direct = response.lead() as f64 + self.direct_s[pair] * rate;
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
}

impl crate::simulate::traced_pair::BandState {
    /// Takes energies of the wave solution in place of what the paths and the filter would give.
    fn compare_with_waves(&mut self, energies: &[f64]) {
        self.waves = energies
            .iter()
            .zip(&self.ln_energy)
            .enumerate()
            .map(|(bin, (waves, own))| {
                let leaks = self.leaks.iter().map(|(_, share, ln)| share * ln[bin].exp());
                let paths = self.own_share * own.exp() + leaks.sum::<f64>();
                (waves.max(1e-300) / paths.max(1e-300)).ln().clamp(-MAX_CHANGE, MAX_CHANGE)
            })
            .collect();
    }
}
