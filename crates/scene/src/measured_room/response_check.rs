//! Whether a file that is said to hold an impulse response does.

use crate::error::Error;
use sabine_acoustics::{NoReading, Onset, check_one_onset};

/// Refuses silence, noise without direct sound, and speech or music.
pub(crate) fn check(samples: &[f32], sample_rate_hz: u32) -> Result<(), Error> {
    if samples.iter().all(|&sample| sample == 0.0) {
        return Err(Error::Silent);
    }
    match Onset::find(samples, sample_rate_hz) {
        // A short piece is short, not wrong: whether it suffices is for the measurement to say.
        Ok(_) | Err(NoReading::TooShort { .. }) => {}
        Err(source) => return Err(Error::NoDirectSound { source }),
    }
    Ok(check_one_onset(samples, sample_rate_hz)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sabine_acoustics::Error as ValueError;
    use sabine_acoustics::{Channel, read_audio};

    /// Noise of a power that decays by 60 dB in `t60_s`, from each of some onsets (s) on.
    fn decays(onsets_s: &[f64], t60_s: f64, duration_s: f64) -> Vec<f32> {
        let mut state = 1u32;
        (0..(16_000.0 * duration_s) as usize)
            .map(|i| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let noise = f64::from(state >> 8) / 8_388_608.0 - 1.0;
                let since = onsets_s.iter().map(|onset| i as f64 / 16_000.0 - onset).filter(|t| *t >= 0.0);
                let envelope: f64 = since.map(|t| (-6.9 * t / t60_s).exp()).sum();
                (noise * (envelope + 1e-4)) as f32
            })
            .collect()
    }

    #[test]
    fn responses_pass_and_other_sounds_do_not() {
        for t60_s in [0.1, 0.5, 3.0] {
            check(&decays(&[0.1], t60_s, 4.0), 16_000).unwrap();
            // Late echoes.
            check(&decays(&[0.1, 0.6, 1.2], t60_s, 4.0), 16_000).unwrap();
        }
        assert!(matches!(check(&[0.0; 16_000], 16_000), Err(Error::Silent)));
        assert!(matches!(check(&decays(&[], 1.0, 1.0), 16_000), Err(Error::NoDirectSound { .. })));
        let syllables: Vec<f64> = (0..12).map(|i| 0.3 * f64::from(i)).collect();
        let talk = check(&decays(&syllables, 0.3, 4.0), 16_000);
        assert!(
            matches!(talk, Err(Error::Acoustics(ValueError::NotAResponse { bursts, .. })) if bursts > 6),
            "{talk:?}"
        );
    }

    #[test]
    fn recorded_speech_is_no_response() {
        let fixtures = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures");
        for name in
            ["speech/recording.wav", "speech/dry_reader.wav", "speech/dry_talker.wav", "speech/dry_guest.wav"]
        {
            let speech = read_audio(format!("{fixtures}/{name}"), Channel::Index(0)).unwrap();
            let found = check(speech.samples(), speech.sample_rate_hz());
            assert!(
                matches!(found, Err(Error::Acoustics(ValueError::NotAResponse { .. }))),
                "{name}: {found:?}"
            );
        }
        for name in ["room/ir/talker_corner.wav", "room/ir/talker_microphone.wav"] {
            let response = read_audio(format!("{fixtures}/{name}"), Channel::Mono).unwrap();
            check(response.samples(), response.sample_rate_hz()).unwrap();
        }
    }
}
