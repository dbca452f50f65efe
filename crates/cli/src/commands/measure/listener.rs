//! What `measure` reads besides the decay if it is given more: strength, lateral energy, the ears, speech.

use super::{as_values, cell};
use crate::failure::Failure;
use clap::{Args, ValueEnum};
use sabine::acoustics::{
    Bands, Channel, FreeFieldReference, ImpulseResponse, InterauralCorrelation, LateralEnergy,
    LateralNormalisation, LocatedResponse, ModulationTransfer, NoReading, PerBand, Reading, RoomParameters,
    SoundStrength, SpatialMean, SpeechTransmission, bass_ratio, low_frequency_level, low_frequency_mean,
    mid_frequency_mean, read_response, speech_levels,
};
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// What else is read.
#[derive(Args)]
pub struct ListenerArguments {
    /// Free-field response of the source, with the gain of the measurement: reads the sound strength G
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// Distance at which --reference was measured, in metres
    #[arg(long, value_name = "M", default_value_t = 10.0)]
    reference_distance: f64,
    /// Response of a figure-of-eight microphone at the same place, its null towards the source: reads J_LF, J_LFC and, with
    /// --reference, L_J
    #[arg(long, value_name = "FILE")]
    lateral: Option<PathBuf>,
    /// How loud the figure of eight is on its axis beside the omnidirectional channel
    #[arg(long, value_enum, default_value_t = Normalisation::Equal)]
    normalisation: Normalisation,
    /// Channels 0 and 1 are the ears: reads the interaural cross-correlation; the other quantities are those of channel 0
    #[arg(long, conflicts_with = "channel")]
    binaural: bool,
    /// Read the speech transmission index (IEC 60268-16)
    #[arg(long)]
    sti: bool,
    /// A-weighted level of the speech at the listener in dB, for masking and the threshold of hearing
    #[arg(long, value_name = "DB", requires = "sti")]
    speech_level: Option<f64>,
    /// Levels of the noise in the octaves from 125 Hz to 8 kHz in dB, seven, comma-separated
    #[arg(
        long,
        value_name = "DB,..",
        value_delimiter = ',',
        requires = "speech_level",
        allow_negative_numbers = true
    )]
    noise: Option<Vec<f64>>,
    /// Signal-to-noise ratio of the speech in dB: one for all octaves, or seven
    #[arg(
        long,
        value_name = "DB,..",
        value_delimiter = ',',
        requires = "sti",
        conflicts_with = "speech_level",
        allow_negative_numbers = true
    )]
    snr: Option<Vec<f64>>,
}

/// Names of [`LateralNormalisation`].
#[derive(Clone, Copy, ValueEnum)]
enum Normalisation {
    /// As loud: two calibrated microphones, or ambisonics in SN3D
    Equal,
    /// Louder by the root of three: ambisonics in N3D
    N3d,
    /// Louder by the root of two: B-format after Furse and Malham
    Fuma,
}

/// What was read of one response.
pub struct Listener {
    strength: Option<SoundStrength>,
    lateral: Option<LateralEnergy>,
    ears: Option<InterauralCorrelation>,
    speech: Option<Result<SpeechTransmission, NoReading>>,
}

impl ListenerArguments {
    /// The channel that the other quantities are read from.
    pub fn channel(&self) -> Option<Channel> {
        self.binaural.then_some(Channel::Index(0))
    }

    /// That the options fit the number of files.
    ///
    /// # Errors
    /// `--lateral` with several files.
    pub fn check(&self, files: usize) -> Result<(), Failure> {
        if files > 1 && self.lateral.is_some() {
            return Err("--lateral belongs to one response; measure one at a time".into());
        }
        Ok(())
    }

