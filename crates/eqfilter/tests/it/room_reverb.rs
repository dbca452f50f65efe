//! The reverb for audio callbacks against the plain sum, over frames of every number.

use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;
use sabine_acoustics::ImpulseResponse;
use sabine_eqfilter::{Error, RoomReverb, RoomReverbConfig};

const RATE_HZ: u32 = 8000;

fn noise(length: usize, seed: u32) -> Vec<f32> {
    let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(1);
    (0..length)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state as f32 / u32::MAX as f32 - 0.5
        })
        .collect()
}

fn responses(lengths: &[usize], seed: u32) -> Vec<ImpulseResponse> {
    let response =
        |(i, &n): (usize, &usize)| ImpulseResponse::new(noise(n, seed + i as u32), RATE_HZ).unwrap();
    lengths.iter().enumerate().map(response).collect()
}

fn config(inputs: usize, outputs: usize, block: usize, longest: usize) -> RoomReverbConfig {
    RoomReverbConfig {
        sample_rate_hz: RATE_HZ,
        inputs,
        outputs,
        block,
        longest_s: longest as f64 / f64::from(RATE_HZ),
        fade_s: 0.02,
        ..RoomReverbConfig::default()
    }
}

/// The definition: each output is the sum of the convolved inputs, late by the latency.
fn expected(inputs: &[Vec<f32>], responses: &[ImpulseResponse], late: usize) -> Vec<Vec<f64>> {
    let outputs = responses.len() / inputs.len();
    let mut all = vec![vec![0.0; inputs[0].len()]; outputs];
    for (pair, response) in responses.iter().enumerate() {
        let (input, output) = (&inputs[pair / outputs], &mut all[pair % outputs]);
        for (k, &h) in response.samples().iter().enumerate() {
            for (y, &x) in output.iter_mut().skip(k + late).zip(input) {
                *y += f64::from(x) * f64::from(h);
            }
        }
    }
    all
}

/// Runs planar input through calls of so many frames each, over and over.
fn run(reverb: &mut RoomReverb, inputs: &[Vec<f32>], frames: &[usize]) -> Vec<Vec<f32>> {
    let length = inputs[0].len();
    let mut outputs = vec![vec![0.0; length]; reverb.config().outputs];
    let mut from = 0;
    for &frames in frames.iter().cycle() {
        let to = (from + frames).min(length);
        let input: Vec<&[f32]> = inputs.iter().map(|x| &x[from..to]).collect();
        let mut output: Vec<&mut [f32]> = outputs.iter_mut().map(|y| &mut y[from..to]).collect();
        reverb.process_planar(&input, &mut output).unwrap();
        from = to;
        if from == length {
            return outputs;
        }
    }
    outputs
}

fn largest_difference(found: &[Vec<f32>], expected: &[Vec<f64>], part: std::ops::Range<usize>) -> f64 {
    let pairs = found.iter().zip(expected).flat_map(|(a, b)| a[part.clone()].iter().zip(&b[part.clone()]));
    pairs.map(|(&a, b)| (f64::from(a) - b).abs()).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 40,
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..Default::default()
    })]

    #[test]
    fn any_frames_and_channels_give_the_sum_one_block_late(
        frames in prop::collection::vec(prop::sample::select(vec![0_usize, 1, 7, 31, 32, 64, 441, 1024]), 1..6),
        inputs in 1_usize..=2,
        more_outputs in 0_usize..3,
        block in prop::sample::select(vec![16_usize, 24, 64]),
        length in 1_usize..3000,
        seed in 0_u32..1_000_000,
    ) {
        let frames = [frames, vec![5]].concat();
        let outputs = inputs + more_outputs;
        let lengths: Vec<usize> = (0..inputs * outputs).map(|pair| 1 + length / (1 + pair)).collect();
        let responses = responses(&lengths, seed);
        let input: Vec<Vec<f32>> = (0..inputs).map(|i| noise(4001, seed ^ (77 + i as u32))).collect();
        let mut reverb = RoomReverb::new(&responses, config(inputs, outputs, block, length + 1)).unwrap();
        prop_assert_eq!(reverb.latency_samples(), block);
        let found = run(&mut reverb, &input, &frames);
        let wanted = expected(&input, &responses, block);
        let most = largest_difference(&found, &wanted, 0..4001);
        prop_assert!(most < 4e-6 * ((length * inputs) as f64).sqrt().max(1.0), "{}", most);
        reverb.clear();
        prop_assert!(run(&mut reverb, &input, &frames) == found, "past input is forgotten, to the bit");
        reverb.clear();
        prop_assert!(run(&mut reverb, &input, &[64]) == found, "frames change nothing, to the bit");
    }
}

