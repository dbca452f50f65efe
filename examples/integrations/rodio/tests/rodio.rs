//! What rodio plays is the convolution of the source, from its start to the end of the room's decay.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

use rodio::Source;
use rodio::buffer::SamplesBuffer;
use rodio::source::UniformSourceIterator;
use sabine_acoustics::{Channel, ImpulseResponse, read_audio};
use sabine_eqfilter::Error;
use sabine_with_rodio::Room;

fn room() -> [ImpulseResponse; 2] {
    ["talker_microphone", "talker_corner"].map(|file| {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../fixtures/room/ir/");
        read_audio(format!("{folder}{file}.wav"), Channel::Mono).unwrap().into()
    })
}

fn noise(length: usize, channels: u16, rate_hz: u32) -> SamplesBuffer {
    let mut state = 1_u32;
    let samples: Vec<f32> = (0..length * usize::from(channels))
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state as f32 / u32::MAX as f32 - 0.5
        })
        .collect();
    SamplesBuffer::new(channels.try_into().unwrap(), rate_hz.try_into().unwrap(), samples)
}

#[test]
fn the_source_is_convolved_without_latency_and_to_its_end() {
    let responses = room();
    let rate_hz = responses[0].sample_rate_hz();
    let longest = responses.iter().map(|r| r.samples().len()).max().unwrap();
    for (channels, source_hz) in [(1, rate_hz), (2, rate_hz), (2, 48_000)] {
        let source = noise(3001, channels, source_hz);
        // The same conversion by rodio, without the room.
        let dry: Vec<f32> =
            UniformSourceIterator::new(source.clone(), 2.try_into().unwrap(), rate_hz.try_into().unwrap())
                .collect();
        let dry: Vec<f32> = dry.chunks_exact(2).map(|frame| 0.5 * (frame[0] + frame[1])).collect();
        let room = Room::new(source, &responses, longest as f64 / f64::from(rate_hz)).unwrap();
        assert_eq!((room.channels().get(), room.sample_rate().get()), (2, rate_hz));
        let heard: Vec<f32> = room.collect();
        assert_eq!(heard.len() / 2, dry.len() + longest - 1, "the source and the decay");
        for (channel, response) in responses.iter().enumerate() {
            for n in (0..heard.len() / 2).step_by(41) {
                let taps = response.samples().iter().enumerate();
                let sum =
                    taps.filter_map(|(k, &h)| Some(f64::from(h) * f64::from(*dry.get(n.checked_sub(k)?)?)));
                let (wanted, found) = (sum.sum::<f64>(), heard[2 * n + channel]);
                assert!((f64::from(found) - wanted).abs() < 1e-4, "frame {n}: {found} != {wanted}");
            }
        }
    }
}

#[test]
fn an_empty_source_and_wrong_responses_are_no_panic() {
    let empty = Room::new(noise(0, 1, 48_000), &room(), 4.0).unwrap();
    assert!(empty.control().set_dry(0.5).is_ok());
    assert!(empty.total_duration().is_some());
    assert!(empty.into_iter().all(|sample| sample == 0.0));
    let [left, _] = room();
    let other = ImpulseResponse::new(vec![1.0], 96_000).unwrap();
    let wrong = Room::new(noise(10, 1, 48_000), &[left, other], 4.0);
    assert!(matches!(wrong.err(), Some(Error::ResponseRate { .. })));
}
