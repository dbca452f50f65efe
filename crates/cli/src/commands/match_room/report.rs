//! The page that a person would rather look at than read.

use crate::chart::{Chart, Look, Scale, Series};
use crate::failure::Failure;
use crate::page::{Page, escape};
use crate::spectrogram::spectrogram_png;
use sabine::acoustics::{EnergyDecayCurve, Estimate, PerBand, SampleFormat, Signal, encode_wav, resample};
use sabine::eqfilter::convolve;
use sabine::{DECAY_STEP_S, Excerpt, MatchInput, MatchSummary, MaterialChange, RoomMatch};

type Result<T> = std::result::Result<T, Failure>;

/// 1.645 standard errors either side: a 90 % interval.
const NORMAL_90: f64 = 1.645;
/// Lowest level of the decay plot.
const DECAY_FLOOR_DB: f64 = -50.0;

/// The files that a match was made from and wrote; the page holds no more of each than an excerpt.
#[derive(Clone, Copy, Debug)]
pub struct Excerpts<'a> {
    /// Of the recording.
    pub speech: &'a Excerpt,
    /// Of the dry sound.
    pub dry: &'a Excerpt,
    /// Name of the rendered file, beside the page.
    pub matched: &'a str,
}

/// The report as one HTML file, for sounds that are whole in memory.
///
/// # Errors
/// A chart, a picture or a sound cannot be drawn or encoded.
pub fn html(
    input: &MatchInput<'_>,
    room_name: &str,
    matched: &RoomMatch,
    summary: &MatchSummary,
) -> Result<String> {
    page(input, room_name, matched, summary, None)
}

/// The report as one HTML file, for recordings of any length: `input` and `matched` hold the excerpts.
///
/// # Errors
/// As [`html`].
pub fn html_of_files(
    input: &MatchInput<'_>,
    room_name: &str,
    matched: &RoomMatch,
    summary: &MatchSummary,
    excerpts: &Excerpts<'_>,
) -> Result<String> {
    page(input, room_name, matched, summary, Some(excerpts))
}

/// What was done to the level of the rendered sound, in a sentence.
pub fn level(summary: &MatchSummary) -> String {
    let gain_db = summary.matched_gain_db;
    if gain_db < 0.0 {
        return format!(
            "The sound in the room was turned down by {:.1} dB to stay within full scale; without that it would have the level of a source whose sound at 1 m is the dry sound.",
            -gain_db
        );
    }
    "The level of the sound in the room is that of a source whose sound at 1 m is the dry sound; it was not scaled."
        .to_owned()
}

/// Which part of a file is on the page, if not all of it.
fn part(excerpt: Option<&Excerpt>) -> String {
    match excerpt {
        Some(excerpt) if excerpt.is_part() => format!(
            " (its loudest {}, from {} on)",
            seconds(excerpt.sound.duration_s()),
            seconds(excerpt.start_s)
        ),
        _ => String::new(),
    }
}

