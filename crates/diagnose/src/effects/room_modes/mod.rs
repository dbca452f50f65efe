//! `room_modes`: standing waves in the lowest octaves.

mod waves;

use crate::effect::EffectInfo;
use crate::effect::next_measurement::NextMeasurement;
use crate::effect::{Case, DecayTerm, Effect, Parameter};
use crate::extend::model_change::ModelChange;
use crate::simulate::tables::{Tables, Unprepared};
use crate::simulate::traced_views::TracedRoomView;
use crate::simulate::views::BandView;
use crate::survey::Survey;
use waves::WaveTable;

/// The frequencies of modes are known to this share: so far off is the solver (0.2 % in the middle of an octave), and so is a room
/// that is measured to a centimetre. The beats of two modes are lost after as many periods.
const DETUNED: f64 = 0.002;
/// The damping of a mode is known to this share: impedances do not follow from absorption alone. The error of its energy grows with what
/// has decayed.
const DAMPING: f64 = 0.15;
/// Most of a bin's energy that may be left to chance where waves predict it, and least.
const LEFT_TO_CHANCE: (f64, f64) = (0.03, 1.0);

/// Below the Schroeder frequency energies follow the solution of the wave equation in the mesh
/// ([`WaveSolver`](sabine_propagate::wave::WaveSolver)), no longer the sum of the paths' energies: for a path, whether it adds to
/// another or takes from it is chance; for a wave it is not.
///
/// Two parameters: the share of the waves, 0 for paths alone and 1 for waves alone (the exponent of the ratio of the two
/// energies in each bin); and how much of the spread that chance would give is left: places, walls and the mesh are known so well
/// and no better. It grows as 1 - exp(-(2 pi f t 0.2 %)^2 - (15 % ln(E(0) / E(t)))^2), for the frequencies of modes are known to 0.2 %
/// and their damping to 15 %. Octaves below 2000 sqrt(T / V) count, and the lowest if it reaches below; in a room without any there is no case.
/// The solution is made once at the materials of the baseline, and anew when a cause has been named. [`DiagnoseConfig::wave_solutions`](crate::DiagnoseConfig::wave_solutions)
/// turns it off.
///
/// Mark: narrow peaks at the same frequencies everywhere, loud here and weak there; energies of the lowest octaves that differ from
/// place to place as the waves do, and beat. Mimicked by: `transducer_response` and absorption (where the lowest octaves are louder or
/// decay otherwise on the average), `position_error` (one place that is louder), and by nothing that is the same at all places.
///
/// Source: Schroeder and Kuttruff, JASA 34 (1962) 76; Kuttruff, Room Acoustics, 6th ed., 3.2 to 3.5; Bilbao, Hamilton, Botts and
/// Savioja, IEEE/ACM TASLP 24(1) (2016).
#[derive(Clone, Copy, Debug, Default)]
pub struct RoomModes;

impl Effect for RoomModes {
    fn info(&self) -> EffectInfo {
        EffectInfo::new(
            "room_modes",
            "Room modes in the lowest octaves",
            "Room modes dominate the lowest octaves: the wave equation predicts their levels, ray paths do not.",
        )
        .decided_by(13, NextMeasurement::OtherSourcePlace)
    }

    fn cases(&self, survey: &Survey) -> Vec<Case> {
        if survey.bands_of_modes == 0 {
            return Vec::new();
        }
        let parameters = vec![
            Parameter::new("share_of_waves", "", 0.0, 0.7, (0.0, 1.2)).typically(1.0),
            Parameter::new("left_to_chance", "", 1.0, 0.7, LEFT_TO_CHANCE).typically(0.5).with_floor(),
        ];
        let starts = vec![vec![0.9, 0.3], vec![0.4, 0.8]];
        vec![Case::decay(parameters, *self).starting(starts).changing(|fitted| {
            let highest = fitted.survey().bands_of_modes.checked_sub(1);
            let below_hz = highest.map(|b| fitted.survey().bands().edges_hz(b).1);
            below_hz.map(ModelChange::WaveBelow).into_iter().collect()
        })]
    }
}

impl DecayTerm for RoomModes {
    fn prepare(&self, room: &TracedRoomView<'_>) -> Result<Tables, Unprepared> {
        waves::prepare(room)
    }

    #[cfg(test)]
    fn by_hand(&self, bins: usize) -> Option<Box<dyn std::any::Any + Send + Sync>> {
        Some(Box::new(WaveTable::by_hand(bins)))
    }

    fn apply(&self, values: &[f64], view: &BandView<'_>, ln_energy: &mut [f64]) {
        let Some(table) = view.table::<WaveTable>() else { return };
        for (bin, l) in ln_energy.iter_mut().enumerate() {
            *l += values[0] * table.change(bin);
        }
    }

    fn variance(&self, values: &[f64], view: &BandView<'_>, variance: &mut [f64]) {
        if view.table::<WaveTable>().is_some_and(|table| !table.is_empty()) {
            let predicted = values[0].clamp(0.0, 1.0) * (1.0 - values[1]);
            let turn_per_s = std::f64::consts::TAU * view.survey().bands().exact_hz(view.band()) * DETUNED;
            let loudest = view.state.ln_energy[..variance.len()].iter().copied().fold(f64::MIN, f64::max);
            for (bin, v) in variance.iter_mut().enumerate() {
                let turned = turn_per_s * view.time_s(bin);
                let decayed = DAMPING * (loudest - view.state.ln_energy[bin]);
                *v *= 1.0 - predicted * (-turned.powi(2) - decayed.powi(2)).exp();
            }
        }
    }
}
