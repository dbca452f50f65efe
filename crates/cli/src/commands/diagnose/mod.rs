//! What a simulated room gets wrong against measured responses, or tables of parameters, why, and what mending it gains.
//!
//! Without arguments it runs on the built-in demo, whose two responses show what can be said with that little.

mod bars;
mod drawing;
mod findings;
mod held_out;
mod laws;
mod look_alikes;
mod report;
#[cfg(test)]
mod report_tests;
mod residual_map;
mod values;
pub(in crate::commands) mod words;

use crate::bar::Bar;
use crate::demo::Demo;
use crate::failure::Failure;
use crate::laws::naming_laws;
use crate::output::OutputFolder;
use crate::room::RoomArguments;
use clap::{Args, ValueEnum};
use findings::{Findings, Measured};
use sabine::acoustics::Error as ValueError;
use sabine::diagnose::{DiagnoseConfig, Diagnoser, Error as DiagnoseError, ExtendedModel, read_laws};
use std::path::{Path, PathBuf};
use std::time::Duration;
use words::Off;

/// Find what a simulation of a room gets wrong against measured responses, or tables of T30, EDT, C80.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    room: RoomArguments,
    /// Receivers that are never fitted, only predicted [default: each is held out in turn]
    #[arg(long, value_name = "ID,...", value_delimiter = ',')]
    hold_out: Vec<String>,
    /// Causes to try, by their names in the catalogue [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    effects: Vec<String>,
    /// Causes to try beside these that are tried on request alone: missing_object (furniture that the mesh lacks)
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    also: Vec<String>,
    /// Formulas to weigh as causes beside the catalogue, `[[laws]]` in TOML: a file, or a folder of such files
    #[arg(long, value_name = "FILE|DIR")]
    laws: Option<PathBuf>,
    /// When to look for a law beside the catalogue: what the misfit goes with (angles, lengths, directions, time), and by how much. Without
    /// a word after it: always [default: if-needed; never with --effects]
    #[arg(long, value_enum, value_name = "WHEN", num_args = 0..=1, require_equals = true, default_missing_value = "always")]
    discover: Option<Discover>,
    /// extended_model.toml of an earlier diagnosis to start from: its causes are at work, fitted anew, and the search goes on
    #[arg(long, value_name = "F.toml")]
    model: Option<PathBuf>,
    /// Rays for each source-receiver pair [default: 10000]
    #[arg(long)]
    rays: Option<usize>,
    /// Seed of rays and simulated measurements
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Go on although more than one ray in a thousand escapes through holes of the mesh
    #[arg(long)]
    allow_leaks: bool,
    /// Stop after so many seconds, write nothing, and say how far it came
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..))]
    time_limit: Option<u64>,
    /// Folder for diagnosis.json, report.html, extended_model.toml, extended_mesh.obj and extended_mesh.glb
    #[arg(long, value_name = "DIR", default_value = "out/diagnose")]
    out: PathBuf,
}

/// When a law is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Discover {
    /// Beside the catalogue, in any room
    Always,
    /// Where no cause of the catalogue explains the room, or a formula would explain it as well
    IfNeeded,
    /// Not at all
    Never,
}

impl Arguments {
    /// A law could take the place of a cause that is not to be tried.
    fn discover(&self) -> Discover {
        let some = !self.effects.is_empty();
        self.discover.unwrap_or(if some { Discover::Never } else { Discover::IfNeeded })
    }
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut demo = Demo::default();
    let mut config = DiagnoseConfig {
        seed: arguments.seed,
        allow_leaks: arguments.allow_leaks,
        ..DiagnoseConfig::default()
    };
    if let Some(rays) = arguments.rays {
        config.rays = rays;
    }
    let laws = arguments.laws.as_ref().map(read_laws).transpose()?.unwrap_or_default();
    let mut diagnoser = Diagnoser::new(config)?;
    if !arguments.effects.is_empty() {
        diagnoser = diagnoser.with_only(&arguments.effects)?;
    }
    diagnoser = diagnoser.with_also(&arguments.also)?;
    let file = arguments.laws.as_deref();
    diagnoser = diagnoser.with_laws(laws).map_err(|error| naming_laws(error.into(), file))?;
    diagnoser = match arguments.discover() {
        Discover::Always => diagnoser.discovering(),
        Discover::IfNeeded => diagnoser.discovering_if_needed(),
        Discover::Never => diagnoser,
    };
    if let Some(model) = &arguments.model {
        diagnoser = diagnoser.starting_from(&ExtendedModel::read(model)?)?;
    }
    let threshold_nats = diagnoser.threshold_nats();
    // A folder that cannot be written to should not cost the user a computation first.
    let mut out = OutputFolder::create(&arguments.out)?;
    let (room, name) = arguments.room.read(&mut demo)?;
    let bar = Bar::stopped_on_request(arguments.time_limit.map(Duration::from_secs))?;
    let mut diagnosis = diagnoser.diagnose(&room, &arguments.hold_out, &bar).map_err(|error| -> Failure {
        // An error of its own may come first, and counts then.
        match (&error, bar.stopped()) {
            (DiagnoseError::Acoustics(ValueError::Cancelled { .. }), Some(place)) => {
                format!("{place}; nothing was written").into()
            }
            _ => naming_laws(error.into(), arguments.laws.as_deref()),
        }
    })?;
    bar.finish();

