//! A graph whose input leads through a room to its output.

use firewheel::channel_config::ChannelCount;
use firewheel::diff::{Diff, PathBuilder};
use firewheel::error::ActivateError;
use firewheel::node::NodeID;
use firewheel::{FirewheelConfig, FirewheelContext};
use sabine_acoustics::ImpulseResponse;
use sabine_with_firewheel::offline::Offline;
use sabine_with_firewheel::{RoomHandle, RoomNode, RoomNodeConfig};

pub struct Graph {
    /// Ends before the context does, which would wait for it.
    pub stream: Option<Offline>,
    pub context: FirewheelContext,
    pub node: NodeID,
    pub gains: RoomNode,
    pub room: RoomHandle,
    pub inputs: usize,
}

impl Graph {
    pub fn new(responses: &[ImpulseResponse], gains: RoomNode) -> Self {
        let inputs = responses.len() / 2;
        let mut context = FirewheelContext::new(FirewheelConfig {
            num_graph_inputs: ChannelCount::from(inputs),
            // Quiet sound is no silence.
            clamp_graph_inputs_below: None,
            ..FirewheelConfig::default()
        });
        let responses = responses.to_vec();
        let config = RoomNodeConfig { responses, longest_s: 1.0, ..RoomNodeConfig::default() };
        let node = context.add_node(gains, Some(config)).unwrap();
        let (input, output) = (context.graph_in_node_id(), context.graph_out_node_id());
        let through: Vec<(u32, u32)> = (0..inputs as u32).map(|channel| (channel, channel)).collect();
        context.connect(input, node, &through, true).unwrap();
        context.connect(node, output, &[(0, 0), (1, 1)], true).unwrap();
        let room = RoomHandle::of(&context, node).unwrap();
        Self { stream: None, context, node, gains, room, inputs }
    }

    /// Starts a stream; one that runs already ends.
    pub fn start(&mut self, sample_rate_hz: u32) -> Result<(), ActivateError> {
        self.stream = None;
        self.context.update().unwrap();
        let rate = sample_rate_hz.try_into().unwrap();
        self.stream = Some(Offline::start(&mut self.context, rate, self.inputs as u32)?);
        Ok(())
    }

    pub fn set_gains(&mut self, gains: RoomNode) {
        gains.diff(&self.gains, PathBuilder::default(), &mut self.context.event_queue(self.node));
        self.gains = gains;
        self.context.update().unwrap();
    }
}

pub fn noise(samples: usize, seed: u32) -> Vec<f32> {
    let mut state = seed;
    (0..samples)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state as f32 / u32::MAX as f32 - 0.5
        })
        .collect()
}

/// A decay of noise to -60 dB.
pub fn decay(samples: usize, seed: u32, sample_rate_hz: u32) -> ImpulseResponse {
    let envelope = |n: usize| 0.1 * (-6.9 * n as f32 / samples as f32).exp();
    let noise = noise(samples, seed).into_iter().enumerate().map(|(n, s)| s * envelope(n)).collect();
    ImpulseResponse::new(noise, sample_rate_hz).unwrap()
}
