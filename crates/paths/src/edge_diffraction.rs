//! Sound around an edge: first-order diffraction by a rigid wedge.

use sabine_acoustics::{Bands, Error, OutOfRange};
use std::f64::consts::{PI, TAU};

/// A point in cylindrical coordinates about an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgePoint {
    /// Distance from the edge's line, in metres.
    pub radius_m: f64,
    /// Angle from one face of the wedge, through the air, in radians.
    pub angle_rad: f64,
    /// Position along the edge's line, in metres.
    pub along_m: f64,
}

/// The way from a source around an edge into its shadow, for point source, point receiver and a rigid wedge.
///
/// # Theory
/// The exact impulse response of the wedge (Biot and Tolstoy 1957, Medwin 1981) as an integral over the edge, by Svensson,
/// Fred and Vanderkooy (JASA 106(5), 1999), which holds for the visible part of a finite edge too; here in the frequency
/// domain (Svensson, Calamia and Nakanishi, Acta Acustica 95, 2009):
///
/// ```text
/// p(k) = -nu/(4 pi) int  sum_i beta_i  exp(-jk (m + l)) / (m l)  dz          (free field: exp(-jkR) / R)
/// beta_i = sin(nu phi_i) / (cosh(nu eta) - cos(nu phi_i)),   phi_i = pi +- theta_S +- theta_R,   nu = pi / open angle
/// ```
///
/// with m and l the distances of the edge point z from source and receiver. It is taken over eta instead of z:
/// eta = asinh((z - z_S) / r_S) + asinh((z - z_R) / r_R), in which dz / (m l) = d eta / (m + l) and
/// (m + l)2 = (z_S - z_R)2 + r_S2 + r_R2 + 2 r_S r_R cosh eta. So the wedge enters by beta(eta) alone, whose peak near the
/// shadow boundary is resolved by sinh spacing. Unlike the uniform theory of diffraction (Kouyoumjian and Pathak 1974) it is
/// neither asymptotic nor bound to an edge without ends.
///
/// Within 0.05 dB of Macdonald's solution for the half plane from 62.5 Hz to 8 kHz (`tests/diffraction.rs` of
/// `sabine-propagate`).
///
/// # What it leaves out
/// Absorption of the faces, more than one edge, and the field where the source is in sight.
///
/// ```
/// use sabine_paths::{EdgeDiffraction, EdgePoint};
/// use std::f64::consts::{PI, TAU};
/// // A thin screen, both ends 3 m away from its edge and bent by 30 degrees into the shadow; 20 m of edge.
/// let end = |angle_rad| EdgePoint { radius_m: 3.0, angle_rad, along_m: 10.0 };
/// let bend = PI / 6.0;
/// let screen = EdgeDiffraction::new(TAU, end(PI / 4.0), end(PI / 4.0 + PI + bend), &[[0.0, 20.0]])?;
/// assert_eq!(screen.length_m(), 6.0);
/// let level_db = |hz| 10.0 * screen.energy_gain(hz, 343.2).log10();
/// // Fresnel numbers 0.075 and 4.8: 6 and 20 dB by the formula of Kurze and Anderson (1971).
/// assert!((level_db(62.5) + 6.0).abs() < 1.0 && (level_db(4000.0) + 20.0).abs() < 1.0);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeDiffraction {
    /// nu.
    index: f64,
    /// phi_1 ... phi_4.
    angles_rad: [f64; 4],
    /// (z_S - z_R)2 + r_S2 + r_R2.
    square_m2: f64,
    /// 2 r_S r_R.
    product_m2: f64,
    /// Visible parts of the edge, in eta.
    visible: Vec<[f64; 2]>,
    /// Where the shortest way bends.
    bend_m: f64,
    length_m: f64,
    /// Energy gain by wave number: `FIRST_PER_M` and what follows it.
    table: Vec<f32>,
}

/// First wave number of the table (1/m): 21 Hz in air at 20 C ...
const FIRST_PER_M: f64 = 0.39;
/// ... the octaves that follow, up to 22 kHz ...
const OCTAVES: usize = 10;
/// ... and the evenly spaced wave numbers in each.
const STEPS: usize = 8;
/// Values over which the mean of an octave is taken.
const MEAN_OF: usize = 32;
/// Longest panel of the quadrature, in the stretched eta ...
const PANEL: f64 = 1.0;
/// ... and in phase (rad): eight Gauss points integrate a wave train of that length to 1e-5.
const PANEL_RAD: f64 = 12.0;
/// Abscissae and weights of Gauss and Legendre's quadrature with eight points (Abramowitz and Stegun 1964, table 25.4).
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_650, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887),
    (0.796_666_477_413_627, 0.222_381_034_453_374),
    (0.960_289_856_497_536, 0.101_228_536_290_376),
];

