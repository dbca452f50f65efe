//! Synthetic room impulse responses.

use crate::band_split::BandSplit;
use crate::error::{Error, check, check_span};
use crate::seed::generator;
use crate::spectral_shape::{air_limits_s, drawn_curve_db, eq_curve_db, t60_shape};
use rand::Rng;
use rand_distr::{Distribution, Exp1, StandardNormal};
use rand_pcg::Pcg64;
use realfft::num_complex::Complex32;
use sabine_acoustics::{Bands, ImpulseResponse};
use std::f64::consts::PI;

/// Speed of sound at 20 C, m/s; the rooms drawn here do not turn on a tenth of a degree.
const SOUND_M_S: f64 = 343.2;
/// Nepers in 60 dB of energy: energy falls as exp(-13.8 t / T60).
const SIXTY_DB: f64 = 13.815_510_557_964_274;

/// Responses are multiples of this long, in samples.
const LENGTH_STEP: usize = 2048;

/// From which rooms to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct SyntheticRoomConfig {
    /// Sample rate of the responses, 8 to 48 kHz. Default 16 kHz.
    pub sample_rate_hz: u32,
    /// Range of reverberation times about 1 kHz from which most rooms are drawn uniformly, in seconds. Default 0.1 to 1.5.
    pub t60_s: (f64, f64),
    /// Upper end of a tail of longer times, in seconds. Default 2.5.
    pub longest_t60_s: f64,
    /// Fraction of rooms in that tail, 0 to 1. Default 0.15.
    pub long_fraction: f64,
    /// Fraction of rooms whose ratio of direct to reverberant energy is drawn uniformly from
    /// [`SyntheticRoomConfig::drr_db`]; the others keep the ratio of their geometry plus a random directivity. Default 0.4.
    pub drr_drawn_fraction: f64,
    /// Range of the drawn ratios in dB. Default -6 to 18 (Bryan 2020).
    pub drr_db: (f64, f64),
    /// Factor on the spread of the equalisation against that of real responses. Default 1.3.
    pub eq_inflation: f64,
    /// Fraction of rooms with a second, slower and weaker decay. Default 0.1.
    pub double_slope_fraction: f64,
    /// Fraction of responses that end in a noise floor. Default 0.25.
    pub noise_floor_fraction: f64,
    /// The longest response, in seconds: 0.1 to 10. Default 2.5.
    pub longest_s: f64,
}

impl Default for SyntheticRoomConfig {
    fn default() -> Self {
        Self {
            sample_rate_hz: 16_000,
            t60_s: (0.1, 1.5),
            longest_t60_s: 2.5,
            long_fraction: 0.15,
            drr_drawn_fraction: 0.4,
            drr_db: (-6.0, 18.0),
            eq_inflation: 1.3,
            double_slope_fraction: 0.1,
            noise_floor_fraction: 0.25,
            longest_s: 2.5,
        }
    }
}

/// Draws plausible room responses at some hundreds a second: a random box with its image sources up to the second order,
/// a tail of random arrivals whose density grows as in a real room until it is noise, a decay of its own in every octave,
/// and the colour of a loudspeaker and a microphone.
///
/// They are for training sets, not for prediction: no room is solved. What a response sounds like is to be measured on it
/// ([`crate::Labels::measure`]), not taken from what was drawn.
///
/// The energy of the tail against the direct sound is that of a diffuse field, 4 pi c / V per second against 1 / d^2
/// (Kuttruff, Room Acoustics, 5.1), so distance, volume and reverberation time set the ratio together.
pub struct SyntheticRooms {
    config: SyntheticRoomConfig,
    splits: Vec<BandSplit>,
    air_s: Vec<f64>,
}

/// A room as drawn, before it becomes a response.
struct Drawn {
    t60_s: Vec<f64>,
    size_m: [f64; 3],
    source_m: [f64; 3],
    receiver_m: [f64; 3],
}

