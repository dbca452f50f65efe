//! Ambisonic responses against closed forms and against the mono response.

use crate::octave_filter::measured_t_s;
use sabine_acoustics::*;
use sabine_paths::*;
use sabine_propagate::*;
use sabine_scene::*;

fn contribution(length_m: f64, energy: f64, arrival: [f64; 3], batch: Option<u8>) -> Contribution {
    let (chain, tail) = (PathSet::DIRECT, PathSet::DIRECT);
    Contribution { length_m, log_weight: energy.ln(), chain, tail, departure: arrival, arrival, batch }
}

fn wall(bands: Bands) -> Material {
    Material::uniform(bands, 0.0, 0.0).unwrap()
}

/// A small generator (Marsaglia's xorshift).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn direction(&mut self) -> [f64; 3] {
        let z = 2.0 * self.uniform() - 1.0;
        let (sine, cosine) = (std::f64::consts::TAU * self.uniform()).sin_cos();
        let r = (1.0 - z * z).sqrt();
        [r * cosine, r * sine, z]
    }
}

fn energy(channel: &[f32]) -> f64 {
    channel.iter().map(|&s| f64::from(s).powi(2)).sum()
}

#[test]
fn a_single_path_has_the_exact_harmonics_in_all_channels() {
    let air = Air::default();
    let material = [wall(Bands::SIMULATION)];
    let conditions = Conditions::new(&material, &air);
    let mut random = Random(77);
    for order in 1..=3 {
        let arrival = random.direction();
        let facing = Orientation::new(random.direction(), random.direction()).unwrap();
        let mut paths = PathSet::new(1, 40.0);
        paths.push(contribution(12.34, 0.3, arrival, None));
        let config = RenderConfig { sample_rate_hz: 24_000, ..Default::default() };
        let response = AmbisonicRenderer::new(order, config.clone())
            .unwrap()
            .render(&paths, &conditions, facing)
            .unwrap();
        let mono = PressureRenderer::new(config).unwrap().render(&paths, &conditions).unwrap();
        assert_eq!(response.channels().len(), (order + 1) * (order + 1));
        assert_eq!(response.channel(0), mono.samples());
        let gains = ambisonic_gains(order, facing.to_local(arrival));
        for (channel, gain) in response.channels().iter().zip(gains) {
            for (found, w) in channel.iter().zip(mono.samples()) {
                // Directions are stored to 0.005 degrees.
                assert!((f64::from(*found) - gain * f64::from(*w)).abs() < 5e-4 * f64::from(mono.peak()));
            }
        }
    }
}

/// Sampled paths from everywhere: a channel of degree l holds 1 / (2l + 1) of the energy of the first.
#[test]
fn a_diffuse_field_has_the_channel_energies_of_sn3d() {
    let mut random = Random(5);
    let mut paths = PathSet::new(1, 200.0);
    for i in 0..60_000u32 {
        let length_m = 10.0 + 190.0 * random.uniform();
        paths.push(contribution(length_m, 1e-5, random.direction(), Some((i % 32) as u8)));
    }
    let air = Air::default();
    let material = [wall(Bands::octaves(125.0, 500.0).unwrap())];
    let conditions = Conditions::new(&material, &air);
    let seeds = 10;
    for order in 1..=3 {
        let channels = (order + 1) * (order + 1);
        // Energy of each channel, as a share of what it should be: its mean over seeds, and the variance of that.
        let (mut sums, mut squares) = (vec![0.0; channels], vec![0.0; channels]);
        for seed in 0..seeds {
            let config = RenderConfig { sample_rate_hz: 16_000, seed, ..Default::default() };
            let renderer = AmbisonicRenderer::new(order, config).unwrap();
            let response = renderer.render(&paths, &conditions, Orientation::default()).unwrap();
            let w = energy(response.channel(0));
            for (acn, channel) in response.channels().iter().enumerate() {
                let share = energy(channel) / w * (2 * acn.isqrt() + 1) as f64;
                sums[acn] += share;
                squares[acn] += share * share;
            }
        }
        let n = seeds as f64;
        let variance = |acn: usize| (squares[acn] - sums[acn] * sums[acn] / n) / (n - 1.0) / n;
        for degree in 1..=order {
            let run = degree * degree..(degree + 1) * (degree + 1);
            // Pooled over the channels of a degree: ten values alone would tell their spread badly.
            let error = (run.clone().map(variance).sum::<f64>() / run.len() as f64).sqrt();
            assert!(error < 0.01, "order {order}, degree {degree}: +- {error}");
            let mean = run.clone().map(|acn| sums[acn] / n).sum::<f64>() / run.len() as f64;
            assert!((mean - 1.0).abs() < 1e-3, "order {order}, degree {degree} in all: {mean}");
            for acn in run {
                // Four standard errors, and 0.6 % for the 60,000 random directions (sd of a squared harmonic over its mean, 1.1).
                let off = sums[acn] / n - 1.0;
                assert!(off.abs() < 4.0 * error + 0.006, "order {order}, channel {acn}: {off} +- {error}");
            }
        }
    }
}

