//! A backend that renders into memory in place of a sound card.

use kira::backend::{Backend, Renderer};
use std::convert::Infallible;

/// Renders when asked to.
pub struct Offline {
    renderer: Option<Renderer>,
}

/// Settings of [`Offline`].
#[derive(Clone, Copy, Debug)]
pub struct OfflineSettings {
    /// In Hz.
    pub sample_rate_hz: u32,
}

impl Default for OfflineSettings {
    fn default() -> Self {
        Self { sample_rate_hz: 48_000 }
    }
}

impl Backend for Offline {
    type Settings = OfflineSettings;
    type Error = Infallible;

    fn setup(settings: OfflineSettings, _internal_buffer_size: usize) -> Result<(Self, u32), Infallible> {
        Ok((Self { renderer: None }, settings.sample_rate_hz))
    }

    fn start(&mut self, renderer: Renderer) -> Result<(), Infallible> {
        self.renderer = Some(renderer);
        Ok(())
    }
}

impl Offline {
    /// The next frames, left and right alternating, as one call of a sound card would ask for them.
    pub fn render(&mut self, frames: usize) -> Vec<f32> {
        let mut out = vec![0.0; 2 * frames];
        if let Some(renderer) = &mut self.renderer {
            renderer.on_start_processing();
            renderer.process(&mut out, 2);
        }
        out
    }

    /// Tells the engine that the sound card runs at another rate now.
    pub fn change_sample_rate(&mut self, sample_rate_hz: u32) {
        if let Some(renderer) = &mut self.renderer {
            renderer.on_change_sample_rate(sample_rate_hz);
        }
    }
}
