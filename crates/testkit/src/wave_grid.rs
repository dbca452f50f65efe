//! The wave equation in a box with a thin screen, by finite differences.

use crate::geometry::Vec3;
use rayon::prelude::*;
use realfft::num_complex::Complex;
use sabine_acoustics::RealTransforms;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// Planes of cells that one thread takes at a time, at least.
const PLANES: usize = 4;
/// Samples after which a rotating pointer is set right.
const TURNS: usize = 64;
/// Order of the zero that the source's pulse has at the grid's highest frequency: waves from cell to cell find no absorption, and would
/// ring to the end.
const SMOOTH: i32 = 16;
/// Squared Courant number: the largest that is stable, at which waves along the diagonals run without dispersion.
const COURANT_SQUARE: f64 = 1.0 / 3.0;

/// A flat rectangle without thickness, between two layers of cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinScreen {
    /// The axis that it is perpendicular to.
    pub axis: usize,
    /// Cells before it along that axis.
    pub after: usize,
    /// Cells before it along the other two axes, in rising order of the axes.
    pub from: [usize; 2],
    /// Cells before its end along them.
    pub to: [usize; 2],
    /// Specific admittance of both of its sides; 0 is rigid.
    pub admittance: f64,
}

/// A box of cubic cells with one corner at the origin, its walls locally reacting with a real specific admittance each (air's rho c
/// over the wall's impedance), in the order x = 0, x = length, y = 0, y = width, z = 0, z = height; in it, thin screens.
///
/// Finite volumes: each cell's pressure follows from the differences to its neighbours; walls and screens lie on faces of
/// cells, where the difference is that which the admittance lets through. For cubes this is the standard leapfrog scheme at a Courant number
/// of 1 / sqrt(3), second order in cell and time. Waves of ten cells run too slowly by 1 % along the axes and at their speed along
/// the diagonals. What is the same in all directions of this is taken out: the sound at a frequency is read at that frequency of the grid
/// whose waves have the right length in the mean over directions.
///
/// No loss in air. The same on any number of threads.
///
/// References: D. Botteldooren, JASA 98 (1995) 3302 (finite differences in rooms); L. Savioja and V. Välimäki, IEEE Trans. Speech
/// Audio Proc. 11 (2003) 184 (frequency warping against dispersion); S. Bilbao, B. Hamilton et al., IEEE/ACM Trans. ASLP 24
/// (2016) 1177 (finite volumes, passive walls).
#[derive(Clone, Debug)]
pub struct WaveGrid {
    cells: [usize; 3],
    cell_m: f64,
    speed_m_s: f64,
    /// Cells with a face that is closed, by their place in the plane; one map for each plane along z.
    closed: Vec<BTreeMap<usize, Closed>>,
}

/// The closed faces of a cell.
#[derive(Clone, Copy, Debug, Default)]
struct Closed {
    /// Neighbours that are cut off, towards lower and higher x, y, z.
    faces: [bool; 6],
    /// Sum of the faces' admittances.
    admittance: f64,
}

impl WaveGrid {
    /// A box of so many cells of this side, with the admittances (0 or more) of its walls and a speed of sound.
    ///
    /// # Panics
    /// If an axis has no cell, or a number is negative or not finite.
    pub fn new(cells: [usize; 3], cell_m: f64, admittances: [f64; 6], speed_m_s: f64) -> Self {
        assert!(cells.iter().all(|&n| n > 0) && cell_m > 0.0 && speed_m_s > 0.0, "{cells:?} {cell_m}");
        let mut grid = Self { cells, cell_m, speed_m_s, closed: vec![BTreeMap::new(); cells[2]] };
        for axis in 0..3 {
            let [a, b] = Self::others(axis);
            for i in 0..cells[a] {
                for j in 0..cells[b] {
                    for end in 0..2 {
                        let mut cell = [0; 3];
                        (cell[a], cell[b]) = (i, j);
                        cell[axis] = end * (cells[axis] - 1);
                        grid.close(cell, 2 * axis + end, admittances[2 * axis + end]);
                    }
                }
            }
        }
        grid
    }

    /// The same with a screen.
    ///
    /// # Panics
    /// If the screen is not between cells of the box.
    #[must_use]
    pub fn with_screen(mut self, screen: &ThinScreen) -> Self {
        let ThinScreen { axis, after, from, to, admittance } = *screen;
        let [a, b] = Self::others(axis);
        assert!((1..self.cells[axis]).contains(&after), "{screen:?}");
        assert!(to[0] <= self.cells[a] && to[1] <= self.cells[b], "{screen:?}");
        for i in from[0]..to[0] {
            for j in from[1]..to[1] {
                let mut cell = [0; 3];
                (cell[a], cell[b], cell[axis]) = (i, j, after);
                self.close(cell, 2 * axis, admittance);
                cell[axis] -= 1;
                self.close(cell, 2 * axis + 1, admittance);
            }
        }
        self
    }