    if !room.parameters().is_empty() && !room.responses().is_empty() {
        diagnosis.notes.push(
            "tables of parameters were not used beside responses: `sabine fit` holds them against the model"
                .to_owned(),
        );
    }
    let measured = Measured::of(&room);
    let model = diagnosis.model.to_toml()?;
    let found = diagnosis.model.room(&room);
    if let Err(error) = &found {
        // What took minutes to find is not withheld for a drawing.
        diagnosis.notes.push(format!("the room as found cannot be drawn: {error}"));
    }
    let json = findings::json(&diagnosis, &name, measured, threshold_nats)?;
    out.write("diagnosis.json", json.as_bytes())?;
    let drawn = found.as_ref().ok().filter(|_| drawing::has_a_place(&diagnosis.model));
    let drawing = drawn.map(|found| drawing::svg(&room, found, &diagnosis.moved_reflections));
    let findings = Findings::new(diagnosis, name, measured, threshold_nats);
    out.write("report.html", report::html(&findings, drawing.as_deref())?.as_bytes())?;
    out.write("extended_model.toml", model.as_bytes())?;
    if let Ok(found) = &found {
        out.write("extended_mesh.obj", found.scene.to_obj().as_bytes())?;
        out.write("extended_mesh.glb", &found.scene.to_glb()?)?;
    }
    out.finish()?;
    print_findings(&findings, &arguments.out);
    Ok(())
}

fn print_findings(findings: &Findings, out: &Path) {
    println!("verdict: {}", findings.verdict);
    println!("{}", words::headline(findings));
    for line in words::meaning(findings) {
        println!("  {line}");
    }
    for cause in &findings.causes {
        println!(
            "{} (probability {:.3}{})",
            words::named(cause),
            cause.probability,
            if cause.slight { ", slight" } else { "" }
        );
        for p in &cause.parameters {
            println!(
                "  {:<28} {:>8} {:<6} 90 %: {}",
                words::parameter(&p.name),
                words::number(p.value, p.high - p.low),
                p.unit,
                words::interval(p, "to")
            );
        }
        if let Some(gain) = &cause.held_out_gain {
            let Off { what, unit, before, after } = words::off(gain);
            println!(
                "  {what} at positions not seen: {before:.2} {unit} off before, {after:.2} {unit} after"
            );
        }
    }
    for law in &findings.laws {
        println!("law: {}", law.words);
        println!("  {}", law.formula);
        let vault = law
            .vault_gain_nats
            .map_or(String::new(), |gain| format!(", {gain:.1} nats at positions set aside"));
        println!("  as good by chance with probability {:.4} at most{vault}", law.family_p);
    }
    if !findings.alternatives.is_empty() {
        println!("one of: {}", findings.alternatives.join(", "));
    }
    for measurement in &findings.would_decide {
        println!("would decide: {measurement}");
    }
    if !findings.would_decide.is_empty() {
        println!("where, and by how much: {}", words::plan_command(findings, &out.join("diagnosis.json")));
    }
    if findings.held_out.is_none() {
        println!("note: too few positions to hold any out; gains are those of the data that were fitted");
    }
    for note in &findings.notes {
        println!("note: {note}");
    }
    println!("{:.1} s; look at {}", findings.total_s(), out.join("report.html").display());
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Words {
        #[command(flatten)]
        arguments: Arguments,
    }

    #[test]
    fn a_law_is_looked_for_where_nothing_explains_the_room_unless_causes_are_listed() {
        let when = |more: &[&str]| {
            let words = ["diagnose", "--room", "room"].iter().chain(more);
            Words::try_parse_from(words).map(|w| w.arguments.discover()).map_err(|error| error.to_string())
        };
        assert_eq!(when(&[]), Ok(Discover::IfNeeded));
        assert_eq!(when(&["--effects", "scattering"]), Ok(Discover::Never));
        assert_eq!(when(&["--effects", "scattering", "--discover"]), Ok(Discover::Always));
        assert_eq!(when(&["--discover=never"]), Ok(Discover::Never));
        assert!(when(&["--discover=often"]).is_err_and(|said| said.contains("if-needed")));
    }
}
