//! The tables of the material library, with their sources; tables of materials from and to other programs.

use crate::failure::Failure;
use clap::Args;
use sabine::acoustics::{Bands, LibraryMaterial, material_library};
use sabine::scene::Materials;
use std::path::{Path, PathBuf};

/// Print the tables of the material library with their sources, or turn tables of materials from one form into another.
#[derive(Args)]
pub struct Arguments {
    /// Comma-separated values: name, absorption in each octave, depth of the relief in m, description, source
    #[arg(long)]
    csv: bool,
    /// Tables to be turned into another form: a materials.toml, a geometry file of CATT-Acoustic (.geo), or a list of Odeon (.li8)
    #[arg(long, value_name = "FILE", requires = "out", conflicts_with = "csv")]
    from: Option<PathBuf>,
    /// The file to be written: its ending says the form, .toml or .geo
    #[arg(long, value_name = "FILE", requires = "from")]
    out: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// The table cannot be encoded.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let (Some(from), Some(out)) = (&arguments.from, &arguments.out) {
        return convert(from, out);
    }
    let surfaces = material_library();
    if arguments.csv {
        print!("{}", csv_table(surfaces)?);
        return Ok(());
    }
    print!("{}", table(surfaces));
    println!(
        "\nrandom-incidence absorption by octave (Hz); trust each value to a standard deviation of about 0.1\n\
         in room.toml: [materials.floor] library = \"parquet_on_concrete\""
    );
    Ok(())
}

/// Tables from one file to another.
fn convert(from: &Path, out: &Path) -> Result<(), Failure> {
    let ending = |path: &Path| path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    let (form, to) = (ending(from), ending(out));
    if !matches!(to.as_deref(), Some("toml" | "geo")) {
        let path = out.display();
        return Err(format!(
            "{path}: tables of materials are written to .toml, or to .geo for CATT-Acoustic"
        )
        .into());
    }
    let materials = match form.as_deref() {
        Some("toml") => Materials::read(from)?,
        Some("geo") => Materials::read_catt(from)?,
        Some("li8") => Materials::read_odeon(from)?,
        _ => {
            let path = from.display();
            let forms = "in .toml, in .geo for CATT-Acoustic, or in .li8 for Odeon";
            return Err(format!("{path}: tables of materials end {forms}").into());
        }
    };
    if to.as_deref() == Some("geo") {
        materials.write_catt(out)?;
    } else {
        materials.write(out)?;
    }
    println!("wrote {}: {} materials", out.display(), materials.tables().len());
    Ok(())
}

fn table(surfaces: &[LibraryMaterial]) -> String {
    let widest = surfaces.iter().map(|surface| surface.name.len()).max().unwrap_or(0);
    let mut text = format!("{:<widest$}", "");
    for hz in Bands::T60.iter_hz() {
        text += &format!("{:>6}", if hz < 1000.0 { format!("{hz}") } else { format!("{}k", hz / 1000.0) });
    }
    text += "  description (source)\n";
    for surface in surfaces {
        text += &format!("{:<widest$}", surface.name);
        text.extend(surface.absorption.iter().map(|absorption| format!("{absorption:>6.2}")));
        text += &format!("  {} ({})\n", surface.description, surface.source);
    }
    text
}

fn csv_table(surfaces: &[LibraryMaterial]) -> Result<String, Failure> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let bands = Bands::T60.iter_hz().map(|hz| format!("absorption_{hz}_hz"));
    let head = ["name".to_owned()].into_iter().chain(bands);
    writer.write_record(head.chain(["depth_m", "description", "source"].map(str::to_owned)))?;
    for surface in surfaces {
        let numbers = surface.absorption.iter().chain([&surface.depth_m]).map(f64::to_string);
        let record = [surface.name.to_owned()].into_iter().chain(numbers);
        writer.write_record(record.chain([surface.description, surface.source].map(str::to_owned)))?;
    }
    Ok(String::from_utf8(writer.into_inner().map_err(|error| error.into_error())?)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_csv_holds_every_table_as_it_is() {
        let text = csv_table(material_library()).unwrap();
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        assert_eq!(&reader.headers().unwrap()[5], "absorption_2000_hz");
        let records: Vec<_> = reader.records().collect::<Result<_, _>>().unwrap();
        assert_eq!(records.len(), material_library().len());
        for (record, surface) in records.iter().zip(material_library()) {
            assert_eq!(
                (&record[0], &record[9], &record[10]),
                (surface.name, surface.description, surface.source)
            );
            for (text, value) in
                record.iter().skip(1).zip(surface.absorption.iter().chain([&surface.depth_m]))
            {
                assert_eq!(text.parse::<f64>().unwrap(), *value, "{}", surface.name);
            }
        }
    }

    #[test]
    fn the_table_has_a_line_for_each_surface() {
        let text = table(material_library());
        assert_eq!(text.lines().count(), 1 + material_library().len());
        let line = text.lines().find(|line| line.starts_with("carpet_thin ")).unwrap();
        assert!(
            line.contains("0.02  0.04  0.08  0.20  0.35  0.40  0.40") && line.contains("Vorländer 2008"),
            "{line}"
        );
    }
}