    fn others(axis: usize) -> [usize; 2] {
        [[1, 2], [0, 2], [0, 1]][axis]
    }

    fn close(&mut self, cell: [usize; 3], face: usize, admittance: f64) {
        assert!(admittance >= 0.0 && admittance.is_finite(), "admittance {admittance}");
        let place = self.place(cell);
        let closed = self.closed[cell[2]].entry(place).or_default();
        closed.faces[face] = true;
        closed.admittance += admittance;
    }

    /// Place of a cell in its plane, which has a margin of one cell all around.
    fn place(&self, cell: [usize; 3]) -> usize {
        (cell[1] + 1) * (self.cells[0] + 2) + cell[0] + 1
    }

    /// Sides in metres.
    pub fn size_m(&self) -> Vec3 {
        self.cells.map(|n| n as f64 * self.cell_m)
    }

    /// Side of a cell in metres.
    pub fn cell_m(&self) -> f64 {
        self.cell_m
    }

    /// The middle of a cell in metres.
    pub fn centre_m(&self, cell: [usize; 3]) -> Vec3 {
        cell.map(|i| (i as f64 + 0.5) * self.cell_m)
    }

    /// Steps in a second.
    pub fn rate_hz(&self) -> f64 {
        self.speed_m_s / (self.cell_m * COURANT_SQUARE.sqrt())
    }

    /// What a point source in the middle of one cell sends to others, for so long.
    ///
    /// # Panics
    /// If a cell is outside.
    pub fn respond(
        &self,
        source: [usize; 3],
        receivers: &[[usize; 3]],
        duration_s: f64,
    ) -> Vec<GridResponse> {
        assert!(receivers.iter().chain([&source]).all(|c| (0..3).all(|a| c[a] < self.cells[a])), "outside");
        let (row, plane) = (self.cells[0] + 2, (self.cells[0] + 2) * (self.cells[1] + 2));
        let steps = (duration_s * self.rate_hz()).ceil() as usize;
        let at = |cell: [usize; 3]| (cell[2] + 1) * plane + self.place(cell);
        // A plane of zeros on either side, as in each plane a margin: what lies beyond a wall.
        let mut now = vec![0.0f32; plane * (self.cells[2] + 2)];
        let mut next = now.clone();
        let closed: Vec<Vec<(usize, [bool; 6], f32)>> = self
            .closed
            .iter()
            .map(|plane| {
                // Half the Courant number times the admittance.
                let loss = |c: &Closed| (0.5 * COURANT_SQUARE.sqrt() * c.admittance) as f32;
                plane.iter().map(|(&i, c)| (i, c.faces, loss(c))).collect()
            })
            .collect();
        let steps_to = [-1, 1, -(row as isize), row as isize, -(plane as isize), plane as isize];
        let share = COURANT_SQUARE as f32;
        let pulse = pulse().map(|p| (4.0 * PI * COURANT_SQUARE / self.cell_m * p) as f32);
        let mut found: Vec<Vec<f32>> = vec![Vec::with_capacity(steps); receivers.len()];
        for step in 0..steps {
            found.iter_mut().zip(receivers).for_each(|(f, &r)| f.push(now[at(r)]));
            // What is there before is the pressure one step ago.
            next.par_chunks_mut(plane).with_min_len(PLANES).enumerate().for_each(|(z, out)| {
                if z == 0 || z > self.cells[2] {
                    return;
                }
                for y in 1..=self.cells[1] {
                    let first = z * plane + y * row + 1;
                    let beside = |by: isize| &now[first.wrapping_add_signed(by)..][..self.cells[0]];
                    let [a, b, c, d, e, f] = steps_to.map(beside);
                    let out = &mut out[y * row + 1..][..self.cells[0]];
                    for i in 0..out.len() {
                        out[i] = share * (((a[i] + b[i]) + (c[i] + d[i])) + (e[i] + f[i])) - out[i];
                    }
                }
                for &(place, faces, loss) in &closed[z - 1] {
                    let here = z * plane + place;
                    let around = steps_to.map(|by| now[here.wrapping_add_signed(by)]);
                    let sum = ((around[0] + around[1]) + (around[2] + around[3])) + (around[4] + around[5]);
                    let before = share * sum - out[place];
                    let shut: f32 = (0..6).filter(|&f| faces[f]).map(|f| now[here] - around[f]).sum();
                    out[place] = (out[place] + share * shut + loss * before) / (1.0 + loss);
                }
            });
            if let Some(&sent) = pulse.get(step) {
                next[at(source)] += sent;
            }
            std::mem::swap(&mut now, &mut next);
        }
        found
            .into_iter()
            .map(|samples| GridResponse {
                samples,
                rate_hz: self.rate_hz(),
                cell_m: self.cell_m,
                speed_m_s: self.speed_m_s,
            })
            .collect()
    }
}