fn page(
    input: &MatchInput<'_>,
    room_name: &str,
    matched: &RoomMatch,
    summary: &MatchSummary,
    excerpts: Option<&Excerpts<'_>>,
) -> Result<String> {
    let (speech_part, dry_part) = (part(excerpts.map(|e| e.speech)), part(excerpts.map(|e| e.dry)));
    let speech_s = excerpts.map_or(input.speech.signal.duration_s(), |e| e.speech.file_duration_s);
    let mut page = Page::new("Your room, matched");
    page.paragraph(&format!(
        "From {} of speech in {} the room's sound was estimated, the materials of its model ({}) were fitted, and {} was placed at \"{}\" and heard at \"{}\".",
        seconds(speech_s),
        file_name(input.speech.name),
        file_name(room_name),
        file_name(input.dry.name),
        input.source,
        input.receiver,
    ));
    page.paragraph(&verdict(summary));
    page.paragraph(&input.room.size_line());
    page.warnings(&summary.warnings);
    page.heading("Listen");
    let before = in_room_before(input, matched)?;
    page.markup("<div class=\"small\"><section>");
    page.player(
        &player_wav(input.speech.signal)?,
        &format!("The recording: what the room sounds like{speech_part}"),
    );
    page.markup("</section><section>");
    page.player(&player_wav(input.dry.signal)?, &format!("The dry sound{dry_part}"));
    page.markup("</section><section>");
    page.player(&player_wav(&before)?, &format!("The dry sound in the simulation before matching{dry_part}"));
    page.markup("</section><section>");
    page.player(
        &player_wav(&matched.matched)?,
        &format!("The dry sound, placed in the matched room{dry_part}"),
    );
    if let Some(excerpts) = excerpts.filter(|e| e.dry.is_part()) {
        let (name, length) = (escape(excerpts.matched), seconds(excerpts.dry.file_duration_s));
        page.markup(&format!("<p>The whole, {length}: <a href=\"{name}\">{name}</a></p>"));
    }
    page.markup("</section></div>");
    page.paragraph(&level(summary));
    page.markup("<div class=\"grid\"><section>");
    page.heading("Reverberation time: heard and reached");
    page.markup(&t60_chart(matched, summary).svg()?);
    page.markup("</section><section>");
    page.heading("Equalisation");
    page.markup(&eq_chart(matched).svg()?);
    page.markup("</section><section>");
    page.heading("Decay of the rendered response");
    page.markup(&decay_chart(&matched.decay, matched.targets.t60_s()).svg()?);
    page.markup("</section></div><div class=\"grid\"><section>");
    page.heading("Spectrogram of the recording");
    page.picture(
        &spectrogram_png(input.speech.signal)?,
        &format!("0 to {}, 0 to 8 kHz", seconds(input.speech.signal.duration_s())),
    );
    page.markup("</section><section>");
    page.heading("Spectrogram of the result");
    page.picture(
        &spectrogram_png(&matched.matched)?,
        &format!("0 to {}, 0 to 8 kHz", seconds(matched.matched.duration_s())),
    );
    page.markup("</section></div>");
    page.heading("Absorption of each material: in the model and as fitted");
    page.markup("<div class=\"small\">");
    let greatest =
        summary.materials.values().flat_map(|c| c.before.iter().chain(&c.after)).copied().fold(0.0, f64::max);
    let top = (5.0 * greatest).ceil().clamp(1.0, 5.0) / 5.0;
    for (name, change) in &summary.materials {
        let chart = absorption_chart(&summary.bands_hz, change, top).svg()?;
        page.markup(&format!("<figure><figcaption>{}</figcaption>{chart}</figure>", escape(name)));
    }
    page.markup("</div>");
    page.heading("In numbers");
    page.table(&t60_table(summary));
    page.table(&eq_table(summary));
    page.table(&material_table(summary));
    if !summary.not_determined.is_empty() {
        let items: String =
            summary.not_determined.iter().map(|s| format!("<li>{}</li>", escape(s))).collect();
        page.markup(&format!(
            "<div class=\"soft\">One reverberation time per octave cannot tell all materials apart. What the fit took from the model's own tables rather than from the recording:<ul>{items}</ul></div>"
        ));
    }
    page.heading("Time taken");
    let mut times = vec![vec!["Stage".to_owned(), "Seconds".to_owned()]];
    times.extend(matched.seconds.iter().map(|(stage, s)| vec![(*stage).to_owned(), format!("{s:.2}")]));
    page.table(&times);
    Ok(page.html())
}

/// One sentence on how well the targets were met.
fn verdict(summary: &MatchSummary) -> String {
    let ratios: Vec<f64> = summary
        .t60_reached_s
        .iter()
        .zip(&summary.t60_target_s)
        .zip(&summary.bands_hz)
        .filter(|((_, _), hz)| !summary.unreachable.iter().any(|u| u.band_hz == **hz))
        .filter_map(|((reached, target), _)| reached.map(|r| (r / target - 1.0).abs()))
        .collect();
    let worst = ratios.iter().copied().fold(0.0, f64::max);
    format!(
        "The rendered response meets {} of {} octave targets, the worst of them within {:.1} %.",
        ratios.len(),
        summary.bands_hz.len(),
        100.0 * worst
    )
}

/// The dry sound in the simulation with the materials of the room file, as loud as its peak allows.
fn in_room_before(input: &MatchInput<'_>, matched: &RoomMatch) -> Result<Signal> {
    let rate_hz = matched.response_before.sample_rate_hz();
    let dry = resample(input.dry.signal, rate_hz)?;
    let wet = convolve(dry.samples(), matched.response_before.samples());
    let gain = matched.matched.peak() / wet.iter().fold(f32::MIN_POSITIVE, |peak, s| peak.max(s.abs()));
    Ok(Signal::new(wet.into_iter().map(|s| s * gain).collect(), rate_hz)?)
}

