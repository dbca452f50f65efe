//! Properties: the fast spectrogram is the defined one, streaming is the same as all at once, the inverse inverts.

use ndarray::Array2;
use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;
use sabine_acoustics::OutOfRange;
use sabine_features::FeatureExtractor;
use sabine_features::{Complex, Error, LogMel, LogMelConfig, NaiveLogMel, Stft, hz_to_mel, mel_to_hz};

fn small() -> impl Strategy<Value = LogMelConfig> {
    (prop::sample::select(vec![64_usize, 90, 128, 255]), 1_usize..64, 1_usize..9, 0.0..500.0_f64).prop_map(
        |(n_fft, hop, mels, low_hz)| LogMelConfig { n_fft, hop, mels, low_hz, ..Default::default() },
    )
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 48,
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..Default::default()
    })]

    #[test]
    fn fast_and_naive_agree(config in small(), samples in prop::collection::vec(-1.0_f32..1.0, 0..900)) {
        let Ok(fast) = LogMel::new(config.clone()) else { return Ok(()) };
        let naive = NaiveLogMel::new(config).unwrap();
        let (fast, naive) = (fast.extract(&samples), naive.extract(&samples));
        prop_assert_eq!(fast.dim(), naive.dim());
        for (a, b) in fast.iter().zip(&naive) {
            prop_assert!((a - b).abs() < 1e-4, "{} != {}", a, b);
        }
    }

    #[test]
    fn a_stream_gives_the_same_bits(
        config in small(),
        samples in prop::collection::vec(-1.0_f32..1.0, 0..1500),
        piece in 1_usize..400,
    ) {
        let Ok(log_mel) = LogMel::new(config) else { return Ok(()) };
        let whole = log_mel.extract(&samples);
        let (mut stream, mut frames) = (log_mel.stream(), Vec::new());
        for piece in samples.chunks(piece) {
            stream.push(piece, |levels| frames.push(levels.to_vec()));
        }
        prop_assert_eq!(frames.len(), whole.ncols());
        for (frame, column) in frames.iter().zip(whole.columns()) {
            prop_assert!(frame.iter().zip(column).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
    }

    #[test]
    fn the_inverse_transform_inverts(
        n_fft in prop::sample::select(vec![16_usize, 27, 64, 256]),
        overlap in 2_usize..6,
        samples in prop::collection::vec(-1.0_f32..1.0, 600..900),
    ) {
        let stft = Stft::new(n_fft, n_fft / overlap).unwrap();
        let back = stft.inverse(stft.forward(&samples).view()).unwrap();
        // From the second sample on a window is above zero; before and after the overlap is partial and ill-conditioned.
        let inside = n_fft..back.len() - n_fft;
        for n in inside {
            prop_assert!((back[n] - samples[n]).abs() < 2e-6, "{}: {} != {}", n, back[n], samples[n]);
        }
        prop_assert!(back.iter().all(|x| x.is_finite()));
    }

    #[test]
    fn mel_and_hertz_are_inverse(hz in 0.0..40_000.0_f64) {
        prop_assert!((mel_to_hz(hz_to_mel(hz)) - hz).abs() < 1e-9 * (1.0 + hz));
    }
}

/// Parseval: for a periodic Hann window at half overlap the window's squares have mean 3/8, so white noise of variance v gives
/// mean |X|^2 = v n_fft 3/8. 1000 frames of 127 bins: relative standard error about 1/sqrt(60,000) (overlap), so 5 of them are 2 %.
#[test]
fn white_noise_has_the_power_that_parseval_demands() {
    let mut state = 1_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1_u64 << 24) as f32 - 0.5
    };
    let samples: Vec<f32> = (0..128 * 1001).map(|_| uniform()).collect();
    let stft = Stft::new(256, 128).unwrap();
    let spectra = stft.forward(&samples);
    let inner = || spectra.rows().into_iter().skip(1).take(127).flatten();
    let mean = inner().map(|x| f64::from(x.norm_sqr())).sum::<f64>() / inner().count() as f64;
    let expected = 256.0 * 0.375 / 12.0;
    assert!((mean / expected - 1.0).abs() < 0.02, "{mean} != {expected}");
}

#[test]
fn a_tone_lands_in_its_bin_with_the_windows_main_lobe() {
    let tone: Vec<f32> =
        (0..256).map(|n| (std::f64::consts::TAU * 20.0 * f64::from(n) / 256.0).cos() as f32).collect();
    let spectrum = Stft::new(256, 128).unwrap().forward(&tone);
    for (bin, expected) in [(18, 0.0), (19, 32.0), (20, 64.0), (21, 32.0), (22, 0.0)] {
        assert!((spectrum[[bin, 0]].norm() - expected).abs() < 1e-4, "bin {bin}: {}", spectrum[[bin, 0]]);
    }
}