/// What the source sends: (1 - z) ((1 + z) / 2)^SMOOTH, z being a step's delay. No constant pressure is left behind.
fn pulse() -> [f64; SMOOTH as usize + 2] {
    let mut found = [0.0; SMOOTH as usize + 2];
    found[0] = 1.0;
    for _ in 0..SMOOTH {
        (1..found.len()).rev().for_each(|i| found[i] = 0.5 * (found[i] + found[i - 1]));
        found[0] *= 0.5;
    }
    (1..found.len()).rev().for_each(|i| found[i] -= found[i - 1]);
    found
}

/// The sound at one cell, by steps of the grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridResponse {
    samples: Vec<f32>,
    rate_hz: f64,
    cell_m: f64,
    speed_m_s: f64,
}

impl GridResponse {
    /// The frequency at which the grid's waves have the length that sound has at this one, in the mean over directions:
    /// sin^2(w dt / 2) = (1 - sin(k h) / (k h)) / 2; and how much less than the grid's the amplitude of a point source's sound is: the
    /// slope of its square over that of k^2.
    fn grid_hz(&self, hz: f64) -> (f64, f64) {
        let phase = TAU * hz / self.speed_m_s * self.cell_m;
        assert!(phase < 0.5 * PI, "{hz} Hz is too high for cells of {} m", self.cell_m);
        // For small phases the differences have no digits left.
        let (square, less) = if phase < 1e-2 {
            (phase * phase / 12.0, 1.0)
        } else {
            let (sine, cosine) = phase.sin_cos();
            (0.5 * (1.0 - sine / phase), 3.0 * (sine - phase * cosine) / phase.powi(3))
        };
        (square.sqrt().asin() / PI * self.rate_hz, less)
    }

    /// The response from 0 s on at another rate, of so many samples: what lies between the frequencies `pass_hz`, with edges of a raised
    /// cosine from the first to the second and from the third to the fourth; zero phase.
    ///
    /// # Panics
    /// If the highest frequency is above half the rate, or has less than four cells in a wave.
    pub fn impulse_response(&self, sample_rate_hz: u32, samples: usize, pass_hz: [f64; 4]) -> Vec<f64> {
        let rate = f64::from(sample_rate_hz);
        assert!(pass_hz[3] <= 0.5 * rate, "{pass_hz:?}");
        // Twice as long: what the filter's ringing puts before the beginning does not come back at the end.
        let size = 2 * samples.max(self.length(rate));
        let inverse = RealTransforms::<f64>::new(size).inverse;
        let mut spectrum = inverse.make_input_vec();
        let edge = |hz: f64, low: f64, high: f64| {
            0.5 - 0.5 * (PI * ((hz - low) / (high - low)).clamp(0.0, 1.0)).cos()
        };
        spectrum.par_iter_mut().enumerate().for_each(|(i, line)| {
            let hz = i as f64 * rate / size as f64;
            let gain = edge(hz, pass_hz[0], pass_hz[1]) * (1.0 - edge(hz, pass_hz[2], pass_hz[3]));
            if gain > 0.0 {
                let (re, im) = self.pressure(hz);
                *line = Complex::new(gain * re, gain * im) / size as f64;
            }
        });
        let mut found = inverse.make_output_vec();
        // The plan made both buffers, and the ends have no imaginary part: they are zero.
        let _ = inverse.process(&mut spectrum, &mut found);
        found.truncate(samples);
        found
    }

    /// Its length in samples of a rate.
    fn length(&self, rate_hz: f64) -> usize {
        (self.samples.len() as f64 / self.rate_hz * rate_hz).ceil() as usize
    }

    /// Pressure at a frequency, 1 = direct sound at 1 m; time runs as exp(+ j omega t).
    ///
    /// # Panics
    /// If sound has less than four cells in a wave.
    pub fn pressure(&self, hz: f64) -> (f64, f64) {
        let (grid_hz, less) = self.grid_hz(hz);
        let angle = TAU * grid_hz / self.rate_hz;
        // A rotating pointer, set right again and again.
        let (turn_im, turn_re) = (-angle).sin_cos();
        let (mut re, mut im) = (0.0, 0.0);
        for (block, samples) in self.samples.chunks(TURNS).enumerate() {
            let (mut at_im, mut at_re) = (-angle * (block * TURNS) as f64).sin_cos();
            for &s in samples {
                re += f64::from(s) * at_re;
                im += f64::from(s) * at_im;
                (at_re, at_im) = (at_re * turn_re - at_im * turn_im, at_re * turn_im + at_im * turn_re);
            }
        }
        // Over the source's: 2 j sin(angle / 2) cos(angle / 2)^SMOOTH, late by half of its steps.
        let size = 2.0 * (0.5 * angle).sin() * (0.5 * angle).cos().powi(SMOOTH) / less;
        let (late_im, late_re) = (0.5 * angle * f64::from(SMOOTH + 1)).sin_cos();
        let (re, im) = (re * late_re - im * late_im, re * late_im + im * late_re);
        (im / size, -re / size)
    }
}