fn t60_chart(matched: &RoomMatch, summary: &MatchSummary) -> Chart {
    let bands = &summary.bands_hz;
    let mut heard = Series::new("heard (90 %)", Look::Dots, 0, pairs(bands, &summary.t60_target_s));
    let ends = summary.t60_target_low_s.iter().zip(&summary.t60_target_high_s);
    heard.half_widths =
        summary.t60_target_s.iter().zip(ends).map(|(t, (low, high))| (t - low, high - t)).collect();
    let reached: Vec<f64> = summary.t60_reached_s.iter().map(|t| t.unwrap_or(f64::NAN)).collect();
    let limit: Vec<f64> = bands.iter().map(|&hz| matched.air.t60_limit_s(hz)).collect();
    let mut series = vec![heard, Series::new("reached", Look::Dots, 1, pairs(bands, &reached))];
    let top = 1.3
        * series
            .iter()
            .flat_map(|s| {
                s.points.iter().enumerate().map(|(i, p)| p.1 + s.half_widths.get(i).map_or(0.0, |h| h.1))
            })
            .filter(|y| y.is_finite())
            .fold(0.1, f64::max);
    if limit.iter().any(|&l| l < top) {
        let visible = bands.iter().zip(&limit).map(|(&hz, &l)| (hz, if l < top { l } else { f64::NAN }));
        series.push(Series::new("air alone", Look::Dashed, 2, visible.collect()));
    }
    Chart {
        x_label: "Octave (Hz)".into(),
        y_label: "Reverberation time (s)".into(),
        x: Scale::Octaves(bands.clone()),
        y: Some((0.0, top)),
        series,
        small: false,
    }
}

fn eq_chart(matched: &RoomMatch) -> Chart {
    let centres: Vec<f64> = matched.targets.eq_db().bands().iter_hz().collect();
    let mut heard = Series::new(
        "heard (90 %)",
        Look::Dots,
        0,
        matched.targets.eq_db().iter().map(|(hz, e)| (hz, e.value)).collect(),
    );
    heard.half_widths =
        matched.targets.eq_db().values().iter().map(|e| [NORMAL_90 * e.standard_error; 2].into()).collect();
    let simulated = Series::new(
        "simulation",
        Look::Dots,
        1,
        matched.eq_simulated_db.iter().map(|(hz, &e)| (hz, e)).collect(),
    );
    let reached = Series::new(
        "simulation and filter",
        Look::Dots,
        3,
        matched.eq_reached_db.iter().map(|(hz, &e)| (hz, e)).collect(),
    );
    let gains = dense_hz(&centres).into_iter().map(|hz| (hz, matched.eq_filter.gain_db(hz))).collect();
    let filter = Series::new("filter", Look::Line, 2, gains);
    Chart {
        x_label: "Frequency (Hz)".into(),
        y_label: "Level re 1 kHz (dB)".into(),
        x: Scale::Octaves(centres),
        y: None,
        series: vec![heard, simulated, filter, reached],
        small: false,
    }
}

/// Eight frequencies an octave across the centres.
fn dense_hz(centres: &[f64]) -> Vec<f64> {
    let (Some(first), Some(last)) = (centres.first(), centres.last()) else { return Vec::new() };
    let steps = (8.0 * (last / first).log2()).round() as usize;
    (0..=steps).map(|i| first * 2f64.powf(i as f64 / 8.0)).collect()
}

fn decay_chart(decay: &PerBand<EnergyDecayCurve>, target_s: &PerBand<Estimate>) -> Chart {
    let longest_s = target_s.values().iter().map(|t| t.value).fold(0.3, f64::max);
    let mut series = Vec::new();
    for (colour, hz) in [125.0, 500.0, 2000.0, 8000.0].into_iter().enumerate() {
        let (Some(curve), Some(target)) = (decay.at_hz(hz), target_s.at_hz(hz)) else { continue };
        let level = curve.level_db();
        let points = level.iter().enumerate().map(|(i, &l)| (i as f64 * DECAY_STEP_S, l));
        let visible = points.take_while(|&(t, l)| l > DECAY_FLOOR_DB && t < longest_s).collect();
        let name = if hz < 1000.0 { format!("{hz} Hz") } else { format!("{} kHz", hz / 1000.0) };
        series.push(Series::new(name, Look::Line, colour, visible));
        let end_s = (-DECAY_FLOOR_DB / 60.0 * target.value).min(longest_s);
        let wanted = vec![(0.0, 0.0), (end_s, -60.0 * end_s / target.value)];
        let mut wanted = Series::new("wanted", Look::Dashed, colour, wanted);
        wanted.in_legend = false;
        series.push(wanted);
    }
    Chart {
        x_label: "Time (s); broken: the slope that was heard".into(),
        y_label: "Energy still to come (dB)".into(),
        x: Scale::Linear(0.0, longest_s),
        y: Some((DECAY_FLOOR_DB, 2.0)),
        series,
        small: false,
    }
}