#[test]
fn each_mel_band_has_unit_area() {
    // Fine bins: the sum over bins times their width is the integral, but for the corners.
    let log_mel = LogMel::new(LogMelConfig { n_fft: 16_384, hop: 16_384, ..Default::default() }).unwrap();
    for band in 0..32 {
        let area: f64 = log_mel.bands().row(band).iter().sum::<f64>() * 16_000.0 / 16_384.0;
        assert!((area - 1.0).abs() < 1e-3, "band {band}: {area}");
    }
}

#[test]
fn too_few_samples_give_no_frame_and_one_frame_is_enough() {
    let log_mel = LogMel::new(LogMelConfig::default()).unwrap();
    assert_eq!(log_mel.extract(&[]).dim(), (32, 0));
    assert_eq!(log_mel.extract(&[0.5; 255]).dim(), (32, 0));
    assert_eq!(log_mel.extract(&[0.5; 256]).dim(), (32, 1));
    assert_eq!(log_mel.frames(64_000), 499);
}

#[test]
fn a_sample_that_is_not_a_number_spoils_its_frames_and_no_others() {
    let mut samples = vec![0.25_f32; 1024];
    samples[700] = f32::NAN;
    for extractor in [
        &LogMel::new(LogMelConfig::default()).unwrap() as &dyn FeatureExtractor,
        &NaiveLogMel::new(LogMelConfig::default()).unwrap(),
    ] {
        let levels = extractor.extract(&samples);
        for (t, column) in levels.columns().into_iter().enumerate() {
            let spoilt = (t * 128..t * 128 + 256).contains(&700);
            assert!(column.iter().all(|x| x.is_nan() == spoilt), "frame {t}");
        }
    }
}

#[test]
fn a_constant_reaches_only_the_bands_beside_zero_hertz() {
    let levels = LogMel::new(LogMelConfig::default()).unwrap().extract(&[1.0; 256]);
    // The Hann window leaks one bin, 62.5 Hz: the lowest two triangles reach it, the third begins at 91 * 2 Hz.
    assert!(levels[[0, 0]] > 0.0);
    assert!(levels.iter().skip(2).all(|&db| db == -100.0));
}

#[test]
fn wrong_settings_and_lengths_are_named() {
    let field = |config| match LogMel::new(config) {
        Err(Error::OutOfRange(OutOfRange { field, .. })) => field,
        other => panic!("{other:?}"),
    };
    let good = LogMelConfig::default;
    assert_eq!(field(LogMelConfig { sample_rate_hz: 0, ..good() }), "sample_rate_hz");
    assert_eq!(field(LogMelConfig { n_fft: 1, ..good() }), "n_fft");
    assert_eq!(field(LogMelConfig { hop: 0, ..good() }), "hop");
    assert_eq!(field(LogMelConfig { hop: 257, ..good() }), "hop");
    assert_eq!(field(LogMelConfig { mels: 0, ..good() }), "mels");
    assert_eq!(field(LogMelConfig { high_hz: 8000.5, ..good() }), "high_hz");
    assert_eq!(field(LogMelConfig { low_hz: 8000.0, ..good() }), "low_hz");
    assert_eq!(field(LogMelConfig { low_hz: f64::NAN, ..good() }), "low_hz");
    assert_eq!(field(LogMelConfig { floor_power: 0.0, ..good() }), "floor_power");
    assert!(matches!(LogMel::new(LogMelConfig { mels: 128, ..good() }), Err(Error::EmptyMelBand { .. })));
    let log_mel = LogMel::new(good()).unwrap();
    let mut scratch = log_mel.scratch();
    let wrong = log_mel.extract_into(&[0.0; 256], &mut scratch, &mut [0.0; 31]);
    assert_eq!(wrong, Err(Error::BufferLength { what: "output", expected: 32, found: 31 }));
    let stft = Stft::new(256, 128).unwrap();
    assert!(stft.inverse(Array2::<Complex<f32>>::zeros((128, 2)).view()).is_err());
    assert_eq!(stft.inverse(Array2::zeros((129, 0)).view()), Ok(Vec::new()));
    // Working memory of another transform is refused, not misread.
    let mut foreign = Stft::new(64, 32).unwrap().scratch();
    let mut out = vec![Complex::default(); 129];
    assert!(stft.forward_into(&[0.0; 256], &mut foreign, &mut out).is_err());
    assert!(log_mel.extract_into(&[0.0; 256], &mut small_scratch(), &mut [0.0; 32]).is_err());
}

fn small_scratch() -> sabine_features::LogMelScratch {
    LogMel::new(LogMelConfig { n_fft: 64, hop: 32, mels: 4, ..Default::default() }).expect("valid").scratch()
}
