//! The amplitudes of the parts that realise the wanted gain in each octave.

use crate::grid::dot;

/// Octaves there can be.
const MOST_BANDS: usize = 10;
/// Newton steps at most; two or three are needed where a solution is near.
const STEPS: usize = 40;
/// Error in dB below which a gain is met.
const CLOSE_DB: f64 = 1e-3;
/// Share of a step that is made even if it does not help: a way out of a valley that leads nowhere.
const LEAST_SHARE: f64 = 0.02;
/// Distance in octaves over which changes to the parts go together.
const SMOOTH_OCTAVES: f64 = 0.15;
/// Share of the variance of a change that each part has for itself.
const OWN_SHARE: f64 = 0.01;

/// What stays the same from design to design.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    /// For each band: the quadratic form of its power gain in the amplitudes of the parts, row by row.
    power: Vec<Vec<f64>>,
    /// Covariance of the relative changes of the free parts, row by row: smooth changes are the likely ones.
    smooth: Vec<f64>,
    parts: usize,
    free: usize,
}

impl Problem {
    /// The parts from number `free` on keep the amplitude that they are given.
    pub fn new(power: Vec<Vec<f64>>, centres_octaves: &[f64], free: usize) -> Self {
        let mut smooth = vec![0.0; free * free];
        for i in 0..free {
            for j in 0..free {
                let distance = (centres_octaves[i] - centres_octaves[j]) / SMOOTH_OCTAVES;
                smooth[i * free + j] = (-0.5 * distance * distance).exp();
            }
            smooth[i * free + i] += OWN_SHARE;
        }
        Self { power, smooth, parts: centres_octaves.len(), free }
    }

    /// Number of parts whose amplitude is sought.
    pub fn free(&self) -> usize {
        self.free
    }
}

/// What [`solve`] finds.
pub(crate) struct Solution {
    /// Amplitude of each part.
    pub amplitudes: Vec<f64>,
    /// Gain of each band in dB.
    pub realised_db: Vec<f64>,
}

/// Finds amplitudes `a`, near the start, for which `10 log10(a' P_b a)` is the wanted gain in each band `b`.
///
/// With the gain in amplitude f_b = sqrt(a' P_b a) / wanted_b, each step solves f + J s = 1 for the step s that is least in the
/// norm of smooth relative changes: s = K J' (J K J')^-1 (1 - f), and is halved until it helps. The best amplitudes met are returned.
pub(crate) fn solve(problem: &Problem, wanted_db: &[f64], start_db: &[f64]) -> Solution {
    let (bands, free) = (wanted_db.len(), problem.free);
    let start: Vec<f64> = start_db.iter().map(|db| 10f64.powf(db / 20.0)).collect();
    let wanted: Vec<f64> = wanted_db.iter().map(|db| 10f64.powf(db / 20.0)).collect();
    let mut now = State::new(bands, problem.parts);
    now.amplitudes.copy_from_slice(&start);
    now.evaluate(problem, &wanted);
    let (mut tried, mut best) = (now.clone(), now.clone());
    let mut slopes = vec![0.0; bands * free];
    let mut directions = vec![0.0; bands * free];
    let mut step = vec![0.0; free];
    for _ in 0..STEPS {
        if now.gains.iter().all(|f| (20.0 * f.log10()).abs() < CLOSE_DB) {
            break;
        }
        // Slopes of the gains in the relative amplitudes, and their smooth counterparts.
        for b in 0..bands {
            let (slope, direction) = (&mut slopes[b * free..][..free], &mut directions[b * free..][..free]);
            for i in 0..free {
                slope[i] =
                    now.products[b * problem.parts + i] * start[i] / (wanted[b] * wanted[b] * now.gains[b]);
            }
            for (direction, row) in direction.iter_mut().zip(problem.smooth.chunks_exact(free)) {
                *direction = dot(row, slope);
            }
        }
        let mut normal = [[0.0; MOST_BANDS]; MOST_BANDS];
        let mut multipliers = [0.0; MOST_BANDS];
        for b in 0..bands {
            for c in 0..bands {
                normal[b][c] = dot(&slopes[b * free..][..free], &directions[c * free..][..free]);
            }
            multipliers[b] = 1.0 - now.gains[b];
        }
        let trace: f64 = (0..bands).map(|b| normal[b][b]).sum();
        for (b, row) in normal.iter_mut().enumerate().take(bands) {
            row[b] += 1e-6 * trace / bands as f64;
        }
        solve_in_place(&mut normal, &mut multipliers, bands);
        step.fill(0.0);
        for b in 0..bands {
            for (s, d) in step.iter_mut().zip(&directions[b * free..][..free]) {
                *s += multipliers[b] * d;
            }
        }
        let mut share = 1.0;
        loop {
            for i in 0..free {
                tried.amplitudes[i] = now.amplitudes[i] + share * step[i] * start[i];
            }
            tried.evaluate(problem, &wanted);
            if tried.cost() < now.cost() || share < LEAST_SHARE {
                break;
            }
            share *= 0.5;
        }
        std::mem::swap(&mut now, &mut tried);
        if now.cost() < best.cost() {
            best.clone_from(&now);
        }
    }
    let now = best;
    let realised_db = now.gains.iter().zip(wanted_db).map(|(f, db)| 20.0 * f.log10() + db).collect();
    Solution { amplitudes: now.amplitudes, realised_db }
}

#[derive(Clone)]
struct State {
    amplitudes: Vec<f64>,
    /// `P_b a` for each band.
    products: Vec<f64>,
    /// Gain of each band in amplitude, relative to the one wanted.
    gains: Vec<f64>,
}

impl State {
    fn new(bands: usize, parts: usize) -> Self {
        Self { amplitudes: vec![0.0; parts], products: vec![0.0; bands * parts], gains: vec![0.0; bands] }
    }

    fn evaluate(&mut self, problem: &Problem, wanted: &[f64]) {
        let n = problem.parts;
        for (b, form) in problem.power.iter().enumerate() {
            let products = &mut self.products[b * n..][..n];
            for (product, row) in products.iter_mut().zip(form.chunks_exact(n)) {
                *product = dot(row, &self.amplitudes);
            }
            // A quadratic form of powers is not negative but for rounding.
            self.gains[b] = dot(products, &self.amplitudes).max(f64::MIN_POSITIVE).sqrt() / wanted[b];
        }
    }

    fn cost(&self) -> f64 {
        self.gains.iter().map(|f| (1.0 - f) * (1.0 - f)).sum()
    }
}

/// Solves a symmetric positive definite system of `n` equations by elimination; the solution replaces the right-hand side.
fn solve_in_place(matrix: &mut [[f64; MOST_BANDS]; MOST_BANDS], rhs: &mut [f64; MOST_BANDS], n: usize) {
    for i in 0..n {
        let pivot = matrix[i];
        for row in i + 1..n {
            let factor = matrix[row][i] / pivot[i];
            for (x, p) in matrix[row].iter_mut().zip(&pivot) {
                *x -= factor * p;
            }
            rhs[row] -= factor * rhs[i];
        }
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| matrix[i][j] * rhs[j]).sum();
        rhs[i] = (rhs[i] - known) / matrix[i][i];
    }
}