impl EdgeDiffraction {
    /// The way around an edge whose wedge of air opens by `open_angle_rad` (above pi, at most two pi: a thin screen), over the
    /// parts of the edge `visible_m` that both ends see, in metres along its line.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an open angle outside this range, an end within 1 um of the line, beyond 100 km or within the
    /// solid, ends that are not in each other's shadow (their angles differ by pi or less), or a part whose end precedes its
    /// beginning; [`Error::Empty`] without a visible part.
    pub fn new(
        open_angle_rad: f64,
        source: EdgePoint,
        receiver: EdgePoint,
        visible_m: &[[f64; 2]],
    ) -> Result<Self, Error> {
        OutOfRange::check("open angle of the wedge (rad)", open_angle_rad, PI, TAU, "between pi and 2 pi")?;
        for end in [source, receiver] {
            OutOfRange::check(
                "distance from the edge (m)",
                end.radius_m,
                1e-6,
                1e5,
                "between 1 um and 100 km",
            )?;
            OutOfRange::check(
                "angle about the edge (rad)",
                end.angle_rad,
                0.0,
                open_angle_rad,
                "outside the solid",
            )?;
            OutOfRange::check("position along the edge (m)", end.along_m, -1e5, 1e5, "within 100 km")?;
        }
        let between = (source.angle_rad - receiver.angle_rad).abs();
        let shadow = "above pi: in each other's shadow";
        OutOfRange::check("angle between the ends (rad)", between, PI * (1.0 + f64::EPSILON), TAU, shadow)?;
        if visible_m.is_empty() {
            return Err(Error::Empty { what: "list of visible parts of an edge" });
        }
        for &[from, to] in visible_m {
            OutOfRange::check("position along the edge (m)", from, -1e5, 1e5, "within 100 km")?;
            OutOfRange::check("end of a visible part (m)", to, from, 1e5, "at or after its beginning")?;
        }
        let eta = |along_m: f64| {
            let from = |end: EdgePoint| ((along_m - end.along_m) / end.radius_m).asinh();
            from(source) + from(receiver)
        };
        // Where the unfolded way is straight, or the visible point next to it.
        let straight_m = (source.along_m * receiver.radius_m + receiver.along_m * source.radius_m)
            / (source.radius_m + receiver.radius_m);
        let bend_m = visible_m
            .iter()
            .map(|&[from, to]| straight_m.clamp(from, to))
            .min_by(|a, b| (a - straight_m).abs().total_cmp(&(b - straight_m).abs()))
            .unwrap_or(straight_m);
        let sum = source.angle_rad + receiver.angle_rad;
        let along_m = source.along_m - receiver.along_m;
        let radii_m2 = source.radius_m * source.radius_m + receiver.radius_m * receiver.radius_m;
        let leg = |end: EdgePoint| end.radius_m.hypot(bend_m - end.along_m);
        let mut diffraction = Self {
            index: PI / open_angle_rad,
            angles_rad: [PI - between, PI + between, PI - sum, PI + sum],
            square_m2: along_m * along_m + radii_m2,
            product_m2: 2.0 * source.radius_m * receiver.radius_m,
            visible: visible_m.iter().map(|&[from, to]| [eta(from), eta(to)]).collect(),
            bend_m,
            length_m: leg(source) + leg(receiver),
            table: Vec::new(),
        };
        diffraction.table = diffraction.tabulated();
        Ok(diffraction)
    }

    /// Length of the shortest way over the visible edge, in metres: when its sound arrives.
    pub fn length_m(&self) -> f64 {
        self.length_m
    }

    /// Where the shortest way bends, in metres along the edge's line.
    pub fn bend_m(&self) -> f64 {
        self.bend_m
    }

    /// Energy at a frequency relative to that of an undisturbed way of the same length; 1/4 at the edge of the shadow of an edge
    /// without ends.
    ///
    /// Good for any frequency above zero, at a cost that grows with it.
    pub fn energy_gain(&self, frequency_hz: f64, speed_m_s: f64) -> f64 {
        self.gains(TAU * frequency_hz / speed_m_s, 0.0)[0]
    }

    /// Mean of [`EdgeDiffraction::energy_gain`] over a band, from eight values per octave that are computed once: a change
    /// of speed or bands costs nothing. Beyond 21 Hz and 22 kHz the last value holds.
    ///
    /// # Panics
    /// If `band` is not one of `bands`.
    pub fn band_energy_gain(&self, bands: Bands, band: usize, speed_m_s: f64) -> f64 {
        let (low_hz, high_hz) = bands.edges_hz(band);
        let step_hz = (high_hz - low_hz) / MEAN_OF as f64;
        let sum: f64 = (0..MEAN_OF)
            .map(|i| self.looked_up(TAU * (low_hz + (i as f64 + 0.5) * step_hz) / speed_m_s))
            .sum();
        sum / MEAN_OF as f64
    }

