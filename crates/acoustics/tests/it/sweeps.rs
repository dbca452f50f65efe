//! Sweeps through simulated chains: the true response comes back, and recordings that are no measurement are told.

use crate::synthetic::decay;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use sabine_acoustics::{
    Bands, DeconvolutionConfig, Error, ExponentialSweep, FreeFieldReference, ImpulseResponse, Signal,
    SoundStrength, SweepConfig, SweepError, SweepMeasurement, deconvolve,
};

const RATE: u32 = 32_000;

/// Samples in a time.
fn count(seconds: f64) -> usize {
    (seconds * f64::from(RATE)).round() as usize
}

fn settings() -> SweepConfig {
    SweepConfig {
        sample_rate_hz: RATE,
        from_hz: 50.0,
        to_hz: 15_900.0,
        duration_s: 4.0,
        silence_s: 1.0,
        ..SweepConfig::default()
    }
}

/// The definition of the sweep at a time, without fades; silence before and after.
fn sweep_at(config: &SweepConfig, time_s: f64) -> f64 {
    if !(0.0..config.duration_s).contains(&time_s) {
        return 0.0;
    }
    let scale_s = config.duration_s / (config.to_hz / config.from_hz).ln();
    config.peak * (std::f64::consts::TAU * config.from_hz * scale_s * ((time_s / scale_s).exp() - 1.0)).sin()
}

/// Direct convolution, after a latency, cut to a length.
fn convolved(signal: &[f32], response: &[f32], latency: usize, length: usize) -> Vec<f64> {
    let mut out = vec![0.0; length];
    for (i, &x) in signal.iter().enumerate().filter(|(_, x)| **x != 0.0) {
        for (y, &h) in out.iter_mut().skip(i + latency).zip(response) {
            *y += f64::from(x) * f64::from(h);
        }
    }
    out
}

fn add_noise(samples: &mut [f64], sd: f64, seed: u64) {
    let mut rng = rand_pcg::Pcg64::seed_from_u64(seed);
    for x in samples {
        let gaussian: f64 = StandardNormal.sample(&mut rng);
        *x += sd * gaussian;
    }
}

fn signal(samples: &[f64]) -> Signal {
    Signal::new(samples.iter().map(|&x| x as f32).collect(), RATE).unwrap()
}

fn run(samples: &[f64], sweep: &ExponentialSweep) -> Result<SweepMeasurement, Error> {
    deconvolve(&[signal(samples)], sweep, &DeconvolutionConfig::default())
}

/// Why a recording is refused.
fn refusal(samples: &[f64], sweep: &ExponentialSweep) -> SweepError {
    match run(samples, sweep) {
        Err(Error::Sweep(error)) => error,
        Err(other) => panic!("{other}"),
        Ok(found) => panic!("taken for a measurement: {:?}", found.differences_db),
    }
}

/// A room of T = 0.4 s with a direct sound.
fn room() -> ImpulseResponse {
    let mut samples = decay(RATE, 0.6, &[(0.4, 0.0)], -200.0, 11).into_samples();
    samples[0] += 1.5;
    ImpulseResponse::new(samples, RATE).unwrap()
}

/// Repetitions of a short sweep through a room of few arrivals, the n-th shifted and changed by what is asked for.
fn repeated(config: &SweepConfig, stretch: f64, noise_sd: f64) -> Vec<f64> {
    let length = config.repetitions as f64 * (config.duration_s + config.silence_s) + 0.2;
    let mut samples: Vec<f64> = (0..(length * f64::from(RATE)) as usize)
        .map(|i| {
            let t = i as f64 / f64::from(RATE) / (1.0 + stretch) - 0.1 + 1e-7;
            (0..config.repetitions)
                .map(|k| t - k as f64 * (config.duration_s + config.silence_s))
                .map(|t| sweep_at(config, t) + 0.4 * sweep_at(config, t - 0.013))
                .sum()
        })
        .collect();
    add_noise(&mut samples, noise_sd, 5);
    samples
}

