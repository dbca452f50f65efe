//! What a diagnosis asks of a tracer.

use crate::error::Error;
use sabine_acoustics::Air;
use sabine_paths::{PathSet, Propagator};
use sabine_propagate::{ImageSource, PathTracer, PreparedScene, TracerConfig};
use sabine_scene::{Receiver, Scene, Source};
use std::sync::Arc;

/// Turns the seed of rays into that of others, more of them.
const MORE_RAYS: u64 = 0x4E25_5EED_0F07;
/// So many times as many are more. Chance falls to half.
const TIMES: usize = 4;

/// A tracer that a diagnosis can use: it prepares a scene once and then traces many pairs in it.
///
/// [`SceneTracer`] and [`PreparedTracer`] have two implementations here: the path tracer of `sabine-propagate`, which is the default, and
/// [`EachScene`], which takes any [`Propagator`].
pub trait SceneTracer: Send + Sync {
    /// Prepares a scene whose paths must be followed for `duration_s` seconds after the emission.
    ///
    /// # Errors
    /// For a scene that cannot be traced.
    fn prepare(&self, scene: &Scene, duration_s: f64) -> Result<Box<dyn PreparedTracer>, Error>;

    /// A tracer that draws several times as many rays, others than this one: what parts of its rays
    /// ([`PathSet::part_of_rays`]) do not confirm is looked for again with that. The default has none.
    fn with_more_rays(&self) -> Option<Arc<dyn SceneTracer>> {
        None
    }
}

/// A scene that is ready to be traced.
pub trait PreparedTracer: Send + Sync {
    /// Looks for what makes the scene unfit, such as a mesh that leaks; `source_m` is a place in the room. Called once, for the scene as
    /// stated.
    ///
    /// # Errors
    /// For an unfit scene. The default finds nothing.
    fn check(&self, source_m: [f64; 3]) -> Result<(), Error> {
        let _ = source_m;
        Ok(())
    }

    /// All paths of one pair. Paths must be good for any absorption, and carry what [`PathSet`] says that they carry.
    ///
    /// # Errors
    /// For a source or receiver that cannot be traced.
    fn trace(&self, source: &Source, receiver: &Receiver, air: &Air) -> Result<PathSet, Error>;

    /// The material (index) of each face if the scene is a cuboid whose image sources [`PreparedTracer::for_each_image`] shows. The default
    /// knows of none.
    fn cuboid_faces(&self) -> Option<[u32; 6]> {
        None
    }

    /// Shows all image sources of a cuboid that are no farther away than this, each with its reflections at the faces. The default shows
    /// none.
    fn for_each_image(&self, ends_m: [[f64; 3]; 2], max_length_m: f64, visit: &mut dyn FnMut(&ImageSource)) {
        let _ = (ends_m, max_length_m, visit);
    }
}

/// The path tracer of `sabine-propagate`.
#[derive(Clone, Debug)]
pub(crate) struct Rays {
    /// Its settings, but for the duration.
    pub config: TracerConfig,
}

struct PreparedRays {
    tracer: PathTracer,
    prepared: PreparedScene,
    /// The scene, if it is to be checked for leaks.
    scene: Option<Scene>,
}

impl SceneTracer for Rays {
    fn prepare(&self, scene: &Scene, duration_s: f64) -> Result<Box<dyn PreparedTracer>, Error> {
        let tracer = PathTracer::new(TracerConfig { duration_s, ..self.config.clone() })?;
        let prepared = tracer.prepare(scene)?;
        let scene = (!self.config.allow_leaks).then(|| scene.clone());
        Ok(Box::new(PreparedRays { tracer, prepared, scene }))
    }

    fn with_more_rays(&self) -> Option<Arc<dyn SceneTracer>> {
        let seed = self.config.seed ^ MORE_RAYS;
        let rays = self.config.rays.saturating_mul(TIMES);
        Some(Arc::new(Self { config: TracerConfig { rays, seed, ..self.config.clone() } }))
    }
}

