//! A tracer of one's own in the place of the project's: a perfectly diffuse field, and materials fitted on its paths.
//!
//! ```text
//! cargo run --example own_tracer
//! ```
//!
//! It prints
//! ```text
//! octave (Hz)   T60 wanted (s)   absorption fitted   T60 by Eyring (s)
//!         500            0.900              0.1315               0.901
//!        1000            0.600              0.1899               0.602
//! ```
//!
//! What must hold for a tracer, line by line: `docs/how-to/own-tracer.md`. The same fit on traced paths: `fit_materials`, `sabine fit`.

use sabine::acoustics::{Air, Bands, Estimate, Material, Observer, PerBand, report};
use sabine::optimize::{AbsorptionPrior, FitConfig, FitProblem, MaterialFitter};
use sabine::paths::{Contribution, PathSet, Propagator, Reflection};
use sabine::scene::{DiffuseRoom, Receiver, Scene, Source};

/// Sound that has forgotten where it came from: only volume and areas count.
struct Diffuse {
    duration_s: f64,
    paths: usize,
}

impl Propagator for Diffuse {
    fn trace(
        &self,
        scene: &Scene,
        source: &Source,
        receiver: &Receiver,
        air: &Air,
        observer: &dyn Observer,
    ) -> Result<PathSet, sabine::acoustics::Error> {
        let max_length_m = self.duration_s * air.speed_of_sound_m_s();
        let areas_m2 = scene.material_areas_m2();
        let mean_free_path_m = 4.0 * scene.volume_m3() / scene.surface_m2();
        let mut set = PathSet::new(areas_m2.len(), max_length_m);

        // The direct sound, exact: weight 1 / d2, no batch.
        let away = [0, 1, 2].map(|k| receiver.position_m[k] - source.position_m[k]);
        let distance_m = away.iter().map(|c| c * c).sum::<f64>().sqrt();
        let path = Contribution {
            length_m: distance_m,
            log_weight: -2.0 * distance_m.ln(),
            chain: PathSet::DIRECT,
            tail: PathSet::DIRECT,
            departure: away.map(|c| c / distance_m),
            arrival: away.map(|c| -c / distance_m),
            batch: None,
        };
        set.push(path);

        // One long chain of reflections; a path with n of them is its first n. Materials come in turn by their area.
        let golden = |n: usize| (0.618_033_988_75 * n as f64).fract();
        let mut chains = vec![PathSet::DIRECT];
        for n in 0..(max_length_m / mean_free_path_m) as usize + 1 {
            let place_m2 = golden(n) * scene.surface_m2();
            let met = (0..areas_m2.len()).find(|&k| place_m2 < areas_m2[..=k].iter().sum());
            chains.push(set.reflect(chains[n], met.unwrap_or(0) as u32, Reflection::Scattered));
        }
        // A closed room holds 4 pi c / V per second, whatever the time: 4 pi / V per metre, shared by the paths.
        let energy = 4.0 * std::f64::consts::PI / scene.volume_m3() * max_length_m / self.paths as f64;
        for i in 0..self.paths {
            let length_m = (i as f64 + 0.5) / self.paths as f64 * max_length_m;
            // Between two numbers of reflections the share of each is what is left over.
            let chain = chains[(length_m / mean_free_path_m + golden(i)) as usize];
            // Independent parts of the whole: from their differences come the standard errors.
            let batch = Some((i % PathSet::BATCHES as usize) as u8);
            set.push(Contribution { length_m, log_weight: energy.ln(), chain, batch, ..path });
        }
        report(observer, "diffuse paths", 1, 1)?;
        Ok(set)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (bands, air) = (Bands::octaves(500.0, 1000.0)?, Air::default());
    let wall = Material::uniform(bands, 0.1, 1.0)?; // what it does not absorb it scatters
    let room = Scene::shoebox([8.0, 6.0, 3.0], std::array::from_fn(|_| wall.clone()))?;
    let (source, receiver) = (Source::omni("s", [2.0, 2.0, 1.5])?, Receiver::omni("r", [6.0, 4.0, 1.5])?);
    let paths = Diffuse { duration_s: 1.5, paths: 100_000 }.trace(&room, &source, &receiver, &air, &())?;

    let target_s = PerBand::new(bands, vec![Estimate::exact(0.9), Estimate::exact(0.6)])?;
    let priors = vec![AbsorptionPrior::uniform(bands, 0.1, 0.1); 6];
    let fitter = MaterialFitter::new(FitConfig::default())?;
    let fit = fitter.fit_t60(&[&paths], &FitProblem::new(&vec![wall; 6], &priors, &air), &target_s, &())?;
    let theory = DiffuseRoom::of_scene(&room.with_materials(fit.materials.clone())?, &air, bands)?;
    println!("octave (Hz)   T60 wanted (s)   absorption fitted   T60 by Eyring (s)");
    for ((hz, wanted), diffuse) in target_s.iter().zip(theory.values()) {
        let (absorption, eyring_s) = (diffuse.mean_absorption(), diffuse.eyring_t60_s());
        println!("{hz:>11}{:>17.3}{absorption:>20.4}{eyring_s:>20.3}", wanted.value);
    }
    Ok(())
}