#[test]
fn interleaved_and_planar_are_the_same() {
    let responses = responses(&[900, 800, 700, 600], 5);
    let [mut planar, mut interleaved] =
        [(), ()].map(|()| RoomReverb::new(&responses, config(2, 2, 32, 900)).unwrap());
    let inputs = [noise(3000, 1), noise(3000, 2)];
    let expected = run(&mut planar, &inputs, &[100]);
    let input: Vec<f32> = (0..6000).map(|i| inputs[i % 2][i / 2]).collect();
    let mut output = vec![0.0; 6000];
    for (x, y) in input.chunks(2 * 441).zip(output.chunks_mut(2 * 441)) {
        interleaved.process_interleaved(x, y).unwrap();
    }
    assert!((0..6000).all(|i| output[i] == expected[i % 2][i / 2]));
}

/// A pulse through a response of one sample: late by one block exactly, wet and dry alike, whatever the frames.
#[test]
fn the_latency_is_exact_and_constant() {
    for frames in [&[1][..], &[64], &[441], &[1024], &[3, 500, 1]] {
        for (wet, dry) in [(1.0, 0.0), (0.0, 1.0)] {
            let config = RoomReverbConfig { wet, dry, ..config(1, 1, 48, 1) };
            let mut reverb =
                RoomReverb::new(&[ImpulseResponse::new(vec![1.0], RATE_HZ).unwrap()], config).unwrap();
            let mut input = vec![0.0; 2000];
            input[777] = 1.0;
            let found = run(&mut reverb, &[input], frames);
            for (n, &y) in found[0].iter().enumerate() {
                let wanted = if n == 777 + 48 { 1.0 } else { 0.0 };
                assert!((y - wanted).abs() < 1e-6, "{frames:?}, wet {wet}: sample {n} is {y}");
            }
        }
    }
}

#[test]
fn an_exchange_is_the_old_responses_before_and_the_new_ones_after() {
    for length in [200, 4000] {
        let lengths = [length, length / 2, length / 3, length];
        let (old, new) = (responses(&lengths, 1), responses(&lengths, 50));
        let mut reverb = RoomReverb::new(&old, config(2, 2, 32, length)).unwrap();
        let control = reverb.control();
        let inputs = [noise(32_000, 3), noise(32_000, 4)];
        let (by_old, by_new) = (expected(&inputs, &old, 32), expected(&inputs, &new, 32));
        let part = |reverb: &mut RoomReverb, from: usize, to: usize| {
            run(reverb, &[inputs[0][from..to].to_vec(), inputs[1][from..to].to_vec()], &[101, 17])
        };
        let before = part(&mut reverb, 0, 9001);
        std::thread::spawn({
            let (control, new) = (control.clone(), new.clone());
            move || control.exchange(&new).unwrap()
        })
        .join()
        .unwrap();
        let during = part(&mut reverb, 9001, 12_000);
        let after = part(&mut reverb, 12_000, 32_000);
        assert!(!reverb.is_exchanging());
        let found: Vec<Vec<f32>> = (0..2).map(|c| [&before[c][..], &during[c], &after[c]].concat()).collect();
        assert!(largest_difference(&found, &by_old, 0..9001) < 2e-4, "the old ones before");
        assert!(largest_difference(&found, &by_new, 12_000..32_000) < 2e-4, "the new ones after");
        // In between each sample lies between the two.
        for c in 0..2 {
            for n in 9001..12_000 {
                let (a, b, y) = (by_old[c][n], by_new[c][n], f64::from(found[c][n]));
                assert!(y > a.min(b) - 2e-4 && y < a.max(b) + 2e-4, "channel {c}, sample {n}");
            }
        }
        assert!(control.collect(), "the old responses come back");
        assert!(!control.collect());
    }
}