/// The figure of the issue: 1 % of harmonic distortion before the room, noise 45 dB below the recorded sweep; every octave of
/// the response within 0.1 dB of the true one.
#[test]
fn a_distorting_and_noisy_chain_gives_the_true_response_back() {
    let sweep = ExponentialSweep::new(settings()).unwrap();
    let room = room();
    // Second and third harmonic of a sine of amplitude a: a2 a / 2 and a3 a^2 / 4; 0.7 % each.
    let (a, share) = (settings().peak, 0.01 / 2f64.sqrt());
    let (a2, a3) = (2.0 * share / a, 4.0 * share / (a * a));
    let distorted: Vec<f32> = sweep
        .samples()
        .iter()
        .map(|&x| f64::from(x))
        .map(|x| (x + a2 * x * x + a3 * x * x * x) as f32)
        .collect();
    let mut recorded = convolved(&distorted, room.samples(), count(0.1), count(5.2));
    let power = recorded.iter().map(|x| x * x).sum::<f64>() / sweep.samples().len() as f64;
    add_noise(&mut recorded, (power * 10f64.powf(-4.5)).sqrt(), 21);
    let largest = recorded.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let recorded: Vec<f64> = recorded.iter().map(|x| 0.8 * x / largest).collect();
    let found = run(&recorded, &sweep).unwrap();
    let bands = Bands::octaves(125.0, 8000.0).unwrap();
    let level = |response: &ImpulseResponse| -> Vec<f64> {
        let reference = FreeFieldReference::unit_source(bands, RATE).unwrap();
        let strength = SoundStrength::measure(response, &reference).unwrap();
        strength.g_db.values().iter().map(|g| g.as_ref().unwrap().value).collect()
    };
    // The distortion's part at the fundamental, 3 a3 a^2 / 4, belongs to the linear response of the chain.
    let linear = 1.0 + 0.75 * a3 * a * a;
    let gain_db = 20.0 * (linear * 0.8 / largest).log10();
    let mut padded = vec![0.0; count(0.1)];
    padded.extend_from_slice(room.samples());
    let truth = level(&ImpulseResponse::new(padded, RATE).unwrap());
    for ((found_db, true_db), hz) in level(&found.responses[0]).iter().zip(&truth).zip(bands.iter_hz()) {
        let error_db = found_db - true_db - gain_db;
        println!("{hz} Hz: {error_db:+.3} dB");
        assert!(error_db.abs() < 0.1, "{hz} Hz: {error_db} dB");
    }
    // 100 ms of latency, and 50 ms before the onset.
    assert!((found.start_s - 0.05).abs() < 1e-3, "{}", found.start_s);
}

/// Without noise and distortion, sample by sample: the room's response, limited to the sweep's range.
#[test]
fn channels_keep_their_time_and_their_ratio() {
    let config = SweepConfig { duration_s: 2.0, ..settings() };
    let sweep = ExponentialSweep::new(config).unwrap();
    let one = convolved(sweep.samples(), &[0.0, 0.0, 1.0], 1200, count(3.0));
    let other = convolved(sweep.samples(), &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.5], 1200, count(3.0));
    let found = deconvolve(&[signal(&one), signal(&other)], &sweep, &Default::default()).unwrap();
    let start = (found.start_s * f64::from(RATE)).round() as usize;
    let at = |channel: usize, sample: usize| f64::from(found.responses[channel].samples()[sample - start]);
    // A band-limited pulse: its height is the share of the spectrum that the sweep covers, less the rounded ends.
    let height = at(0, 1202);
    assert!((height - 15_850.0 / 16_000.0).abs() < 0.05, "{height}");
    assert!((at(1, 1206) + 0.5 * height).abs() < 1e-4);
    // What lacks below 50 Hz, of a pulse of 1, is 50 / 16,000 high.
    assert!(at(0, 1300).abs() < 0.004 && at(0, 2000).abs() < 0.004);
}

#[test]
fn repetitions_are_averaged() {
    let config = SweepConfig { duration_s: 1.0, silence_s: 0.4, repetitions: 4, ..settings() };
    let sweep = ExponentialSweep::new(config).unwrap();
    let once = SweepConfig { repetitions: 1, ..config };
    let single = ExponentialSweep::new(once).unwrap();
    // What the noise leaves in the response: the difference from a measurement without.
    let noise_power = |config: &SweepConfig, sweep: &ExponentialSweep| -> f64 {
        let [with, without] = [1e-3, 0.0].map(|sd| run(&repeated(config, 0.0, sd), sweep).unwrap());
        let (with, without) = (with.responses[0].samples(), without.responses[0].samples());
        with.iter().zip(without).map(|(a, b)| f64::from(a - b).powi(2)).take(count(0.3)).sum()
    };
    let four = run(&repeated(&config, 0.0, 1e-3), &sweep).unwrap();
    let gain_db = 10.0 * (noise_power(&once, &single) / noise_power(&config, &sweep)).log10();
    println!("noise of four repetitions {gain_db:.2} dB below that of one");
    // 10 lg 4; the power of so much noise is known to 0.3 dB.
    assert!((gain_db - 6.02).abs() < 0.8, "{gain_db}");
    assert!(four.clock_drift_ppm.unwrap().abs() < 2.0 && four.left_out.is_empty());
    assert_eq!(four.differences_db.len(), 4);
}

