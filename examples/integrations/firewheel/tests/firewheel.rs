//! What firewheel's graph gives out is the sum that defines a convolution, computed here in full.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

mod graph;

use firewheel::{FirewheelConfig, FirewheelContext, Volume};
use graph::{Graph, decay, noise};
use sabine_acoustics::{ImpulseResponse, resample_response};
use sabine_eqfilter::Error;
use sabine_with_firewheel::{RoomNode, RoomNodeConfig};

/// Left and right of this input, whose channels alternate, asked for in portions as sound cards do; 3000 frames are more than
/// firewheel hands to a node at a time.
fn render(graph: &mut Graph, input: &[f32]) -> [Vec<f32>; 2] {
    let mut heard = Vec::new();
    let frames = input.len() / graph.inputs;
    for portion in [1, 64, 441, 0, 1024, 3000].iter().cycle() {
        let (from, now) = (heard.len() / 2, (frames - heard.len() / 2).min(*portion));
        let mut output = vec![f32::NAN; 2 * now];
        let input = &input[graph.inputs * from..][..graph.inputs * now];
        graph.stream.as_mut().unwrap().render(input, &mut output);
        graph.context.update().unwrap();
        heard.extend(output);
        if heard.len() == 2 * frames {
            break;
        }
    }
    [0, 1].map(|channel| heard.iter().skip(channel).step_by(2).copied().collect())
}

/// The input `late` samples earlier, convolved: tap by tap, in double precision.
fn sum_at(input: &[f32], response: &[f32], late: usize, n: usize) -> f64 {
    let taps = response.iter().enumerate();
    let terms = taps.filter_map(|(k, &h)| Some((h, input.get(n.checked_sub(k + late)?)?)));
    terms.map(|(h, &x)| f64::from(h) * f64::from(x)).sum()
}

fn latency(graph: &Graph) -> usize {
    graph.context.node_info(graph.node).unwrap().info.latency_frames as usize
}

#[test]
fn the_graph_gives_out_the_dry_sound_and_the_convolution() {
    let gains = RoomNode { wet: Volume::Decibels(-6.0), dry: Volume::Decibels(-20.0) };
    let (wet, dry) = (10_f64.powf(-0.3), 0.1);
    for (responses_hz, stream_hz) in [(48_000, 48_000), (44_100, 48_000), (48_000, 44_100)] {
        let responses = [decay(9000, 1, responses_hz), decay(7001, 2, responses_hz)];
        let mut graph = Graph::new(&responses, gains);
        assert_eq!(latency(&graph), 64);
        graph.start(stream_hz).unwrap();
        let input = noise(20_000, 3);
        let heard = render(&mut graph, &input);
        for (heard, response) in heard.iter().zip(&responses) {
            let response = resample_response(response, stream_hz).unwrap();
            for n in (0..heard.len()).step_by(53) {
                let wanted =
                    wet * sum_at(&input, response.samples(), 64, n) + dry * sum_at(&input, &[1.0], 64, n);
                let off = (f64::from(heard[n]) - wanted).abs();
                assert!(off < 2e-6, "{stream_hz} Hz, frame {n}: {} != {wanted}", heard[n]);
            }
        }
    }
}

#[test]
fn two_inputs_have_four_responses() {
    let responses = [11, 12, 13, 14].map(|seed| decay(5000, seed, 48_000));
    let mut graph = Graph::new(&responses, RoomNode::default());
    graph.start(48_000).unwrap();
    let input = noise(2 * 12_000, 5);
    let heard = render(&mut graph, &input);
    let [left, right] = [0, 1].map(|c| input.iter().skip(c).step_by(2).copied().collect::<Vec<f32>>());
    let late = latency(&graph);
    for (side, heard) in heard.iter().enumerate() {
        let (from_left, from_right) = (responses[side].samples(), responses[2 + side].samples());
        for n in (0..heard.len()).step_by(53) {
            let wanted = sum_at(&left, from_left, late, n) + sum_at(&right, from_right, late, n);
            assert!(
                (f64::from(heard[n]) - wanted).abs() < 2e-6,
                "{side}, frame {n}: {} != {wanted}",
                heard[n]
            );
        }
    }
}