impl PreparedTracer for PreparedRays {
    fn check(&self, source_m: [f64; 3]) -> Result<(), Error> {
        Ok(self.scene.as_ref().map_or(Ok(()), |scene| self.prepared.check_leaks(scene, source_m))?)
    }

    fn trace(&self, source: &Source, receiver: &Receiver, air: &Air) -> Result<PathSet, Error> {
        let seed = seed_of_pair(self.tracer.config().seed, source, receiver);
        let tracer = PathTracer::new(TracerConfig { seed, ..self.tracer.config().clone() })?;
        Ok(tracer.trace_prepared(&self.prepared, source, receiver, air, &())?)
    }

    fn cuboid_faces(&self) -> Option<[u32; 6]> {
        self.prepared.cuboid_faces()
    }

    fn for_each_image(
        &self,
        [source_m, receiver_m]: [[f64; 3]; 2],
        max_length_m: f64,
        visit: &mut dyn FnMut(&ImageSource),
    ) {
        self.prepared.for_each_image(source_m, receiver_m, max_length_m, visit);
    }
}

/// The seed of the rays of one pair. Each pair draws rays of its own: were they the same, all responses would be off together where these
/// rays miss something, and whatever acts on all positions would be credited with it. Names tell pairs apart, so that a source that is
/// moved keeps its rays.
fn seed_of_pair(seed: u64, source: &Source, receiver: &Receiver) -> u64 {
    // FNV-1a.
    let names = source.id.bytes().chain([0]).chain(receiver.id.bytes());
    names.fold(seed ^ 0xCBF2_9CE4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)
    })
}

/// Any [`Propagator`], which looks at the scene anew for each pair. Its own duration holds: it must reach as far as decays are compared.
#[derive(Clone, Debug)]
pub struct EachScene<P>(pub P);

struct WithScene<P> {
    propagator: P,
    scene: Scene,
}

impl<P: Propagator + Clone + 'static> SceneTracer for EachScene<P> {
    fn prepare(&self, scene: &Scene, _: f64) -> Result<Box<dyn PreparedTracer>, Error> {
        Ok(Box::new(WithScene { propagator: self.0.clone(), scene: scene.clone() }))
    }
}

impl<P: Propagator> PreparedTracer for WithScene<P> {
    fn trace(&self, source: &Source, receiver: &Receiver, air: &Air) -> Result<PathSet, Error> {
        Ok(self.propagator.trace(&self.scene, source, receiver, air, &())?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DiagnoseConfig;
    use sabine_acoustics::{Bands, Material};

    #[test]
    fn each_pair_has_rays_of_its_own_and_keeps_them() {
        let bands = Bands::octaves(500.0, 1000.0).unwrap();
        let walls = [0.1; 6].map(|a| Material::uniform(bands, a, 0.3).unwrap());
        let scene = Scene::shoebox([5.0, 4.0, 3.0], walls).unwrap();
        let tracer = Rays { config: TracerConfig { rays: 256, ..DiagnoseConfig::default().tracer() } };
        let prepared = tracer.prepare(&scene, 0.2).unwrap();
        let source = Source::omni("s", [1.0, 1.0, 1.5]).unwrap();
        let late = |name: &str, x: f64| -> Vec<f32> {
            let receiver = Receiver::omni(name, [x, 3.0, 1.2]).unwrap();
            let paths = prepared.trace(&source, &receiver, &Air::default()).unwrap();
            let sampled = (0..paths.len()).filter(|&i| !paths.is_exact(i));
            sampled.map(|i| paths.lengths_m()[i]).collect()
        };
        assert_eq!(late("r1", 4.0), late("r1", 4.0));
        assert_ne!(late("r1", 4.0), late("r2", 4.0));
        let seed = |a: &str, b: &str| {
            let receiver = Receiver::omni(b, [4.0, 3.0, 1.2]).unwrap();
            seed_of_pair(7, &Source::omni(a, [1.0; 3]).unwrap(), &receiver)
        };
        // What belongs to which name counts.
        assert_ne!(seed("s1", "1r"), seed("s11", "r"));
    }
}