#[test]
fn a_repetition_that_differs_is_named_or_left_out() {
    for repetitions in [2, 3, 5] {
        let config = SweepConfig { duration_s: 1.0, silence_s: 0.4, repetitions, ..settings() };
        let sweep = ExponentialSweep::new(config).unwrap();
        let mut samples = repeated(&config, 0.0, 1e-3);
        // A door slams during the second sweep. Of two sweeps neither is known to be right, and less is told.
        let loudness = if repetitions == 2 { 6.0 } else { 1.0 };
        let slam = count(2.0);
        for (i, x) in samples[slam..slam + count(0.2)].iter_mut().enumerate() {
            *x += loudness * (-(i as f64) / 800.0).exp() * (0.3 * (i * i % 977) as f64).sin();
        }
        let SweepError::RepetitionDiffers { repetition, excess_db } = refusal(&samples, &sweep) else {
            panic!("{repetitions} repetitions")
        };
        assert!(excess_db > 6.0 && (repetitions == 2 || repetition == 1), "{repetition}, {excess_db}");
        let lenient = DeconvolutionConfig { leave_out_differing: true, ..Default::default() };
        let found = deconvolve(&[signal(&samples)], &sweep, &lenient);
        if repetitions == 2 {
            assert!(matches!(found, Err(Error::Sweep(SweepError::RepetitionDiffers { .. }))));
        } else {
            assert_eq!(found.unwrap().left_out, [1]);
        }
    }
}

#[test]
fn clocks_that_differ_are_told() {
    for ppm in [-40.0, 25.0, 300.0] {
        let config = SweepConfig { duration_s: 1.0, silence_s: 0.4, repetitions: 3, ..settings() };
        let sweep = ExponentialSweep::new(config).unwrap();
        let samples = repeated(&config, 1e-6 * ppm, 1e-4);
        let SweepError::ClockDrift { ppm: found } = refusal(&samples, &sweep) else { panic!("{ppm} ppm") };
        println!("three sweeps of 1 s: {ppm} ppm found as {found:.1}");
        assert!((found - ppm).abs() < 6.0, "{ppm}: {found}");
        let lenient = DeconvolutionConfig { allow_clock_drift: true, ..Default::default() };
        assert!(deconvolve(&[signal(&samples)], &sweep, &lenient).is_ok());
    }
    // A single sweep of 4 s: 1 ms of stretch is 250 ppm.
    let sweep = ExponentialSweep::new(settings()).unwrap();
    for ppm in [-1000.0, 400.0] {
        let samples = repeated(&settings(), 1e-6 * ppm, 1e-4);
        let SweepError::ClockDrift { ppm: found } = refusal(&samples, &sweep) else { panic!("{ppm} ppm") };
        println!("one sweep of 4 s: {ppm} ppm found as {found:.1}");
        assert!((found - ppm).abs() < 60.0, "{ppm}: {found}");
    }
    assert!(run(&repeated(&settings(), 20e-6, 1e-4), &sweep).is_ok());
}