/// One sample long: what is heard is the gain.
fn pulses(left: f32, right: f32, sample_rate_hz: u32) -> Vec<ImpulseResponse> {
    [left, right].map(|gain| ImpulseResponse::new(vec![gain], sample_rate_hz).unwrap()).into()
}

#[test]
fn gains_and_rooms_change_without_a_step_while_it_plays() {
    let mut graph = Graph::new(&pulses(0.5, 0.25, 48_000), RoomNode::default());
    graph.start(48_000).unwrap();
    let ones = vec![1.0; 9600]; // four fades
    let steepest = |heard: &[f32]| heard.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f32::max);
    let [left, _] = render(&mut graph, &ones);
    assert!((left[9599] - 0.5).abs() < 1e-6, "{}", left[9599]);

    graph.set_gains(RoomNode { wet: Volume::SILENT, dry: Volume::UNITY_GAIN });
    let [left, right] = render(&mut graph, &ones);
    assert!((left[9599] - 1.0).abs() < 1e-6 && (right[9599] - 1.0).abs() < 1e-6, "the dry sound alone");
    assert!(steepest(&left) < 1e-3 && steepest(&right) < 1e-3, "{} {}", steepest(&left), steepest(&right));

    graph.set_gains(RoomNode::default());
    render(&mut graph, &ones);
    graph.room.change_room(pulses(-0.5, 1.0, 48_000)).unwrap();
    let [left, right] = render(&mut graph, &ones);
    assert!((left[9599] + 0.5).abs() < 1e-6 && (right[9599] - 1.0).abs() < 1e-6, "the other room alone");
    assert!((left[64] - 0.5).abs() < 1e-6, "the first room at first");
    assert!(steepest(&left) < 1e-3 && steepest(&right) < 1e-3, "{} {}", steepest(&left), steepest(&right));
}

#[test]
fn a_bypass_ends_the_decay() {
    let mut graph = Graph::new(&[decay(40_000, 1, 48_000), decay(40_000, 2, 48_000)], RoomNode::default());
    graph.start(48_000).unwrap();
    render(&mut graph, &noise(5000, 3));
    for bypassed in [false, true] {
        if bypassed {
            for state in [true, false] {
                graph.context.queue_bypassed_for(graph.node, state);
                graph.context.update().unwrap();
                render(&mut graph, &[0.0; 2000]); // longer than firewheel fades
            }
        }
        let [left, right] = render(&mut graph, &[0.0; 3000]);
        let silent = left.iter().chain(&right).all(|&sample| sample == 0.0);
        assert_eq!(silent, bypassed, "what was heard before a bypass is not heard after it");
    }
}

#[test]
fn a_stream_at_another_rate_takes_up_the_room_and_the_gains() {
    let [first, second] = [decay(4000, 21, 48_000), decay(4500, 22, 48_000)];
    let mut graph = Graph::new(&[first.clone(), first], RoomNode::default());
    // Before there is a stream: the first one starts with it.
    graph.room.change_room(vec![second.clone(), second.clone()]).unwrap();
    for stream_hz in [48_000, 44_100, 96_000] {
        graph.start(stream_hz).unwrap();
        let input = noise(9000, stream_hz);
        let [left, _] = render(&mut graph, &input);
        let response = resample_response(&second, stream_hz).unwrap();
        for n in (0..9000).step_by(41) {
            let wanted = sum_at(&input, response.samples(), latency(&graph), n);
            assert!(
                (f64::from(left[n]) - wanted).abs() < 2e-6,
                "{stream_hz} Hz, frame {n}: {} != {wanted}",
                left[n]
            );
        }
    }
    // A rate that no response can have: silence, and no panic in firewheel.
    graph.start(900).unwrap();
    let [left, right] = render(&mut graph, &noise(900, 1));
    assert!(left.iter().chain(&right).all(|&s| s == 0.0));
    // A rate that it can have, once more; of the gains meanwhile, what is a number.
    graph.set_gains(RoomNode { wet: Volume::Decibels(f32::NAN), dry: Volume::Decibels(200.0) });
    graph.set_gains(RoomNode { wet: Volume::Decibels(-20.0), dry: Volume::Decibels(200.0) });
    render(&mut graph, &noise(900, 1));
    graph.start(48_000).unwrap();
    let input = noise(9000, 2);
    let [left, _] = render(&mut graph, &input);
    for n in (0..9000).step_by(41) {
        let wanted = 0.1 * sum_at(&input, second.samples(), latency(&graph), n);
        assert!((f64::from(left[n]) - wanted).abs() < 2e-6, "frame {n}: {} != {wanted}", left[n]);
    }
}

