//! The levels of the parts that realise the wanted gain in each octave.

/// Bands and parts there can be: ten octaves and the part above them.
const MOST: usize = 11;
/// Newton steps at most; few are needed where a solution exists.
const STEPS: usize = 40;
/// Largest error in dB at which the search ends.
const CLOSE_DB: f64 = 1e-3;
/// How far, in dB, a part may be moved from the gain wanted of it.
const REACH_DB: f64 = 40.0;

/// What [`solve_levels`] finds.
pub(crate) struct Levels {
    /// Amplitude of each part.
    pub amplitudes: Vec<f64>,
    /// Gain of each band in dB.
    pub realised_db: Vec<f64>,
}

/// Finds the amplitudes `a` of the parts for which `10 log10(a' P_b a)` meets `wanted_db[b]` in each band, by damped
/// Gauss-Newton steps on their levels in dB; nearest in least squares where none do. A last part, above the bands, stays at `fixed_db`.
pub(crate) fn solve_levels(power: &[Vec<f64>], wanted_db: &[f64], fixed_db: Option<f64>) -> Levels {
    let bands = wanted_db.len();
    let parts = bands + usize::from(fixed_db.is_some());
    let mut levels_db = [0.0; MOST];
    levels_db[..bands].copy_from_slice(wanted_db);
    if let Some(fixed) = fixed_db {
        levels_db[bands] = fixed;
    }
    let mut now = evaluate(power, &levels_db, bands, parts);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let error = |state: &State| -> [f64; MOST] {
            std::array::from_fn(|b| if b < bands { wanted_db[b] - state.gain_db[b] } else { 0.0 })
        };
        let residual = error(&now);
        let cost: f64 = residual.iter().map(|r| r * r).sum();
        if residual.iter().all(|r| r.abs() < CLOSE_DB) || damping > 1e6 {
            break;
        }
        // (J'J + damping I) step = J' residual.
        let (mut normal, mut step) = ([[0.0; MOST]; MOST], [0.0; MOST]);
        for i in 0..bands {
            for j in 0..bands {
                normal[i][j] = (0..bands).map(|b| now.slope[b][i] * now.slope[b][j]).sum();
            }
            normal[i][i] += damping;
            step[i] = (0..bands).map(|b| now.slope[b][i] * residual[b]).sum();
        }
        solve_in_place(&mut normal, &mut step, bands);
        let mut tried_db = levels_db;
        for b in 0..bands {
            tried_db[b] = (levels_db[b] + step[b]).clamp(wanted_db[b] - REACH_DB, wanted_db[b] + REACH_DB);
        }
        let tried = evaluate(power, &tried_db, bands, parts);
        if error(&tried).iter().map(|r| r * r).sum::<f64>() < cost {
            (now, levels_db) = (tried, tried_db);
            damping *= 0.1;
        } else {
            damping *= 10.0;
        }
    }
    Levels { amplitudes: now.amplitude[..parts].to_vec(), realised_db: now.gain_db[..bands].to_vec() }
}

struct State {
    amplitude: [f64; MOST],
    /// Gain of each band in dB.
    gain_db: [f64; MOST],
    /// Change of each band's gain in dB for each dB of each part.
    slope: [[f64; MOST]; MOST],
}

fn evaluate(power: &[Vec<f64>], levels_db: &[f64; MOST], bands: usize, parts: usize) -> State {
    let amplitude: [f64; MOST] =
        std::array::from_fn(|i| if i < parts { 10f64.powf(levels_db[i] / 20.0) } else { 0.0 });
    let mut state = State { amplitude, gain_db: [0.0; MOST], slope: [[0.0; MOST]; MOST] };
    for (b, form) in power.iter().enumerate().take(bands) {
        let mut total = 0.0;
        for i in 0..parts {
            let row = &form[i * parts..][..parts];
            let product: f64 = row.iter().zip(&amplitude).map(|(p, a)| p * a).sum();
            state.slope[b][i] = amplitude[i] * product;
            total += state.slope[b][i];
        }
        state.gain_db[b] = 10.0 * total.log10();
        for slope in &mut state.slope[b][..parts] {
            *slope /= total;
        }
    }
    state
}

/// Solves a symmetric positive definite system of `n` equations by elimination; the solution replaces the right-hand side.
fn solve_in_place(matrix: &mut [[f64; MOST]; MOST], rhs: &mut [f64; MOST], n: usize) {
    for i in 0..n {
        for row in i + 1..n {
            let factor = matrix[row][i] / matrix[i][i];
            for column in i..n {
                matrix[row][column] -= factor * matrix[i][column];
            }
            rhs[row] -= factor * rhs[i];
        }
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| matrix[i][j] * rhs[j]).sum();
        rhs[i] = (rhs[i] - known) / matrix[i][i];
    }
}
