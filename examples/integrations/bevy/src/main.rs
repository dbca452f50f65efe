//! A voice in a bare room that is furnished while it speaks: 12 s without a window, written to a file.
//!
//! ```text
//! cargo run -p sabine-with-bevy [VOICE.wav]
//! ```

use bevy_app::App;
use bevy_ecs::prelude::World;
use sabine_acoustics::{Channel, SampleFormat, read_audio, write_wav_channels};
use sabine_with_bevy::{Loudspeaker, RoomPlugin, Rooms, Shoebox, UPDATES_HZ, Voice, Wall, WallMaterial};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Duration;

fn main() -> Result<(), Box<dyn Error>> {
    let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../fixtures"));
    let given: Option<PathBuf> = std::env::args_os().nth(1).map(PathBuf::from);
    let voice = read_audio(given.unwrap_or_else(|| fixtures.join("speech/dry_guest.wav")), Channel::Mono)?;
    let rate_hz = voice.sample_rate_hz();
    let mut app = App::new();
    app.insert_resource(Voice(voice.into_samples()));
    app.add_plugins(RoomPlugin::new(Shoebox {
        size_m: [7.0, 5.0, 3.0],
        materials: ["rendered_brick"; 6],
        source_m: [1.5, 2.0, 1.5],
        listener_m: [5.0, 3.5, 1.2],
        rays: 5000,
        duration_s: 2.5,
        sample_rate_hz: rate_hz,
    })?);
    for (begin_s, furnish) in
        [(0, &[][..]), (4, &[(4, "carpet_thin")]), (8, &[(5, "acoustic_plaster"), (0, "curtain_heavy")])]
    {
        for &(wall, material) in furnish {
            println!("{begin_s} s: wall {wall} becomes {material}");
            change(app.world_mut(), wall, material);
        }
        for _ in 0..4 * UPDATES_HZ {
            app.update();
            // Updates come faster here than in a game.
            while app.world().resource::<Rooms>().progress().is_under_way() {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
    }
    if let Some(problem) = app.world().resource::<Rooms>().progress().problem {
        return Err(problem.into());
    }
    let heard = &app.world().resource::<Loudspeaker>().0;
    let out = Path::new("out/with_bevy");
    std::fs::create_dir_all(out)?;
    let file = out.join("heard.wav");
    let [left, right] = [0, 1].map(|c| heard.iter().skip(c).step_by(2).copied().collect::<Vec<f32>>());
    write_wav_channels(&file, &[&left, &right], rate_hz, SampleFormat::Float32)?;
    println!("wrote {:.1} s of sound to {}", left.len() as f64 / f64::from(rate_hz), file.display());
    Ok(())
}

fn change(world: &mut World, wall: usize, material: &'static str) {
    let mut walls = world.query::<(&Wall, &mut WallMaterial)>();
    for (_, mut found) in walls.iter_mut(world).filter(|(found, _)| found.0 == wall) {
        found.0 = material;
    }
}