#[test]
fn what_does_not_fit_is_refused_and_the_sound_stays() {
    let refused = |responses: Vec<ImpulseResponse>, gains: RoomNode, longest_s: f64, block: usize| {
        let mut context = FirewheelContext::new(FirewheelConfig::default());
        let config = RoomNodeConfig { responses, longest_s, block };
        context.add_node(gains, Some(config)).unwrap_err().to_string()
    };
    let plain = RoomNode::default();
    let loud = RoomNode { wet: Volume::Decibels(61.0), ..plain };
    let nan = RoomNode { dry: Volume::Decibels(f32::NAN), ..plain };
    let one = pulses(1.0, 1.0, 48_000)[..1].to_vec();
    let two_rates = [pulses(1.0, 1.0, 48_000), pulses(1.0, 1.0, 44_100)].map(|pair| pair[0].clone()).to_vec();
    for (error, expected) in [
        (refused(Vec::new(), plain, 1.0, 64), "response"),
        (refused(one.clone(), plain, 1.0, 64), "response"),
        (refused(pulses(1.0, 1.0, 48_000), loud, 1.0, 64), "wet"),
        (refused(pulses(1.0, 1.0, 48_000), nan, 1.0, 64), "dry"),
        (refused(pulses(1.0, 1.0, 48_000), plain, f64::NAN, 64), "longest_s"),
        (refused(pulses(1.0, 1.0, 48_000), plain, 1.0, 0), "block"),
    ] {
        assert!(error.contains(expected), "{error}");
    }
    // Two rates are brought to one, that of the stream.
    let mut graph = Graph::new(&two_rates, plain);
    graph.start(48_000).unwrap();

    let error = Graph::new(&pulses(1.0, 1.0, 48_000), plain).start(900).unwrap_err().to_string();
    assert!(error.contains("between 1 kHz and 768 kHz"), "a stream at no rate of sound: {error}");

    let mut graph = Graph::new(&pulses(0.5, 0.5, 48_000), plain);
    let long = vec![decay(60_000, 1, 48_000); 2];
    assert!(
        matches!(graph.room.change_room(long.clone()), Err(Error::ResponseLength { .. })),
        "before a stream"
    );
    graph.start(48_000).unwrap();
    assert!(matches!(graph.room.change_room(long), Err(Error::ResponseLength { .. })));
    let wrong = graph.room.change_room(one);
    assert!(matches!(wrong, Err(Error::Responses { expected: 2, found: 1 })));
    graph.set_gains(RoomNode { wet: Volume::Decibels(f32::NAN), dry: Volume::Decibels(200.0) });
    let [left, right] = render(&mut graph, &[1.0; 9600]);
    assert!((left[9599] - 0.5).abs() < 1e-6 && (right[9599] - 0.5).abs() < 1e-6, "{}", left[9599]);
    // One gain is still refused; the other one is heard.
    graph.set_gains(RoomNode { wet: Volume::Decibels(-20.0), dry: Volume::Decibels(200.0) });
    let [left, _] = render(&mut graph, &[1.0; 9600]);
    assert!((left[9599] - 0.05).abs() < 1e-6, "{}", left[9599]);
}
