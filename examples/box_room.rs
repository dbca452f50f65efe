//! A room written down in code and traced: where the formulas of Sabine and Eyring hold, and where they do not.
//!
//! ```text
//! cargo run --example box_room
//! ```
//!
//! Nearly all of this room's absorption is on its floor and ceiling: sound that runs level between the bare walls outlives what both
//! formulas expect, unless the walls scatter it. It prints
//! ```text
//! 105 m3, 142 m2, scattering 0.05
//! octave (Hz)   Sabine (s)   Eyring (s)   T30 traced (s)
//!         500        0.612        0.552    2.094 ± 0.089
//!        1000        0.522        0.462    1.856 ± 0.100
//!        2000        0.456        0.397    1.753 ± 0.103
//! 105 m3, 142 m2, scattering 0.9
//! octave (Hz)   Sabine (s)   Eyring (s)   T30 traced (s)
//!         500        0.612        0.552    0.510 ± 0.011
//!        1000        0.522        0.462    0.444 ± 0.006
//!        2000        0.456        0.397    0.396 ± 0.003
//! ```
//!
//! A room of your own: `sabine new-room --help`, then `sabine trace --room DIR`. How paths are found: `docs/explanation/tracing.md`.

use sabine::acoustics::{Air, Bands, Material, PerBand, library_material};
use sabine::paths::{Conditions, PathParameters, Propagator};
use sabine::propagate::{PathTracer, TracerConfig};
use sabine::scene::{DiffuseRoom, Receiver, Scene, Source};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let bands = Bands::octaves(500.0, 2000.0)?;
    let (source, receiver) =
        (Source::omni("talker", [1.5, 2.0, 1.5])?, Receiver::omni("listener", [5.0, 3.5, 1.2])?);
    let air = Air::default();
    for (scattering, duration_s) in [(0.05, 2.0), (0.9, 0.6)] {
        let surface = |name| -> Result<Material, sabine::acoustics::Error> {
            let absorption = library_material(name)?.material(bands)?.absorption().clone();
            Material::new(absorption, PerBand::uniform(bands, scattering))
        };
        let wall = surface("rendered_brick")?;
        let [floor, ceiling] = [surface("carpet_thin")?, surface("acoustic_plaster")?];
        // x = 0, x = 7 m, y = 0, y = 5 m, floor, ceiling.
        let walls = [wall.clone(), wall.clone(), wall.clone(), wall, floor, ceiling];
        let scene = Scene::shoebox([7.0, 5.0, 3.0], walls.clone())?;

        // In a box the paths between mirrors have a closed form, and need no luck to be found.
        let config =
            TracerConfig { rays: 2_000, cuboid_paths: 50_000, duration_s, ..TracerConfig::default() };
        let paths = PathTracer::new(config)?.trace(&scene, &source, &receiver, &air, &())?;
        let heard = PathParameters::read(&paths, &Conditions::new(&walls, &air))?;
        let theory = DiffuseRoom::of_scene(&scene, &air, bands)?;

        println!("{:.0} m3, {:.0} m2, scattering {scattering}", scene.volume_m3(), scene.surface_m2());
        println!("octave (Hz)   Sabine (s)   Eyring (s)   T30 traced (s)");
        for ((hz, room), t30) in theory.iter().zip(heard.t30_s.values()) {
            let (sabine, eyring) = (room.sabine_t60_s(), room.eyring_t60_s());
            // The error is what the number of rays leaves, not how well the model is the room.
            let t30 = t30.as_ref().map(|t| format!("{:.3} ± {:.3}", t.value, t.standard_error));
            let t30 = t30.unwrap_or_else(|reason| reason.to_string());
            println!("{hz:>11}{sabine:>13.3}{eyring:>13.3}    {t30}");
        }
    }
    Ok(())
}
