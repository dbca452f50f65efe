//! Devices of the sound system, and what they say.

use cpal::traits::{DeviceTrait, HostTrait};
use cpal::{Device, ErrorKind, Host, SampleFormat, SizedSample, Stream, StreamConfig, SupportedStreamConfig};
use sabine_with_cpal::{MicrophoneWriter, Player, Watch};
use std::error::Error;
use std::sync::Arc;

/// The output of this name, or that of the system.
pub fn output(host: &Host, name: Option<&str>) -> Result<Device, Box<dyn Error>> {
    match name {
        None => host.default_output_device().ok_or_else(|| "the system has no output for sound".into()),
        Some(name) => {
            let mut outputs = host.output_devices()?;
            let found = outputs.find(|device| device.id().is_ok_and(|id| id.to_string() == name));
            found.ok_or_else(|| format!("there is no output `{name}`; --list names them").into())
        }
    }
}

/// The configuration of a device at this rate, or its own.
pub fn config(
    device: &Device,
    is_output: bool,
    rate_hz: Option<u32>,
) -> Result<SupportedStreamConfig, Box<dyn Error>> {
    let usual = if is_output { device.default_output_config() } else { device.default_input_config() };
    let usual = usual.map_err(|error| format!("{device}: {error}"))?;
    let Some(rate_hz) = rate_hz.filter(|&rate_hz| rate_hz != usual.sample_rate()) else { return Ok(usual) };
    let ranges: Vec<_> = if is_output {
        device.supported_output_configs()?.collect()
    } else {
        device.supported_input_configs()?.collect()
    };
    // As many channels as usual, in a format that can be played.
    let fits =
        |format: SampleFormat| matches!(format, SampleFormat::F32 | SampleFormat::I16 | SampleFormat::I32);
    let mut fitting: Vec<_> = ranges
        .iter()
        .filter(|range| fits(range.sample_format()))
        .filter_map(|range| range.try_with_sample_rate(rate_hz))
        .collect();
    fitting.sort_by_key(|config| config.channels().abs_diff(usual.channels()));
    fitting.into_iter().next().ok_or_else(|| {
        let rates = ranges
            .iter()
            .map(|range| format!("{} to {} Hz", range.min_sample_rate(), range.max_sample_rate()));
        let mut rates: Vec<String> = rates.collect();
        rates.sort();
        rates.dedup();
        format!("{device} cannot run at {rate_hz} Hz, but at {}", rates.join(", ")).into()
    })
}

/// What the error callback does with what the sound system says: gaps and faults are counted, a device that has gone ends the
/// application.
fn report(watch: &Watch, device: &'static str, error: &cpal::Error) {
    match error.kind() {
        ErrorKind::Xrun => watch.gap(),
        // The sound goes on.
        ErrorKind::DeviceChanged | ErrorKind::RealtimeDenied => {}
        ErrorKind::DeviceNotAvailable | ErrorKind::HostUnavailable | ErrorKind::StreamInvalidated => {
            watch.end(device, error.to_string());
        }
        _ => watch.fault(device, &error.to_string()),
    }
}

fn play<T>(
    device: &Device,
    config: StreamConfig,
    mut player: Player,
    watch: Arc<Watch>,
) -> Result<Stream, cpal::Error>
where
    T: SizedSample + cpal::FromSample<f32>,
{
    let fill = move |output: &mut [T], _: &cpal::OutputCallbackInfo| player.fill(output);
    device.build_output_stream(config, fill, move |error| report(&watch, "output", &error), None)
}

fn record<T>(
    device: &Device,
    config: StreamConfig,
    mut writer: MicrophoneWriter,
    watch: Arc<Watch>,
) -> Result<Stream, cpal::Error>
where
    T: SizedSample,
    f32: cpal::FromSample<T>,
{
    let write = move |input: &[T], _: &cpal::InputCallbackInfo| writer.write(input);
    device.build_input_stream(config, write, move |error| report(&watch, "microphone", &error), None)
}

/// Calls a function with the type of a sample format.
macro_rules! with_format {
    ($format:expr, $function:ident($($argument:expr),*)) => {
        match $format {
            SampleFormat::I8 => $function::<i8>($($argument),*)?,
            SampleFormat::I16 => $function::<i16>($($argument),*)?,
            SampleFormat::I24 => $function::<cpal::I24>($($argument),*)?,
            SampleFormat::I32 => $function::<i32>($($argument),*)?,
            SampleFormat::U8 => $function::<u8>($($argument),*)?,
            SampleFormat::U16 => $function::<u16>($($argument),*)?,
            SampleFormat::U32 => $function::<u32>($($argument),*)?,
            SampleFormat::F32 => $function::<f32>($($argument),*)?,
            SampleFormat::F64 => $function::<f64>($($argument),*)?,
            format => return Err(format!("the device has the sample format {format}, which has no use here").into()),
        }
    };
}

/// The stream to the loudspeakers, not yet playing.
pub fn play_stream(
    device: &Device,
    config: &SupportedStreamConfig,
    player: Player,
    watch: &Arc<Watch>,
) -> Result<Stream, Box<dyn Error>> {
    let watch = Arc::clone(watch);
    Ok(with_format!(config.sample_format(), play(device, config.config(), player, watch)))
}

/// The stream from the microphone, not yet recording.
pub fn record_stream(
    device: &Device,
    config: &SupportedStreamConfig,
    writer: MicrophoneWriter,
    watch: &Arc<Watch>,
) -> Result<Stream, Box<dyn Error>> {
    let watch = Arc::clone(watch);
    Ok(with_format!(config.sample_format(), record(device, config.config(), writer, watch)))
}
