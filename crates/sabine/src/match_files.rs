//! The main job for files of any length: an hour of speech or of dry sound takes no more memory than a minute.

use crate::clock::Clock;
use crate::matching::{DrySound, Place, match_targets, path_tracer, warn_of_mesh};
use crate::recording::{ClipCounter, judge};
use crate::room_renderer::RoomRenderer;
use crate::{Error, MatchConfig, RoomMatch, Warning};
use sabine_acoustics::{AudioReader, Channel, Observer, SampleFormat, Signal, report};
use sabine_estimator::Estimator;
use sabine_scene::MeasuredRoom;
use std::path::Path;

/// Length of what is kept of a longer file to listen to, in seconds.
pub const EXCERPT_S: f64 = 20.0;
/// Samples that are read at a time.
const BLOCK: usize = 1 << 16;

/// What to match, as files: see [`MatchInput`](crate::MatchInput).
#[derive(Clone, Copy, Debug)]
pub struct MatchFiles<'a> {
    /// Reverberant speech, at least one second.
    pub speech: &'a Path,
    /// Sound without reverberation.
    pub dry: &'a Path,
    /// The channel of both.
    pub channel: Channel,
    /// The room's model.
    pub room: &'a MeasuredRoom,
    /// Where the dry sound comes from: an identifier of the room file.
    pub source: &'a str,
    /// Where it is heard: an identifier of the room file.
    pub receiver: &'a str,
    /// Where the dry sound in the room is written, as WAV with 24 bits.
    pub matched: &'a Path,
}

/// The matched room, and what there is to listen to.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct FileMatch {
    /// The match; its sound is the excerpt of the rendered file that belongs to `dry`.
    pub matched: RoomMatch,
    /// The loudest part of the speech.
    pub speech: Excerpt,
    /// The loudest part of the dry sound.
    pub dry: Excerpt,
}

/// Part of a file: the whole where it lasts no longer than [`EXCERPT_S`], else so many seconds of it, the loudest.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Excerpt {
    /// The sound.
    pub sound: Signal,
    /// Where it begins in the file, in seconds.
    pub start_s: f64,
    /// Length of the file, in seconds.
    pub file_duration_s: f64,
}

impl Excerpt {
    /// Whether the file goes on before or after it.
    pub fn is_part(&self) -> bool {
        self.file_duration_s > EXCERPT_S
    }
}

/// Matches a room with the pretrained estimator and the path tracer, reading and writing in blocks. Where both recordings are no
/// longer than [`EXCERPT_S`], it gives what [`match_room`](crate::match_room) gives, to the step of the written file.
///
/// # Errors
/// As [`match_room`](crate::match_room), and of reading and writing the files.
pub fn match_room_files(
    files: &MatchFiles<'_>,
    config: &MatchConfig,
    observer: &dyn Observer,
) -> Result<FileMatch, Error> {
    let mut clock = Clock::start();
    let place = Place { room: files.room, source: files.source, receiver: files.receiver };
    let speech = Scan::of(files.speech, files.channel)?;
    let mut warnings = Vec::new();
    let clipped = judge(&speech.name, speech.duration_s(), speech.peak, || speech.clipped_share())?;
    if clipped > 0.0 {
        warnings.push(Warning::SlightlyClipped { percent: 100.0 * clipped });
    }
    let dry = Scan::of(files.dry, files.channel)?;
    crate::recording::check_not_silent(&dry.name, dry.peak)?;
    warnings.extend(place.check()?);
    report(observer, "listening", 0, 1)?;
    let estimator = Estimator::pretrained()?;
    let heard = estimator.estimate_reader(&mut AudioReader::open(files.speech, files.channel)?)?;
    for warning in heard.warnings {
        warnings.push(match warning {
            sabine_estimator::Warning::Resampled { from_hz, to_hz } => {
                Warning::SpeechResampled { from_hz, to_hz }
            }
            other => Warning::Speech(other),
        });
    }
    report(observer, "listening", 1, 1)?;
    clock.lap("estimate");
    warn_of_mesh(&place, &mut warnings)?;
    let render = |renderer: &RoomRenderer| {
        let rendered = renderer.render_file(files.dry, files.channel, files.matched, SampleFormat::Int24)?;
        let written = AudioReader::open(files.matched, Channel::Mono)?;
        Ok((dry.excerpt_of(written)?, rendered.gain_db))
    };
    let sound = DrySound { sample_rate_hz: dry.sample_rate_hz, render: &render };
    let matched = match_targets(
        heard.targets,
        warnings,
        clock,
        &path_tracer(config),
        &place,
        &sound,
        config,
        observer,
    )?;
    Ok(FileMatch { matched, speech: speech.excerpt()?, dry: dry.excerpt()? })
}

/// What one pass over a file finds.
struct Scan<'a> {
    path: &'a Path,
    name: String,
    channel: Channel,
    sample_rate_hz: u32,
    samples: u64,
    peak: f32,
    /// Energy of each second.
    energy: Vec<f64>,
}

impl<'a> Scan<'a> {
    fn of(path: &'a Path, channel: Channel) -> Result<Self, Error> {
        let mut reader = AudioReader::open(path, channel)?;
        let sample_rate_hz = reader.sample_rate_hz();
        let (mut second, mut energy, mut peak) = (Vec::new(), Vec::new(), 0.0_f32);
        while reader.read_block(&mut second, sample_rate_hz as usize)? > 0 {
            energy.push(second.iter().map(|&s| f64::from(s).powi(2)).sum());
            peak = second.iter().fold(peak, |peak, s| peak.max(s.abs()));
        }
        let (name, samples) = (path.display().to_string(), reader.position());
        Ok(Self { path, name, channel, sample_rate_hz, samples, peak, energy })
    }

    fn duration_s(&self) -> f64 {
        self.samples as f64 / f64::from(self.sample_rate_hz)
    }

    fn clipped_share(&self) -> Result<f64, Error> {
        let mut reader = AudioReader::open(self.path, self.channel)?;
        let (mut counter, mut block) = (ClipCounter::new(self.peak), Vec::new());
        while reader.read_block(&mut block, BLOCK)? > 0 {
            counter.push(&block);
        }
        Ok(counter.share())
    }

    /// Where the loudest seconds begin.
    fn start_s(&self) -> f64 {
        let length = EXCERPT_S as usize;
        if self.duration_s() <= EXCERPT_S {
            return 0.0;
        }
        let sums =
            self.energy.windows(length.min(self.energy.len())).map(|window| window.iter().sum::<f64>());
        // The first of equally loud ones.
        let best = sums.enumerate().fold((0, 0.0), |best, now| if now.1 > best.1 { now } else { best });
        best.0 as f64
    }

    fn excerpt(&self) -> Result<Excerpt, Error> {
        let reader = AudioReader::open(self.path, self.channel)?;
        Ok(Excerpt {
            sound: self.excerpt_of(reader)?,
            start_s: self.start_s(),
            file_duration_s: self.duration_s(),
        })
    }

    /// The same stretch of this file or of what was made of it; all of it where the file is short.
    fn excerpt_of(&self, mut reader: AudioReader) -> Result<Signal, Error> {
        let rate = f64::from(reader.sample_rate_hz());
        reader.skip((self.start_s() * rate) as u64)?;
        let is_whole = self.duration_s() <= EXCERPT_S;
        let most = if is_whole { usize::MAX } else { (EXCERPT_S * rate) as usize };
        let mut sound = Vec::new();
        reader.read_block(&mut sound, most)?;
        Ok(Signal::new(sound, reader.sample_rate_hz())?)
    }
}