#[test]
fn responses_that_wait_give_way_to_newer_ones() {
    let gain = |gain: f32| [ImpulseResponse::new(vec![gain], RATE_HZ).unwrap()];
    let mut reverb = RoomReverb::new(&gain(1.0), config(1, 1, 16, 10)).unwrap();
    let control = reverb.control();
    for round in 0..50 {
        control.exchange(&gain(2.0)).unwrap();
        control.exchange(&gain(3.0 + round as f32)).unwrap();
        let out = run(&mut reverb, &[vec![1.0; 400]], &[33]);
        assert!((out[0][399] - 3.0 - round as f32).abs() < 1e-5, "round {round}: {}", out[0][399]);
    }
}

/// Responses of one sample each, exchanged by a thread that does nothing else while the callback runs.
#[test]
fn a_busy_thread_does_not_disturb_the_callback() {
    let gain = |gain: u16| [ImpulseResponse::new(vec![f32::from(gain)], RATE_HZ).unwrap()];
    let mut reverb = RoomReverb::new(&gain(1), config(1, 1, 16, 10)).unwrap();
    run(&mut reverb, &[vec![1.0; 100]], &[33]);
    let control = reverb.control();
    let busy = std::thread::spawn(move || (1..=2000).for_each(|g| control.exchange(&gain(g)).unwrap()));
    let mut last = 1.0;
    while !busy.is_finished() {
        for y in run(&mut reverb, &[vec![1.0; 256]], &[16])[0].iter() {
            // Later responses are louder, by 1999 at most, and a fade is a straight line of 160 samples.
            assert!(*y > last - 1e-2 && *y < last + 1999.0 / 160.0 + 1e-2, "{y} after {last}");
            last = *y;
        }
    }
    busy.join().unwrap();
    let end = run(&mut reverb, &[vec![1.0; 1000]], &[16]);
    assert!((end[0][999] - 2000.0).abs() < 0.01, "the last responses are heard: {}", end[0][999]);
}

#[test]
fn gains_move_in_a_straight_line() {
    let one = [ImpulseResponse::new(vec![1.0], RATE_HZ).unwrap()];
    let mut reverb = RoomReverb::new(&one, config(1, 1, 16, 10)).unwrap();
    let control = reverb.control();
    run(&mut reverb, &[vec![1.0; 100]], &[10]);
    control.set_wet(0.0).unwrap();
    control.set_dry(0.25).unwrap();
    let out = run(&mut reverb, &[vec![1.0; 400]], &[7]);
    for (n, &y) in out[0].iter().enumerate() {
        // 160 samples from 1 to 0.25.
        let wanted = 1.0 - 0.75 * ((n + 1) as f32 / 160.0).min(1.0);
        assert!((y - wanted).abs() < 1e-5, "sample {n}: {y} != {wanted}");
    }
    for wrong in [f32::NAN, f32::INFINITY, 1e4] {
        assert!(matches!(control.set_wet(wrong), Err(Error::OutOfRange(_))));
        assert!(matches!(control.set_dry(wrong), Err(Error::OutOfRange(_))));
    }
}

#[test]
fn what_is_not_a_number_leaves_with_the_response() {
    let responses = responses(&[2000, 1500], 9);
    let mut reverb = RoomReverb::new(&responses, config(1, 2, 16, 2000)).unwrap();
    let mut input = noise(8000, 4);
    input[100] = f32::NAN;
    let found = run(&mut reverb, &[input.clone()], &[50]);
    assert!(found[0][300].is_nan());
    // The response, and the blocks of the tail that meet the sample.
    input[100] = 0.0;
    let wanted = expected(&[input], &responses, 16);
    assert!(largest_difference(&found, &wanted, 100 + 2000 + 4 * 256..8000) < 2e-4);
}