impl SyntheticRooms {
    /// Checks the configuration and plans the transforms.
    ///
    /// # Errors
    /// [`Error::Setting`] naming the setting that is out of range.
    pub fn new(config: SyntheticRoomConfig) -> Result<Self, Error> {
        check("sample_rate_hz", f64::from(config.sample_rate_hz), 8e3, 48e3, "between 8 and 48 kHz")?;
        check_span("t60_s", config.t60_s, 0.05, 10.0, "a rising range within 0.05 to 10 s")?;
        check(
            "longest_t60_s",
            config.longest_t60_s,
            config.t60_s.1,
            10.0,
            "between the end of t60_s and 10 s",
        )?;
        for (field, value) in [
            ("long_fraction", config.long_fraction),
            ("drr_drawn_fraction", config.drr_drawn_fraction),
            ("double_slope_fraction", config.double_slope_fraction),
            ("noise_floor_fraction", config.noise_floor_fraction),
        ] {
            check(field, value, 0.0, 1.0, "between 0 and 1")?;
        }
        check_span("drr_db", config.drr_db, -40.0, 40.0, "a rising range within -40 to 40 dB")?;
        check("eq_inflation", config.eq_inflation, 0.0, 5.0, "between 0 and 5")?;
        check("longest_s", config.longest_s, 0.1, 10.0, "between 0.1 and 10 s")?;
        // One transform for each power of two, so that a short response costs little.
        let longest =
            ((config.longest_s * f64::from(config.sample_rate_hz)) as usize).next_multiple_of(LENGTH_STEP);
        let bands = Bands::SIMULATION;
        let mut splits = vec![BandSplit::new(bands, longest, config.sample_rate_hz)];
        while splits[0].length() > 8192 {
            let half = splits[0].length() / 2;
            splits.insert(0, BandSplit::new(bands, half - half / 16 - 64, config.sample_rate_hz));
        }
        Ok(Self { config, splits, air_s: air_limits_s(bands) })
    }

    /// The response of the room that belongs to this seed.
    ///
    /// # Errors
    /// [`Error::Transform`], which would be a defect of this crate.
    pub fn draw(&self, seed: u64) -> Result<ImpulseResponse, Error> {
        let rng = &mut generator(seed);
        let room = self.room(rng);
        let rate = f64::from(self.config.sample_rate_hz);
        let slowest = room.t60_s.iter().copied().fold(0.0, f64::max);
        let length_s = (0.1 + 1.05 * slowest).min(self.config.longest_s);
        // Few different lengths, so that few transforms are planned.
        let wanted = ((length_s * rate) as usize).next_multiple_of(LENGTH_STEP);
        let split = self.splits.iter().find(|s| wanted + wanted / 16 + 64 <= s.length());
        let split = split.unwrap_or(&self.splits[self.splits.len() - 1]);
        let samples = wanted.min(split.length());

        let arrivals = self.arrivals(rng, &room, samples);
        let second = (rng.random::<f64>() < self.config.double_slope_fraction)
            .then(|| (rng.random_range(1.5..3.0), 10f64.powf(rng.random_range(-3.0..-1.5) / 2.0)));
        let colour_db = eq_curve_db(rng, self.config.eq_inflation);
        let mut sum = vec![Complex32::new(0.0, 0.0); split.length() / 2 + 1];
        let images = images(&room, rng);
        // Energies of the late part and of a direct sound of amplitude one, both in the colour drawn.
        let (mut late_energy, mut direct_unit) = (0.0, 1e-12);
        for (band, &band_db) in colour_db.iter().enumerate() {
            let mut track = vec![0.0_f32; samples];
            let step = |t60: f64| (-0.5 * SIXTY_DB / (t60 * rate)).exp() as f32;
            let (fall, slow_fall) =
                (step(room.t60_s[band]), step(room.t60_s[band] * second.map_or(1.0, |s| s.0)));
            let slow_level = second.map_or(0.0, |s| s.1 as f32);
            let (mut envelope, mut slow) = (1.0_f32, slow_level);
            for (out, &arrival) in track.iter_mut().zip(&arrivals) {
                *out = arrival * (envelope + slow);
                envelope *= fall;
                slow *= slow_fall;
            }
            let alpha = mean_absorption(&room, band);
            for image in &images {
                let index = (image.distance_m / SOUND_M_S * rate).round() as usize;
                if index < samples {
                    let gain =
                        (1.0 - alpha * image.absorption_factor).max(0.05).powf(0.5 * f64::from(image.order));
                    track[index] += (gain / image.distance_m) as f32;
                }
            }
            let spectrum = split.spectrum(&track)?;
            let gain = 10f32.powf(band_db as f32 / 20.0);
            let share = f64::from(split.weights(band).iter().sum::<f32>()) / split.weights(band).len() as f64;
            let coloured = f64::from(gain).powi(2) * share;
            late_energy += track.iter().map(|s| f64::from(s * s)).sum::<f64>() * coloured;
            direct_unit += coloured;
            for ((total, s), w) in sum.iter_mut().zip(&spectrum).zip(split.weights(band)) {
                *total += s * (w * gain);
            }
        }
        let mut response = split.signal(sum, samples)?;
        self.place_direct(rng, &room, &colour_db, late_energy / direct_unit, split, &mut response)?;
        if rng.random::<f64>() < self.config.noise_floor_fraction {
            let peak = response.iter().fold(0.0_f32, |p, s| p.max(s.abs()));
            let level = peak * 10f32.powf(rng.random_range(-85.0..-55.0_f32) / 20.0);
            for s in &mut response {
                let noise: f32 = StandardNormal.sample(rng);
                *s += level * noise;
            }
        }
        let peak = response.iter().fold(1e-12_f32, |p, s| p.max(s.abs()));
        response.iter_mut().for_each(|s| *s /= peak);
        Ok(ImpulseResponse::new(response, self.config.sample_rate_hz)?)
    }