    fn looked_up(&self, wave_number_per_m: f64) -> f64 {
        let ratio = (wave_number_per_m / FIRST_PER_M).max(1.0);
        let octave = ratio.log2().floor();
        let place = STEPS as f64 * (octave + ratio / octave.exp2() - 1.0);
        let below = (place as usize).min(self.table.len() - 2);
        let (low, high) = (f64::from(self.table[below]), f64::from(self.table[below + 1]));
        low + (high - low) * (place - below as f64).min(1.0)
    }

    fn tabulated(&self) -> Vec<f32> {
        let mut table: Vec<f32> = (0..OCTAVES)
            .flat_map(|octave| {
                let first_per_m = FIRST_PER_M * (octave as f64).exp2();
                self.gains(first_per_m, first_per_m / STEPS as f64)
            })
            .map(|gain| gain as f32)
            .collect();
        table.push(self.gains(FIRST_PER_M * (OCTAVES as f64).exp2(), 0.0)[0] as f32);
        table
    }

    /// Energy gains at evenly spaced wave numbers.
    fn gains(&self, first_per_m: f64, step_per_m: f64) -> [f64; STEPS] {
        let highest_per_m = first_per_m + step_per_m * (STEPS - 1) as f64;
        let mut pressure = [(0.0, 0.0); STEPS];
        self.over_edge(highest_per_m, |path_m, weight| {
            // Phases relative to the shortest way: the same energy, and smaller numbers.
            let (late_m, weight) = (path_m - self.length_m, weight / path_m);
            let (sine, cosine) = (first_per_m * late_m).sin_cos();
            let (turn_sine, turn_cosine) = (step_per_m * late_m).sin_cos();
            let (mut re, mut im) = (weight * cosine, -weight * sine);
            for sum in &mut pressure {
                *sum = (sum.0 + re, sum.1 + im);
                (re, im) = (re * turn_cosine + im * turn_sine, im * turn_cosine - re * turn_sine);
            }
        });
        let scale = self.index / (4.0 * PI) * self.length_m;
        pressure.map(|(re, im)| scale * scale * (re * re + im * im))
    }

    /// Calls `node(m + l, weight)` with the nodes and weights that integrate beta d eta over the visible edge, closely enough
    /// for waves up to `highest_per_m`.
    fn over_edge(&self, highest_per_m: f64, mut node: impl FnMut(f64, f64)) {
        let width = self.peak_width();
        let stretched = |eta: f64| (eta / width).asinh();
        for &[from, to] in &self.visible {
            // The path is shortest at eta = 0 and grows to either side.
            let middle = 0f64.clamp(from, to);
            let mut panels = vec![(stretched(from), stretched(middle)), (stretched(middle), stretched(to))];
            while let Some((a, b)) = panels.pop() {
                let phase = highest_per_m * (self.path_m(width * b.sinh()) - self.path_m(width * a.sinh()));
                let middle = 0.5 * (a + b);
                if (b - a > PANEL || phase.abs() > PANEL_RAD) && a < middle && middle < b {
                    panels.extend([(a, middle), (middle, b)]);
                    continue;
                }
                let half = 0.5 * (b - a);
                for (at, weight) in GAUSS {
                    for u in [middle - half * at, middle + half * at] {
                        let eta = width * u.sinh();
                        node(self.path_m(eta), weight * half * width * u.cosh() * self.beta(eta));
                    }
                }
            }
        }
    }

    /// m + l.
    fn path_m(&self, eta: f64) -> f64 {
        (self.square_m2 + self.product_m2 * eta.cosh()).sqrt()
    }

    /// Sum of the four terms; each denominator as a sum of squares, for it may be small.
    fn beta(&self, eta: f64) -> f64 {
        let squared = |x: f64| x * x;
        let hyperbolic = squared((0.5 * self.index * eta).sinh());
        let term = |&phi: &f64| {
            let (sine, cosine) = (0.5 * self.index * phi).sin_cos();
            sine * cosine / (hyperbolic + squared(sine))
        };
        self.angles_rad.iter().map(term).sum()
    }

    /// Width of the narrowest of the four peaks in eta.
    fn peak_width(&self) -> f64 {
        let width = |&phi: &f64| 2.0 / self.index * (0.5 * self.index * phi).sin().abs();
        self.angles_rad.iter().map(width).fold(1.0, f64::min).max(1e-12)
    }
}
