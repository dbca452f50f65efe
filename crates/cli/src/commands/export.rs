//! The responses of a measured room for other programs.

use crate::failure::Failure;
use crate::room::read_room;
use clap::Args;
use sabine::scene::{Measurements, SofaConvention};
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

/// Write the responses of a measured room as a SOFA file: SingleRoomSRIR 1.0, or SingleRoomMIMOSRIR 1.0 with --grid.
#[derive(Args)]
pub struct Arguments {
    /// Folder with room.toml and its responses
    #[arg(long = "room", value_name = "DIR")]
    folder: PathBuf,
    /// Read a mesh or responses outside the room's folder, too: only for rooms that you trust
    #[arg(long)]
    allow_outside: bool,
    /// One measurement with a response from every source to every receiver (SingleRoomMIMOSRIR), all of which must be there
    #[arg(long)]
    grid: bool,
    /// Cut all responses to the length of the shortest: a SOFA file has one length
    #[arg(long)]
    cut: bool,
    /// The file to be written, .sofa
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// Whatever stands in the way, in words for the user.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.out.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("sofa")) {
        return Err(format!("--out {}: the file must end in .sofa", arguments.out.display()).into());
    }
    let room = read_room(&arguments.folder, arguments.allow_outside, None)?;
    let mut set = Measurements::of_room(&room)?;
    let lengths = || set.responses.iter().map(|response| response.samples.samples().len());
    if let (Some(shortest), Some(longest)) = (lengths().min(), lengths().max()) {
        if shortest < longest && !arguments.cut {
            let lengths = format!("responses of {shortest} to {longest} samples");
            return Err(
                format!("{lengths}: a SOFA file has one length; --cut cuts all to the shortest").into()
            );
        }
        set.cut_to(shortest)?;
    }
    let convention = if arguments.grid { SofaConvention::Grid } else { SofaConvention::Pairs };
    let now = SystemTime::now().duration_since(UNIX_EPOCH)?.as_secs();
    set.write_sofa(&arguments.out, convention, &date_and_time(now))?;
    println!("wrote {}: {} responses", arguments.out.display(), set.responses.len());
    Ok(())
}

/// UTC as `2026-11-24 12:00:00`, from seconds since 1970 (days to dates after Howard Hinnant, "chrono-compatible low-level date
/// algorithms", civil_from_days).
fn date_and_time(seconds: u64) -> String {
    let (days, second) = (seconds / 86_400 + 719_468, seconds % 86_400);
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = year_of_era + 400 * era + u64::from(month <= 2);
    let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
    format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        // As `date -u -d @N` prints them.
        for (seconds, text) in [
            (0, "1970-01-01 00:00:00"),
            (951_782_400, "2000-02-29 00:00:00"),
            (1_709_251_199, "2024-02-29 23:59:59"),
            (1_735_689_600, "2025-01-01 00:00:00"),
            (4_107_542_400, "2100-03-01 00:00:00"),
        ] {
            assert_eq!(date_and_time(seconds), text);
        }
    }
}
