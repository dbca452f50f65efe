//! How loud a response is in each octave.

use crate::band_energy::{BandEnergy, Prepared};
use crate::bands::Bands;
use crate::error::Error;
use crate::estimate::{Estimate, NoReading, Reading};
use crate::per_band::PerBand;
use crate::signal::ImpulseResponse;

/// The octave that all levels refer to.
const REFERENCE_HZ: f64 = 1000.0;

/// Mean power spectral density of a response in each octave relative to the octave at 1 kHz, in dB (Tang et al. 2020,
/// section 3.3): 0 dB in every band for a flat spectrum, and by definition at 1 kHz.
///
/// The spectrum is that of the response from its onset to where it sinks into the noise, less the noise. The standard error
/// is what the noise leaves uncertain in this response; other positions in the room differ by more.
///
/// ```
/// use sabine_acoustics::{Bands, ImpulseResponse, equalisation};
/// let mut samples = vec![0.0; 4000];
/// (samples[100], samples[101]) = (1.0, -1.0); // a difference: |H| = 2 sin(pi f / rate), 6 dB per octave
/// let levels = equalisation(&ImpulseResponse::new(samples, 48000)?, Bands::EQ)?;
/// let at_500_hz = levels.at_hz(500.0).unwrap().as_ref().unwrap().value;
/// assert!((at_500_hz - -6.0).abs() < 0.1);
/// # Ok::<(), sabine_acoustics::Error>(())
/// ```
///
/// # Errors
/// [`Error::UnknownBand`] never in practice: the reference octave is nominal.
pub fn equalisation(response: &ImpulseResponse, bands: Bands) -> Result<PerBand<Reading>, Error> {
    let prepared = Prepared::new(response);
    let reference = Bands::octaves(REFERENCE_HZ, REFERENCE_HZ)?.edges_hz(0);
    let edges: Vec<(f64, f64)> = (0..bands.len()).map(|i| bands.edges_hz(i)).collect();
    let all = edges.iter().copied().chain([reference]);
    let densities: Vec<Reading> = prepared.bands(all).into_iter().map(|band| density(&band?)).collect();
    let reference = &densities[bands.len()];
    Ok(PerBand::from_fn(bands, |i| {
        if bands.nominal_hz(i) == REFERENCE_HZ {
            return reference.clone().map(|_| Estimate::exact(0.0));
        }
        let (band, reference) = (densities[i].clone()?, reference.clone()?);
        let relative = |e: Estimate| e.standard_error / e.value;
        let error = 10.0 / std::f64::consts::LN_10 * relative(band).hypot(relative(reference));
        Ok(Estimate::new(10.0 * (band.value / reference.value).log10(), error))
    }))
}

/// Energy per bandwidth.
fn density(band: &BandEnergy) -> Reading {
    let (net, variance) = band.net(band.first, band.end);
    let energy = net + band.tail;
    if energy <= 3.0 * variance.sqrt() || energy <= 0.0 {
        let db = |e: f64| 10.0 * e.max(f64::MIN_POSITIVE).log10();
        // The band's energy must stand 5 dB (three standard deviations) out of the noise's fluctuation.
        return Err(NoReading::DynamicRange {
            needed_db: 5.0,
            available_db: db(energy) - db(variance.sqrt()),
        });
    }
    Ok(Estimate::new(energy / band.energy_bandwidth_hz, variance.sqrt() / band.energy_bandwidth_hz))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_spectrum_is_at_0_db() {
        let mut samples = vec![0.0; 16000];
        samples[800] = 1.0;
        let levels = equalisation(&ImpulseResponse::new(samples, 16000).unwrap(), Bands::EQ).unwrap();
        for (hz, level) in levels.iter() {
            assert!(level.as_ref().unwrap().value.abs() < 0.02, "{hz} Hz: {level:?}");
        }
    }

    #[test]
    fn silence_and_bands_above_nyquist_have_no_level() {
        let silent = ImpulseResponse::new(vec![0.0; 16000], 16000).unwrap();
        assert!(equalisation(&silent, Bands::EQ).unwrap().values().iter().all(Result::is_err));
        let mut samples = vec![0.0; 8000];
        samples[800] = 1.0;
        let levels = equalisation(&ImpulseResponse::new(samples, 8000).unwrap(), Bands::EQ).unwrap();
        assert!(matches!(levels.at_hz(4000.0), Some(Err(NoReading::AboveNyquist { .. }))));
        assert!(levels.at_hz(2000.0).unwrap().is_ok());
    }
}