/// Sampled sound from one side stays on that side.
#[test]
fn sampled_paths_keep_their_side() {
    let mut random = Random(9);
    let mut paths = PathSet::new(1, 200.0);
    let mut mean_cosine = 0.0;
    for i in 0..20_000u32 {
        let direction = random.direction();
        let left = [direction[0], direction[1].abs(), direction[2]];
        mean_cosine += left[1] / 20_000.0;
        paths.push(contribution(10.0 + 180.0 * random.uniform(), 1e-4, left, Some((i % 32) as u8)));
    }
    let air = Air::default();
    let material = [wall(Bands::octaves(250.0, 500.0).unwrap())];
    let config = RenderConfig { sample_rate_hz: 16_000, ..Default::default() };
    let response = AmbisonicRenderer::new(3, config)
        .unwrap()
        .render(&paths, &Conditions::new(&material, &air), Orientation::default())
        .unwrap();
    let product: f64 =
        response.channel(0).iter().zip(response.channel(1)).map(|(w, y)| f64::from(w * y)).sum();
    let found = product / energy(response.channel(0));
    // Half a sphere has a mean cosine of one half. Directions of cells are means: their length is lost, up to 6 %.
    assert!((mean_cosine - 0.5).abs() < 0.01);
    assert!((found / mean_cosine - 1.0).abs() < 0.1, "{found} for {mean_cosine}");
}

#[test]
fn the_first_channel_decays_as_the_mono_response() {
    let bands = Bands::SIMULATION;
    let absorption = vec![0.10, 0.11, 0.13, 0.16, 0.18, 0.20, 0.22, 0.25];
    let scattering = vec![0.1, 0.12, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6];
    let wall =
        Material::new(PerBand::new(bands, absorption).unwrap(), PerBand::new(bands, scattering).unwrap())
            .unwrap();
    let scene = Scene::shoebox([8.0, 5.5, 3.2], std::array::from_fn(|_| wall.clone())).unwrap();
    let (air, materials) = (Air::default(), vec![wall; 6]);
    let config = TracerConfig { rays: 8_000, duration_s: 1.4, ..Default::default() };
    let paths = PathTracer::new(config)
        .unwrap()
        .trace(
            &scene,
            &Source::omni("S", [2.0, 3.0, 1.5]).unwrap(),
            &Receiver::omni("R", [6.0, 2.0, 1.6]).unwrap(),
            &air,
            &(),
        )
        .unwrap();
    let conditions = Conditions::new(&materials, &air);
    let energy = paths.energy_response(&conditions, 1e-3).unwrap();
    let config = RenderConfig { sample_rate_hz: 24_000, ..Default::default() };
    let response = AmbisonicRenderer::new(3, config.clone())
        .unwrap()
        .render(&paths, &conditions, Orientation::default())
        .unwrap();
    let mono = PressureRenderer::new(config).unwrap().render(&paths, &conditions).unwrap();
    for band in 1..7 {
        let wanted_s = energy.decay_curve(band).decay_time_s(-5.0, -35.0).unwrap();
        for (name, samples) in [("mono", mono.samples()), ("W", response.channel(0))] {
            let off = measured_t_s(samples, 24e3, bands, band, -35.0) / wanted_s - 1.0;
            assert!(off.abs() < 0.03, "{name}, {} Hz: {off}", bands.nominal_hz(band));
        }
    }
}

#[test]
fn a_response_is_written_with_all_its_channels() {
    let channels: Vec<Vec<f32>> =
        (0..9).map(|n| (0..50).map(|i| (n * 50 + i) as f32 * 1e-3).collect()).collect();
    let response = AmbisonicResponse::new(channels.clone(), 16_000).unwrap();
    let path = std::env::temp_dir().join(format!("sabine-ambisonics-{}.wav", std::process::id()));
    response.write_wav(&path, SampleFormat::Float32).unwrap();
    for (n, channel) in channels.iter().enumerate() {
        let read = read_audio(&path, Channel::Index(n)).unwrap();
        assert_eq!((read.samples(), read.sample_rate_hz()), (&channel[..], 16_000));
    }
    assert_eq!(probe_audio(&path).unwrap().channels, 9);
    std::fs::remove_file(&path).unwrap();
}

#[test]
fn orders_beyond_the_third_are_refused() {
    for order in [0, 4] {
        let refused = AmbisonicRenderer::new(order, RenderConfig::default());
        assert!(matches!(refused, Err(sabine_propagate::Error::OutOfRange(_))));
    }
}