fn absorption_chart(bands_hz: &[f64], change: &MaterialChange, top: f64) -> Chart {
    Chart {
        x_label: "Octave (Hz)".into(),
        y_label: "Absorption".into(),
        x: Scale::Octaves(bands_hz.to_vec()),
        y: Some((0.0, top)),
        series: vec![
            Series::new("model", Look::Dashed, 0, pairs(bands_hz, &change.before)),
            Series::new("fitted", Look::Dots, 1, pairs(bands_hz, &change.after)),
        ],
        small: true,
    }
}

fn t60_table(summary: &MatchSummary) -> Vec<Vec<String>> {
    let number = |t: &f64| format!("{t:.2}");
    vec![
        head("Reverberation time (s)", &summary.bands_hz),
        named("heard", summary.t60_target_s.iter().map(number)),
        named("90 %, from", summary.t60_target_low_s.iter().map(number)),
        named("90 %, to", summary.t60_target_high_s.iter().map(number)),
        named(
            "reached (T30)",
            summary.t60_reached_s.iter().map(|t| t.map_or("-".into(), |t| format!("{t:.2}"))),
        ),
    ]
}

fn eq_table(summary: &MatchSummary) -> Vec<Vec<String>> {
    let number = |e: &f64| format!("{e:+.1}");
    vec![
        head("Equalisation re 1 kHz (dB)", &summary.eq_bands_hz),
        named("heard", summary.eq_db.iter().map(number)),
        named("standard error", summary.eq_sd_db.iter().map(|e| format!("{e:.1}"))),
        named("simulation", summary.eq_simulated_db.iter().map(|e| e.as_ref().map_or("-".into(), number))),
        named(
            "simulation and filter",
            summary.eq_reached_db.iter().map(|e| e.as_ref().map_or("-".into(), number)),
        ),
    ]
}

fn material_table(summary: &MatchSummary) -> Vec<Vec<String>> {
    let mut rows = vec![head("Material", &summary.bands_hz)];
    for (name, change) in &summary.materials {
        let cells = change.before.iter().zip(&change.after).map(|(b, a)| format!("{b:.2} → {a:.2}"));
        rows.push(named(name, cells));
    }
    rows
}

fn head(name: &str, bands_hz: &[f64]) -> Vec<String> {
    named(name, bands_hz.iter().map(|hz| format!("{hz} Hz")))
}

fn named(name: &str, cells: impl Iterator<Item = String>) -> Vec<String> {
    std::iter::once(name.to_owned()).chain(cells).collect()
}

fn pairs(x: &[f64], y: &[f64]) -> Vec<(f64, f64)> {
    x.iter().copied().zip(y.iter().copied()).collect()
}

fn seconds(duration_s: f64) -> String {
    format!("{duration_s:.1} s")
}

fn file_name(path: &str) -> String {
    std::path::Path::new(path).file_name().map_or(path.to_owned(), |name| name.to_string_lossy().into_owned())
}

/// Players need no more than 16 bits, and no more than 24 kHz keeps the page small.
fn player_wav(sound: &Signal) -> Result<Vec<u8>> {
    let small = if sound.sample_rate_hz() > 24_000 { resample(sound, 24_000)? } else { sound.clone() };
    // Between the samples of a sound at full scale lie higher peaks.
    let (peak, rate_hz) = (small.peak().max(1.0), small.sample_rate_hz());
    let within = small.into_samples().into_iter().map(|s| s / peak).collect();
    Ok(encode_wav(&Signal::new(within, rate_hz)?, SampleFormat::Int16)?)
}