    /// Times, size and places.
    fn room(&self, rng: &mut Pcg64) -> Drawn {
        let config = &self.config;
        let mid_s = if rng.random::<f64>() < config.long_fraction && config.longest_t60_s > config.t60_s.1 {
            rng.random_range(config.t60_s.1..config.longest_t60_s)
        } else {
            rng.random_range(config.t60_s.0..=config.t60_s.1)
        };
        let t60_s = t60_shape(rng)
            .iter()
            .zip(&self.air_s)
            // Rates of decay add: walls and air.
            .map(|(shape, air_s)| (1.0 / (1.0 / (mid_s * shape) + 1.0 / air_s)).clamp(0.06, 4.0))
            .collect();
        // Larger rooms ring longer, loosely: a volume about 80 m3 at 0.4 s, spread over an order of magnitude.
        let spread: f64 = StandardNormal.sample(rng);
        let volume_m3 = (80.0 * (mid_s / 0.4_f64).powf(0.9) * (0.9 * spread).exp()).clamp(8.0, 8000.0);
        let (a, b) = (rng.random_range(1.0..1.8), rng.random_range(1.0..2.4));
        let height_m = (volume_m3 / (a * b)).cbrt().clamp(2.0, 12.0);
        let floor_m2 = volume_m3 / height_m;
        let width_m = (floor_m2 / (b / a)).sqrt();
        let size_m = [floor_m2 / width_m, width_m, height_m];
        let mut place = || size_m.map(|s| s * rng.random_range(0.1..0.9));
        let (source_m, mut receiver_m) = (place(), place());
        if distance(source_m, receiver_m) < 0.3 {
            receiver_m[0] += 0.4;
        }
        Drawn { t60_s, size_m, source_m, receiver_m }
    }

    /// Arrivals of the diffuse field without their decay: at first single ones, 4 pi c^3 t^2 / V a second (Kuttruff 4.1),
    /// at last white noise, with an energy of 4 pi c / V a second throughout.
    fn arrivals(&self, rng: &mut Pcg64, room: &Drawn, samples: usize) -> Vec<f32> {
        let rate = f64::from(self.config.sample_rate_hz);
        let volume = volume_m3(room);
        let direct_s = distance(room.source_m, room.receiver_m) / SOUND_M_S;
        let free_path_s = 4.0 * volume / (surface_m2(room) * SOUND_M_S);
        let amplitude = (4.0 * PI * SOUND_M_S / (volume * rate)).sqrt();
        let mut arrivals = vec![0.0; samples];
        let mut index = (direct_s * rate) as usize + 8;
        while index < samples {
            let t = index as f64 / rate;
            let density = 4.0 * PI * SOUND_M_S.powi(3) * t * t / volume / rate;
            // The image sources carry the first reflections: fade in over two free paths.
            let ramp = ((t - direct_s) / (2.0 * free_path_s)).min(1.0).sqrt();
            if density >= 1.0 {
                let noise: f64 = StandardNormal.sample(rng);
                arrivals[index] = (amplitude * ramp * noise) as f32;
                index += 1;
            } else {
                let noise: f64 = StandardNormal.sample(rng);
                arrivals[index] = (amplitude * ramp * noise / density.sqrt()) as f32;
                let gap: f64 = Exp1.sample(rng);
                index += (gap / density).ceil().max(1.0) as usize;
            }
        }
        arrivals
    }

