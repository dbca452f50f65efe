//! A page with what the rooms sound like.

use crate::error::Error;
use crate::judge::{Octave, Quantity};
use crate::methods::{Method, Rendered};
use sabine::acoustics::{ImpulseResponse, SampleFormat, Signal, encode_wav, resample, resample_response};
use sabine::eqfilter::convolve;
use sabine_cli::chart::{Chart, Look, Scale, Series};
use sabine_cli::page::Page;

/// Rate of the examples, in Hz.
const RATE_HZ: u32 = 32_000;
/// Length of what is heard of a recording, in seconds.
const EXCERPT_S: f64 = 8.0;
/// Peak of an example.
const PEAK: f32 = 0.5;

/// One room on the page: the first of its responses.
pub struct Example<'a> {
    /// The room, source and receiver.
    pub title: String,
    /// What the estimator heard.
    pub recording: &'a Signal,
    /// A voice without reverberation.
    pub dry: &'a Signal,
    /// The measured response.
    pub measured: &'a ImpulseResponse,
    /// The rendered ones.
    pub rendered: &'a [Rendered],
}

impl Example<'_> {
    /// Adds players and charts to the page.
    ///
    /// # Errors
    /// [`Error::Acoustics`] and [`Error::Chart`], which sound that has come this far does not cause.
    pub fn write(&self, page: &mut Page) -> Result<(), Error> {
        page.heading(&self.title);
        page.markup("<div class=\"small\">");
        let start = Signal::new(
            self.recording.samples()[..self
                .recording
                .samples()
                .len()
                .min((EXCERPT_S * f64::from(self.recording.sample_rate_hz())) as usize)]
                .to_vec(),
            self.recording.sample_rate_hz(),
        )?;
        page.player(&wav(&start)?, "The recording that was heard, its first seconds");
        page.player(&wav(self.dry)?, "Another voice, dry");
        page.player(&self.through(self.measured)?, "That voice in the measured response");
        for (method, caption) in [
            (Method::Blind, "That voice in the response rendered from the recording"),
            (Method::Given, "That voice in the response rendered from the measured one"),
        ] {
            if let Some(found) = self.of(method) {
                page.player(&self.through(&found.response)?, caption);
            }
        }
        page.markup("</div><div class=\"small\">");
        for (quantity, label) in [(Quantity::T60, "T60 (s)"), (Quantity::Eq, "EQ re 1 kHz (dB)")] {
            let chart = self.chart(quantity, label).svg();
            let chart = chart.map_err(|error| Error::Chart { reason: error.to_string() })?;
            page.markup(&format!("<figure>{chart}</figure>"));
        }
        page.markup("</div>");
        Ok(())
    }

    fn of(&self, method: Method) -> Option<&Rendered> {
        self.rendered.iter().find(|found| found.method == method)
    }

    fn chart(&self, quantity: Quantity, label: &str) -> Chart {
        let points = |method: Method, pick: fn(&Octave) -> f64| -> Vec<(f64, f64)> {
            let octaves = self.of(method).map(|found| &found.octaves[..]).unwrap_or_default();
            octaves.iter().filter(|o| o.quantity == quantity).map(|o| (o.band_hz, pick(o))).collect()
        };
        let rendered: fn(&Octave) -> f64 = |o| o.rendered.unwrap_or(f64::NAN);
        let measured = points(Method::Blind, |o| o.measured);
        let bands = measured.iter().map(|(hz, _)| *hz).collect();
        let series = vec![
            Series::new("measured", Look::Dashed, 4, measured),
            Series::new("heard", Look::Line, 2, points(Method::Blind, |o| o.target)),
            Series::new("blind", Look::Dots, 0, points(Method::Blind, rendered)),
            Series::new("response given", Look::Dots, 1, points(Method::Given, rendered)),
        ];
        Chart {
            x_label: "Octave (Hz)".to_owned(),
            y_label: label.to_owned(),
            x: Scale::Octaves(bands),
            y: None,
            series,
            small: true,
        }
    }

    /// The dry voice through a response, as a file.
    fn through(&self, response: &ImpulseResponse) -> Result<Vec<u8>, Error> {
        let (dry, response) = (resample(self.dry, RATE_HZ)?, resample_response(response, RATE_HZ)?);
        let mut wet = convolve(dry.samples(), response.samples());
        wet.truncate(dry.samples().len() + RATE_HZ as usize);
        wav(&Signal::new(wet, RATE_HZ)?)
    }
}

/// A sound as loud as all others, as a file.
fn wav(sound: &Signal) -> Result<Vec<u8>, Error> {
    let gain = PEAK / sound.peak().max(f32::MIN_POSITIVE);
    let samples = sound.samples().iter().map(|s| s * gain).collect();
    Ok(encode_wav(&Signal::new(samples, sound.sample_rate_hz())?, SampleFormat::Int16)?)
}