    /// Reads what was asked for.
    ///
    /// # Errors
    /// Files that cannot be read or do not belong together, levels out of range.
    pub fn read(&self, path: &Path, found: &LocatedResponse, bands: Bands) -> Result<Listener, Failure> {
        let response = &found.response;
        let reference = match &self.reference {
            Some(file) => {
                let free_field = read_response(file, Channel::Mono)?.response;
                let made = FreeFieldReference::measured(&[free_field], self.reference_distance, bands);
                Some(made.map_err(|error| error.in_file(file, "samples"))?)
            }
            None => None,
        };
        let strength = match (&reference, &self.reference) {
            (Some(reference), Some(file)) => {
                let read = SoundStrength::measure(response, reference);
                Some(read.map_err(|error| error.in_file(file, "sample rate"))?)
            }
            _ => None,
        };
        let lateral = match &self.lateral {
            Some(file) => {
                let eight = beside(file, Channel::Mono, found)?;
                let read = LateralEnergy::measure(
                    response,
                    &eight,
                    self.normalisation.into(),
                    bands,
                    reference.as_ref(),
                );
                Some(read.map_err(|error| error.in_file(file, "samples"))?)
            }
            None => None,
        };
        let ears = if self.binaural {
            let right = beside(path, Channel::Index(1), found)?;
            Some(InterauralCorrelation::measure(response, &right, bands)?)
        } else {
            None
        };
        let speech = if self.sti { Some(self.speech(response)?) } else { None };
        Ok(Listener { strength, lateral, ears, speech })
    }

    fn speech(&self, response: &ImpulseResponse) -> Result<Result<SpeechTransmission, NoReading>, Failure> {
        let octaves = |name: &str, values: &[f64]| -> Result<PerBand<f64>, Failure> {
            PerBand::new(Bands::T60, values.to_vec()).map_err(|_| {
                format!("--{name}: {} values for the 7 octaves from 125 Hz to 8 kHz", values.len()).into()
            })
        };
        let transfer = match ModulationTransfer::of_response(response) {
            Ok(transfer) => transfer,
            Err(reason) => return Ok(Err(reason)),
        };
        let transfer = match (&self.snr, self.speech_level) {
            (Some(snr), _) => {
                let all = if snr.len() == 1 { vec![snr[0]; Bands::T60.len()] } else { snr.clone() };
                transfer.with_snr(&octaves("snr", &all)?)?
            }
            (None, Some(level)) => {
                let noise = self.noise.as_ref().map(|noise| octaves("noise", noise)).transpose()?;
                transfer.at_levels(&speech_levels(level), noise.as_ref())?
            }
            (None, None) => transfer,
        };
        Ok(Ok(transfer.index()))
    }
}

impl From<Normalisation> for LateralNormalisation {
    fn from(name: Normalisation) -> Self {
        match name {
            Normalisation::Equal => Self::Equal,
            Normalisation::N3d => Self::N3d,
            Normalisation::Fuma => Self::FuMa,
        }
    }
}

/// Another channel of the measurement, cut as the first.
fn beside(file: &Path, channel: Channel, found: &LocatedResponse) -> Result<ImpulseResponse, Failure> {
    let other = read_response(file, channel)?;
    if other.start_s != found.start_s {
        return Err(format!(
            "{}: the response begins at {:.2} s, the one beside it at {:.2} s; cut both to less than a minute",
            file.display(),
            other.start_s,
            found.start_s
        )
        .into());
    }
    Ok(other.response)
}

impl Listener {
    fn rows(&self) -> Vec<(&'static str, &PerBand<Reading>)> {
        let mut rows = Vec::new();
        if let Some(strength) = &self.strength {
            rows.extend([
                ("g_db", &strength.g_db),
                ("g_early_db", &strength.early_db),
                ("g_late_db", &strength.late_db),
            ]);
        }
        if let Some(lateral) = &self.lateral {
            rows.extend([("j_lf", &lateral.fraction), ("j_lfc", &lateral.cosine_fraction)]);
            rows.extend(lateral.late_level_db.as_ref().map(|level| ("l_j_db", level)));
        }
        if let Some(ears) = &self.ears {
            rows.extend([("iacc_early", &ears.early), ("iacc_late", &ears.late), ("iacc", &ears.all)]);
        }
        rows
    }

