//! What it changes if each meeting with a material left less, remembered from call to call.

use crate::simulate::band_state::BandState;
use std::cell::RefCell;

/// Questions that are remembered: those of a few effects, and of their slopes. An effect that asks for another share in each bin
/// must not fill the memory.
const MAX_ASKED: usize = 8;

/// Changes of one pair's bins in one band. Slopes of a fit ask for the same ones again and again, once for each parameter of every other
/// effect and each octave that leaks in.
#[derive(Default)]
pub(crate) struct HitChanges {
    /// Material, logarithm of the share that is left, and the change of each bin, not a number where it was never asked for.
    asked: RefCell<Vec<(usize, f64, Vec<f64>)>>,
}

impl HitChanges {
    /// Logarithm of the change of a bin's energy if each meeting with a material left so much less (logarithm).
    pub fn of(&self, state: &BandState, bin: usize, material: usize, ln_kept: f64) -> f64 {
        let mut asked = self.asked.borrow_mut();
        let same = asked.iter().position(|(m, l, _)| *m == material && *l == ln_kept);
        let place = same.unwrap_or_else(|| {
            if asked.len() == MAX_ASKED {
                asked.remove(0);
            }
            asked.push((material, ln_kept, vec![f64::NAN; state.ln_energy.len()]));
            asked.len() - 1
        });
        let change = &mut asked[place].2[bin];
        if change.is_nan() {
            *change = reflection_reweighting(state, bin, material, ln_kept);
        }
        *change
    }
}

fn reflection_reweighting(state: &BandState, bin: usize, material: usize, ln_kept: f64) -> f64 {
    let (mut before, mut after) = (0.0, 0.0);
    for group in state.groups[bin]..state.groups[bin + 1] {
        let energy = state.group_energy[group];
        before += energy;
        after += energy * (state.group_hits[material][group] * ln_kept).exp();
    }
    if before > 0.0 { (after / before).ln() } else { 0.0 }
}