#[test]
fn recordings_that_are_no_measurement_say_why() {
    let sweep = ExponentialSweep::new(settings()).unwrap();
    let good = repeated(&settings(), 0.0, 1e-4);
    assert!(run(&good, &sweep).is_ok());
    let kind = |samples: &[f64]| refusal(samples, &sweep);
    // Cut off at full scale, and at a level below it.
    for (gain, limit) in [(4.0, 1.0), (1.0, 0.55)] {
        let clipped: Vec<f64> = good.iter().map(|x| (gain * x).clamp(-limit, limit)).collect();
        let error = kind(&clipped);
        assert!(matches!(error, SweepError::Clipped { channel: 0, .. }), "{error}");
    }
    assert!(matches!(kind(&good[..count(3.8)]), SweepError::TooShort { .. }));
    assert!(matches!(kind(&good[..count(4.12)]), SweepError::TooShort { .. }));
    assert!(matches!(kind(&vec![0.0; count(5.0)]), SweepError::Silent));
    // Sweeps of another length, another range, played at 30 instead of 32 kHz; noise; the recording begun half a second late.
    for other in [
        SweepConfig { duration_s: 3.7, ..settings() },
        SweepConfig { from_hz: 20.0, ..settings() },
        SweepConfig {
            duration_s: 4.0 * 32.0 / 30.0,
            from_hz: 50.0 * 30.0 / 32.0,
            to_hz: 15_900.0 * 30.0 / 32.0,
            ..settings()
        },
    ] {
        let mut samples = repeated(&other, 0.0, 1e-4);
        samples.resize(good.len(), 0.0);
        let error = kind(&samples);
        assert!(matches!(error, SweepError::Mismatch { .. }), "{other:?}: {error}");
    }
    let mut noise = vec![0.0; count(5.0)];
    add_noise(&mut noise, 0.1, 9);
    let error = kind(&noise);
    assert!(matches!(error, SweepError::NoOnset), "{error}");
    let mut late = good[count(0.5)..].to_vec();
    late.resize(good.len(), 0.0);
    let error = kind(&late);
    assert!(matches!(error, SweepError::StartsLate { .. }), "{error}");
    let other_rate = Signal::new(vec![0.1; 200_000], 48_000).unwrap();
    assert!(matches!(
        deconvolve(&[other_rate], &sweep, &Default::default()),
        Err(Error::SampleRates { left_hz: RATE, right_hz: 48_000 })
    ));
    assert!(matches!(deconvolve(&[], &sweep, &Default::default()), Err(Error::Empty { .. })));
}

/// The pulse of a loopback rings before its peak, the longer the narrower the sweep.
#[test]
fn a_loopback_without_latency_is_no_late_recording() {
    for to_hz in [100.0, 500.0, 4000.0, 15_900.0] {
        for repetitions in [1, 3] {
            let config = SweepConfig { to_hz, duration_s: 1.0, silence_s: 0.5, repetitions, ..settings() };
            let sweep = ExponentialSweep::new(config).unwrap();
            let found = deconvolve(&[sweep.playback().unwrap()], &sweep, &Default::default()).unwrap();
            let samples = found.responses[0].samples();
            let peak = (0..samples.len()).max_by(|&a, &b| samples[a].total_cmp(&samples[b])).unwrap();
            assert_eq!((found.start_s, peak), (0.0, 0), "{to_hz} Hz, {repetitions} times");
        }
    }
}

/// Sweeps at full scale, of 16 bits, and loud speech-like noise are not clipped.
#[test]
fn what_is_loud_is_not_clipped() {
    for peak in [1.0, 0.99, 0.5] {
        let config = SweepConfig { peak, ..settings() };
        let sweep = ExponentialSweep::new(config).unwrap();
        let quantised: Vec<f64> =
            repeated(&config, 0.0, 0.0).iter().map(|x| (x * 32_768.0 / 1.45).round() / 32_768.0).collect();
        assert!(run(&quantised, &sweep).is_ok(), "{peak}");
        let loopback: Vec<f64> = (0..count(5.2))
            .map(|i| sweep_at(&config, i as f64 / f64::from(RATE) - 0.1))
            .map(|x| 0.99 * (x * 32_768.0).round() / 32_768.0)
            .collect();
        assert!(run(&loopback, &sweep).is_ok(), "{peak}");
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    for wrong in [
        SweepConfig { from_hz: 0.0, ..settings() },
        SweepConfig { to_hz: 60.0, ..settings() },
        SweepConfig { to_hz: 16_001.0, ..settings() },
        SweepConfig { duration_s: f64::NAN, ..settings() },
        SweepConfig { fade_in_s: 3.0, ..settings() },
        SweepConfig { silence_s: -1.0, ..settings() },
        SweepConfig { repetitions: 0, ..settings() },
        SweepConfig { peak: 1.1, ..settings() },
    ] {
        assert!(matches!(ExponentialSweep::new(wrong), Err(Error::OutOfRange(_))), "{wrong:?}");
    }
    let sweep = ExponentialSweep::new(settings()).unwrap();
    // Away from the fades it is the definition.
    for i in [5000, 40_000, 120_000] {
        let expected = sweep_at(&settings(), i as f64 / f64::from(RATE));
        assert!((f64::from(sweep.samples()[i]) - expected).abs() < 1e-6);
    }
    assert_eq!(sweep.samples()[0], 0.0);
    assert!(sweep.samples()[sweep.samples().len() - 1].abs() < 1e-6);
}