#[test]
fn settings_responses_and_buffers_that_do_not_fit_are_named() {
    let good = config(1, 2, 16, 100);
    let two = responses(&[100, 100], 1);
    for bad in [
        RoomReverbConfig { sample_rate_hz: 0, ..good },
        RoomReverbConfig { inputs: 0, ..good },
        RoomReverbConfig { inputs: 3, outputs: 3, ..good },
        RoomReverbConfig { inputs: 2, outputs: 1, ..good },
        RoomReverbConfig { outputs: 65, ..good },
        RoomReverbConfig { block: 8, ..good },
        RoomReverbConfig { longest_s: f64::NAN, ..good },
        RoomReverbConfig { longest_s: 1e9, ..good },
        RoomReverbConfig { fade_s: 0.0, ..good },
        RoomReverbConfig { fade_s: 1e9, ..good },
        RoomReverbConfig { wet: f32::NAN, ..good },
    ] {
        assert!(matches!(RoomReverb::new(&two, bad), Err(Error::OutOfRange(_))), "{bad:?}");
    }
    let other = RoomReverbConfig { sample_rate_hz: 44_100, ..good };
    let error = RoomReverb::new(&two, other).unwrap_err().to_string();
    assert_eq!(error, "the reverb runs at 44100 Hz, the response is at 8000 Hz; resample it first");
    let error = RoomReverb::new(&two[..1], good).unwrap_err();
    assert!(matches!(error, Error::Responses { expected: 2, found: 1 }));
    let long = responses(&[100, 101], 1);
    assert!(matches!(RoomReverb::new(&long, good), Err(Error::ResponseLength { most: 100, found: 101 })));

    let stereo = RoomReverbConfig { inputs: 2, ..good };
    let mut reverb = RoomReverb::new(&responses(&[9; 4], 1), stereo).unwrap();
    assert!(matches!(reverb.control().exchange(&two), Err(Error::Responses { expected: 4, found: 2 })));
    let odd = reverb.process_interleaved(&[0.0; 3], &mut [0.0; 2]);
    assert!(matches!(odd, Err(Error::Frames { side: "input", expected: 4, found: 3 })));
    let few = reverb.process_interleaved(&[0.0; 4], &mut [0.0; 2]);
    assert!(matches!(few, Err(Error::Frames { side: "output", expected: 4, found: 2 })));
    let mono = reverb.process_planar(&[&[0.0; 4]], &mut [&mut [0.0; 4], &mut [0.0; 4]]);
    assert!(matches!(mono, Err(Error::ChannelCount { side: "input", expected: 2, found: 1 })));
    let uneven = reverb.process_planar(&[&[0.0; 4], &[0.0; 3]], &mut [&mut [0.0; 4], &mut [0.0; 4]]);
    assert!(matches!(uneven, Err(Error::Frames { side: "input", expected: 4, found: 3 })));
    reverb.process_interleaved(&[], &mut []).unwrap();
}

/// Ten minutes of callbacks of 64 frames at 48 kHz with a stereo response of 3 s, each call timed. In release mode:
/// `cargo test --release -p sabine-eqfilter --test it ten_minutes -- --ignored --nocapture`.
#[test]
#[ignore = "times of single calls: for a quiet machine, in release mode"]
fn ten_minutes_of_callbacks_take_little_of_a_core() {
    let response = |seed| ImpulseResponse::new(noise(144_000, seed), 48_000).unwrap();
    let mut reverb = RoomReverb::new(&[response(1), response(2)], RoomReverbConfig::default()).unwrap();
    let (input, mut output) = (noise(64, 3), vec![0.0; 128]);
    let mut times_s: Vec<f64> = (0..600 * 750)
        .map(|_| {
            let start = std::time::Instant::now();
            reverb.process_interleaved(&input, &mut output).unwrap();
            start.elapsed().as_secs_f64()
        })
        .collect();
    let load = times_s.iter().sum::<f64>() / 600.0;
    times_s.sort_by(f64::total_cmp);
    let deadline_s = 64.0 / 48_000.0;
    let missed = times_s.iter().filter(|&&t| t > deadline_s).count();
    let [median, most, slowest] = [0.5, 0.99, 1.0].map(|q| 1e6 * times_s[(q * 449_999.0) as usize]);
    println!(
        "load {:.2} % of a core; calls {median:.0} us (median), {most:.0} us (all but one in 100), {slowest:.0} us (slowest)",
        100.0 * load
    );
    println!("{missed} of 450,000 took longer than {:.0} us", 1e6 * deadline_s);
    assert!(load < 0.03, "{load}");
}
