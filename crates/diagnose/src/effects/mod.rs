//! The catalogue: one file an effect.

mod absorption_tables;
mod air_absorption;
mod angle_dependent_absorption;
mod background_noise;
mod channel_fault;
mod channel_response;
mod coherent_reflections;
mod coordinate_shift;
mod coupled_volume;
mod edge_diffraction;
mod extra_reflector;
mod law_effect;
mod missing_object;
mod nonlinear_distortion;
mod open_patch;
mod position_error;
mod receiver_directivity;
mod room_dimensions;
mod room_modes;
mod sampling_clock;
mod scattering;
mod sound_speed;
mod source_directivity;
mod surface_absorption;
mod surface_displacement;
mod temperature_gradient;
mod time_zero;
mod transducer_response;
mod truncation;
mod unknown_law;

pub use absorption_tables::AbsorptionTables;
pub use air_absorption::AirAbsorption;
pub use angle_dependent_absorption::AngleDependentAbsorption;
pub use background_noise::BackgroundNoise;
pub use channel_fault::ChannelFault;
pub use channel_response::ChannelResponse;
pub use coherent_reflections::CoherentReflections;
pub use coordinate_shift::CoordinateShift;
pub use coupled_volume::CoupledVolume;
pub use edge_diffraction::MissingDiffraction;
pub use extra_reflector::ExtraReflector;
pub use law_effect::LawEffect;
pub use missing_object::MissingObject;
pub use nonlinear_distortion::NonlinearDistortion;
pub use open_patch::OpenPatch;
pub use position_error::PositionError;
pub use receiver_directivity::ReceiverDirectivity;
pub use room_dimensions::RoomDimensions;
pub use room_modes::RoomModes;
pub use sampling_clock::SamplingClock;
pub use scattering::Scattering;
pub use sound_speed::SoundSpeed;
pub use source_directivity::SourceDirectivity;
pub use surface_absorption::SurfaceAbsorption;
pub use surface_displacement::SurfaceDisplacement;
pub use temperature_gradient::TemperatureGradient;
pub use time_zero::TimeZeroOffset;
pub use transducer_response::TransducerResponse;
pub use truncation::Truncation;
pub use unknown_law::UnknownLaw;
pub(crate) use unknown_law::{BandLaw, Covariate, Formula, Grammar, Wave};

use crate::effect::Effect;

/// The effects that every diagnosis weighs.
pub fn catalogue() -> Vec<Box<dyn Effect>> {
    vec![
        Box::new(TransducerResponse),
        Box::new(AirAbsorption),
        Box::new(SourceDirectivity),
        Box::new(Scattering),
        Box::new(SurfaceAbsorption),
        Box::new(BackgroundNoise),
        Box::new(CoupledVolume),
        Box::new(Truncation),
        Box::new(SoundSpeed),
        Box::new(SamplingClock),
        Box::new(RoomDimensions),
        Box::new(PositionError),
        Box::new(TimeZeroOffset),
        Box::new(ChannelFault),
        Box::new(ExtraReflector),
        Box::new(OpenPatch),
        Box::new(AngleDependentAbsorption),
        Box::new(NonlinearDistortion),
        Box::new(MissingDiffraction),
        Box::new(RoomModes),
        Box::new(ReceiverDirectivity),
        Box::new(ChannelResponse),
        Box::new(CoherentReflections),
        Box::new(SurfaceDisplacement),
        Box::new(CoordinateShift),
        Box::new(TemperatureGradient),
        Box::new(AbsorptionTables),
    ]
}

/// Effects that come with this crate and are weighed only where they are asked for by name ([`Diagnoser::with_also`](crate::Diagnoser::with_also),
/// [`Diagnoser::with_only`](crate::Diagnoser::with_only)): [`MissingObject`], for what a directional loudspeaker does not send is missing as if an
/// object hid it.
pub fn on_request() -> Vec<Box<dyn Effect>> {
    vec![Box::new(MissingObject)]
}

/// Logarithm of a sum of energies, one of them given as its logarithm.
fn add_energy(ln_energy: f64, more: f64) -> f64 {
    let ln_more = more.max(1e-300).ln();
    let (high, low) = if ln_energy > ln_more { (ln_energy, ln_more) } else { (ln_more, ln_energy) };
    high + (low - high).exp().ln_1p()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::info::discriminating_measurement;
    use crate::effect::next_measurement::NextMeasurement;

    #[test]
    fn every_effect_has_an_identifier_and_a_title_of_its_own() {
        let infos: Vec<_> = catalogue().iter().chain(&on_request()).map(|e| e.info()).collect();
        for (i, a) in infos.iter().enumerate() {
            assert!(a.explanation.ends_with('.') && !a.title.ends_with('.'), "{}", a.id);
            assert!(a.id.chars().all(|c| c.is_ascii_lowercase() || c == '_'), "{}", a.id);
            assert!(infos[..i].iter().all(|b| a.id != b.id && a.title != b.title), "{}", a.id);
            for (other, _) in a.against {
                assert!(infos.iter().any(|b| b.id == *other), "{} against {other}", a.id);
            }
        }
    }

    #[test]
    fn what_is_weighed_on_request_is_not_weighed_without() {
        let new = || crate::Diagnoser::new(crate::DiagnoseConfig::default()).expect("a configuration");
        let weighs = |d: &crate::Diagnoser| format!("{d:?}").contains("missing_object");
        let ids = |id: &str| vec![id.to_owned()];
        assert!(!weighs(&new()));
        let also = new().with_also(&ids("missing_object")).expect("an effect");
        // Asked for twice, it is weighed once.
        let again = also.with_also(&ids("missing_object")).expect("an effect");
        assert_eq!(format!("{again:?}").matches("missing_object").count(), 1);
        assert!(weighs(&new().with_only(&ids("missing_object")).expect("an effect")));
        assert!(!weighs(&new().with_only(&ids("time_zero")).expect("an effect")));
        let refused = new().with_also(&ids("furniture"));
        assert!(matches!(refused, Err(crate::Error::UnknownEffect { id }) if id == "furniture"));
    }

    #[test]
    fn what_decides_between_two_effects_does_not_depend_on_their_order() {
        let infos: Vec<_> = catalogue().iter().chain(&on_request()).map(|e| e.info()).collect();
        for a in &infos {
            for b in &infos {
                let measurement = discriminating_measurement(a, b);
                assert_eq!(measurement, discriminating_measurement(b, a), "{} {}", a.id, b.id);
            }
        }
        let decides = |a: &dyn Effect, b: &dyn Effect| discriminating_measurement(&a.info(), &b.info());
        assert_eq!(decides(&CoupledVolume, &BackgroundNoise), NextMeasurement::LouderAndLonger);
        assert_eq!(decides(&BackgroundNoise, &Truncation), NextMeasurement::LongerWithSilence);
        assert_eq!(decides(&MissingDiffraction, &SurfaceAbsorption), NextMeasurement::MorePositionsAndSource);
    }
}
