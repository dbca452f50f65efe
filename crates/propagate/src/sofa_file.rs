//! Head responses from AES69 (SOFA) files.

use crate::vector::{Vec3, norm};
use crate::{Error, HeadResponses};
use sofar::reader::{Filter, OpenOptions};
use std::path::Path;

/// Measurements nearer than this share of the farthest distance are left out.
const FARTHEST: f64 = 0.99;

impl HeadResponses {
    /// Reads head-related impulse responses (convention SimpleFreeFieldHRIR) at the sample rate of the file; for another one
    /// see [`HeadResponses::resampled`].
    ///
    /// Levels stay as they are in the file; its delays become leading zeros, to the nearest sample. Of measurements at
    /// several distances the farthest are taken.
    ///
    /// # Errors
    /// [`Error::Sofa`], naming the file, if it cannot be read or is no such file, if it is damaged, or if it does not hold
    /// responses of two ears.
    pub fn read_sofa(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let failed =
            |source: Box<dyn std::error::Error + Send + Sync>| Error::Sofa { path: path.to_owned(), source };
        let bytes = std::fs::read(path).map_err(|error| failed(Box::new(error)))?;
        // The reader resamples where the rates differ, without keeping the gain; from what is not a number none differs.
        // Built with assertions, it panics on a damaged file instead of saying so.
        let opened = std::panic::catch_unwind(|| {
            OpenOptions::new().sample_rate(f32::NAN).normalized(false).open_data(&bytes)
        });
        let file = match opened {
            Ok(Ok(file)) => file,
            Ok(Err(error)) => return Err(failed(Box::new(error))),
            Err(_) => return Err(failed("the file is damaged".into())),
        };
        let rate = f64::from(file.sample_rate());
        let no_rate = |_| failed(format!("a sample rate of {rate} Hz").into());
        sabine_acoustics::OutOfRange::check("sample rate (Hz)", rate, 1e3, 768e3, "between 1 and 768 kHz")
            .map_err(no_rate)?;
        let (ears, taps) = (file.hrtf().r(), file.filter_len());
        if ears != 2 || taps == 0 {
            return Err(failed(
                format!("{ears} ears and {taps} taps: no head-related impulse responses").into(),
            ));
        }
        let positions: Vec<Vec3> = file
            .hrtf()
            .source_position
            .values
            .chunks_exact(3)
            .map(|p| [f64::from(p[0]), f64::from(p[1]), f64::from(p[2])])
            .collect();
        let farthest = positions.iter().map(|&p| norm(p)).fold(0.0, f64::max);
        // Of all delays, so that the responses have one length.
        let longest_s = f64::from(file.max_delay());
        let length = taps + (longest_s * rate).round() as usize;
        let (mut directions, mut left, mut right) = (Vec::new(), Vec::new(), Vec::new());
        for position in positions.into_iter().filter(|&p| norm(p) >= FARTHEST * farthest) {
            let mut pair = Filter::new(taps);
            let [x, y, z] = position.map(|c| c as f32);
            file.filter_nointerp(x, y, z, &mut pair);
            let delayed = |response: &[f32], delay_s: f32| {
                let mut samples = vec![0.0; (f64::from(delay_s) * rate).round() as usize];
                samples.extend_from_slice(response);
                samples.resize(length, 0.0);
                samples
            };
            directions.push(position);
            left.push(delayed(&pair.left, pair.ldelay));
            right.push(delayed(&pair.right, pair.rdelay));
        }
        Self::new(directions, left, right, rate.round() as u32).map_err(|error| failed(Box::new(error)))
    }
}