    /// Single numbers by ISO 3382-1, table A.1, and the bass ratio.
    fn single_numbers(&self, room: &RoomParameters) -> Vec<(&'static str, Reading)> {
        let mut numbers = vec![
            ("edt_mid_s", mid_frequency_mean(&room.edt_s)),
            ("t30_mid_s", mid_frequency_mean(&room.t30_s)),
            ("c80_mid_db", mid_frequency_mean(&room.c80_db)),
            ("d50_mid", mid_frequency_mean(&room.d50)),
            ("centre_time_mid_s", mid_frequency_mean(&room.centre_time_s)),
            ("bass_ratio", bass_ratio(&room.t30_s)),
        ];
        for (name, readings) in self.rows() {
            numbers.extend(match name {
                "g_db" => Some(("g_mid_db", mid_frequency_mean(readings))),
                "j_lf" => Some(("j_lf_low", low_frequency_mean(readings))),
                "j_lfc" => Some(("j_lfc_low", low_frequency_mean(readings))),
                "l_j_db" => Some(("l_j_low_db", low_frequency_level(readings))),
                _ => None,
            });
        }
        numbers
    }

    /// Lines for the terminal.
    pub fn lines(&self, room: &RoomParameters) -> String {
        let mut text = String::new();
        for (name, readings) in self.rows() {
            let _ = write!(text, "{name:<14}");
            for reading in readings.values() {
                let _ = write!(text, "{:>9}", cell(reading));
            }
            text.push('\n');
        }
        match &self.speech {
            Some(Ok(speech)) => {
                let _ = writeln!(text, "STI {:.3} ({})", speech.value, speech.qualification);
            }
            Some(Err(reason)) => {
                let _ = writeln!(text, "STI - ({reason})");
            }
            None => {}
        }
        let numbers: Vec<String> = self
            .single_numbers(room)
            .into_iter()
            .map(|(name, reading)| format!("{name} {}", cell(&reading)))
            .collect();
        let _ = writeln!(text, "single numbers: {}\n", numbers.join(", "));
        text
    }

    /// Adds what was read to a result.
    pub fn add_to(&self, result: &mut Value, room: &RoomParameters) {
        for (name, readings) in self.rows() {
            result[name] = as_values(readings);
        }
        if let Some(speech) = &self.speech {
            result["sti"] = match speech {
                Ok(speech) => json!({
                    "value": speech.value,
                    "qualification": speech.qualification.to_string(),
                    "modulation_transfer_indices": speech.transmission_indices.values(),
                }),
                Err(reason) => json!({ "value": null, "reason": reason.to_string() }),
            };
        }
        let numbers: Map<String, Value> = self
            .single_numbers(room)
            .into_iter()
            .map(|(name, reading)| (name.to_owned(), reading.map_or(Value::Null, |e| json!(e.value))))
            .collect();
        result["single_numbers"] = Value::Object(numbers);
    }
}

/// One of the quantities of a room.
type Quantity = fn(&RoomParameters) -> &PerBand<Reading>;

/// Means over positions: a line for each quantity, with the standard error of the mean.
///
/// # Errors
/// None where all were measured in the same bands.
pub fn spatial_means(rooms: &[RoomParameters]) -> Result<String, Failure> {
    let mut text = format!("mean over {} positions (and its standard error)\n", rooms.len());
    let quantities: [(&str, Quantity); 6] = [
        ("edt_s", |room| &room.edt_s),
        ("t20_s", |room| &room.t20_s),
        ("t30_s", |room| &room.t30_s),
        ("c80_db", |room| &room.c80_db),
        ("d50", |room| &room.d50),
        ("centre_time_s", |room| &room.centre_time_s),
    ];
    for (name, of) in quantities {
        let positions: Vec<PerBand<Reading>> = rooms.iter().map(|room| of(room).clone()).collect();
        let mean = SpatialMean::over(&positions)?;
        let _ = write!(text, "{name:<14}");
        for reading in mean.mean.values() {
            let _ = write!(text, "{:>9}", cell(reading));
        }
        let _ = write!(text, "\n{:<14}", "");
        for reading in mean.mean.values() {
            let error =
                reading.as_ref().map_or_else(|_| "-".to_owned(), |e| format!("± {:.3}", e.standard_error));
            let _ = write!(text, "{error:>9}");
        }
        text.push('\n');
    }
    let incomplete =
        quantities.iter().any(|(_, of)| rooms.iter().flat_map(|room| of(room).values()).any(Result::is_err));
    if incomplete {
        text.push_str("positions without a reading do not count in its band\n");
    }
    Ok(text)
}