    /// Adds the direct sound in the colour of the response, louder or weaker as directivity or the drawn ratio wants it.
    fn place_direct(
        &self,
        rng: &mut Pcg64,
        room: &Drawn,
        colour_db: &[f64],
        late_energy: f64,
        split: &BandSplit,
        response: &mut [f32],
    ) -> Result<(), Error> {
        let rate = f64::from(self.config.sample_rate_hz);
        let distance_m = distance(room.source_m, room.receiver_m);
        let directivity: f64 = StandardNormal.sample(rng);
        let amplitude = if rng.random::<f64>() < self.config.drr_drawn_fraction {
            let target_db = rng.random_range(self.config.drr_db.0..=self.config.drr_db.1);
            (late_energy * 10f64.powf(target_db / 10.0)).sqrt()
        } else {
            10f64.powf((3.0 + 3.0 * directivity) / 20.0) / distance_m
        };
        // Off the axis a loudspeaker or a talker loses treble: a tilt that the reverberation does not have.
        let tilt_db = drawn_curve_db(rng, 0.6, 0.5);
        let mut spectrum = vec![Complex32::new(0.0, 0.0); split.length() / 2 + 1];
        let delay = (distance_m / SOUND_M_S * rate).round();
        for band in 0..split.bands() {
            let gain = amplitude * 10f64.powf((colour_db[band] + tilt_db[band]) / 20.0);
            for (bin, (total, w)) in spectrum.iter_mut().zip(split.weights(band)).enumerate() {
                let phase = -2.0 * PI * (bin as f64 * delay / split.length() as f64).fract();
                *total += Complex32::from_polar((gain * f64::from(*w)) as f32, phase as f32);
            }
        }
        let direct = split.signal(spectrum, response.len())?;
        response.iter_mut().zip(direct).for_each(|(r, d)| *r += d);
        Ok(())
    }
}

/// A mirror image of the source.
struct Image {
    distance_m: f64,
    order: u32,
    absorption_factor: f64,
}

/// Images of the first and second order, each wall a little harder or softer than the mean.
fn images(room: &Drawn, rng: &mut Pcg64) -> Vec<Image> {
    let walls: [f64; 6] = std::array::from_fn(|_| rng.random_range(0.3..1.7));
    let mut images = Vec::with_capacity(24);
    for i in -2_i32..=2 {
        for j in -2_i32..=2 {
            for k in -2_i32..=2 {
                let n = [i, j, k];
                let order = n.iter().map(|v| v.unsigned_abs()).sum::<u32>();
                if order == 0 || order > 2 {
                    continue;
                }
                // Along one axis, image n of a source at x in a room of length L lies at nL + x or, for odd n, nL + L - x.
                let position: [f64; 3] = std::array::from_fn(|axis| {
                    let (length, x) = (room.size_m[axis], room.source_m[axis]);
                    f64::from(n[axis]) * length + if n[axis] % 2 == 0 { x } else { length - x }
                });
                let hit = (0..3).filter(|&a| n[a] != 0).map(|a| walls[2 * a + usize::from(n[a] > 0)]);
                let (count, total) = hit.fold((0.0, 0.0), |(c, t), w| (c + 1.0, t + w));
                images.push(Image {
                    distance_m: distance(position, room.receiver_m),
                    order,
                    absorption_factor: total / count,
                });
            }
        }
    }
    images
}

/// The mean absorption that Eyring's formula asks for, walls alone.
fn mean_absorption(room: &Drawn, band: usize) -> f64 {
    1.0 - (-0.161 * volume_m3(room) / (surface_m2(room) * room.t60_s[band])).exp()
}

fn volume_m3(room: &Drawn) -> f64 {
    room.size_m.iter().product()
}

fn surface_m2(room: &Drawn) -> f64 {
    let [x, y, z] = room.size_m;
    2.0 * (x * y + y * z + z * x)
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}
