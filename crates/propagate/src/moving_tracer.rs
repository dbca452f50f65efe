//! Paths between a source and a listener that move.

use crate::early_memory::EarlyMemory;
use crate::vector::{norm, sub};
use crate::{Error, PathTracer, PreparedScene, TracerConfig};
use sabine_acoustics::{Air, Observer, OutOfRange};
use sabine_paths::PathSet;
use sabine_scene::{Receiver, Scene, Source};
use std::collections::VecDeque;
use std::sync::Arc;

/// Settings of [`MovingTracer`].
#[derive(Clone, Debug, PartialEq)]
pub struct MovingConfig {
    /// Settings for each frame: its rays are those of one frame, its seed that of the first.
    pub tracer: TracerConfig,
    /// Movement of source and listener, together, over which an older frame's weight falls to 1 / e, 1 mm to 1 km.
    pub memory_m: f64,
    /// Frames that are averaged at most, 1 to 1000.
    pub most_frames: usize,
}

impl Default for MovingConfig {
    /// 500 rays, image sources of second order and 1 s of response in each frame; half a metre, and at most 16 frames.
    fn default() -> Self {
        let tracer = TracerConfig { rays: 500, duration_s: 1.0, image_order: 2, ..TracerConfig::default() };
        Self { tracer, memory_m: 0.5, most_frames: 16 }
    }
}

/// What [`MovingTracer::update`] gives.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Frame {
    /// All paths of the moment, to be re-weighted and rendered as any others.
    pub paths: PathSet,
    /// Rays asked for in this frame ([`TracerConfig::rays`]).
    pub rays: usize,
    /// Rays of this and older frames as they count: as many equally weighted ones would have the same variance.
    pub effective_rays: f64,
}

/// Follows a moving source and a moving listener with few rays for each frame.
///
/// Exact paths (the direct sound, image sources) are found anew in every frame, with the delays and directions of the
/// moment. In a room of so many planes that rays have to find the image sources, what older frames found is validated
/// again, so that early reflections do not flicker.
///
/// Sampled paths are averaged over the last frames, each traced with its own seed: a frame counts by
/// exp(-moved / `memory_m`), `moved` being how far source and listener have gone since. Whoever stands still gathers
/// `most_frames` frames. For one who walks at 1.4 m/s the default memory is a time constant of 0.36 s; at ten frames a second
/// the average is worth seven frames. Older paths are shifted to the new places to first order
/// ([`PathSet::append_displaced`]), so that their delays neither jump nor precede the direct sound.
///
/// The result depends on the seed and on the sequence of places, not on the time that passes or on the number of threads.
///
/// ```
/// use sabine_acoustics::{Air, Bands, Material};
/// use sabine_scene::{Receiver, Scene, Source};
/// use sabine_propagate::{MovingConfig, MovingTracer};
/// let wall = Material::uniform(Bands::octaves(500.0, 1000.0)?, 0.2, 0.3)?;
/// let room = Scene::shoebox([8.0, 5.0, 3.0], std::array::from_fn(|_| wall.clone()))?;
/// let air = Air::default();
/// let mut tracer = MovingTracer::new(room, air.clone(), MovingConfig::default())?;
/// let source = Source::omni("S", [1.0, 2.5, 1.5])?;
/// for step in 0..4 {
///     let x_m = 3.0 + 0.1 * f64::from(step);
///     let frame = tracer.update(&source, &Receiver::omni("R", [x_m, 2.5, 1.5])?)?;
///     assert!((f64::from(frame.paths.lengths_m()[0]) - (x_m - 1.0)).abs() < 1e-6); // the direct sound
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct MovingTracer {
    scene: Scene,
    prepared: Arc<PreparedScene>,
    /// Whether the room has been looked over for holes.
    closed: bool,
    air: Air,
    config: MovingConfig,
    early: EarlyMemory,
    /// The newest first.
    past: VecDeque<Past>,
    count: u64,
}

/// A frame that was traced, and from where to where.
#[derive(Clone, Debug)]
struct Past {
    paths: PathSet,
    source_m: [f64; 3],
    receiver_m: [f64; 3],
    /// How far source and listener have gone since.
    moved_m: f64,
}

impl MovingTracer {
    /// Takes the room and checks the settings.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a setting outside its range, [`Error::NoSurface`] if all triangles have zero area.
    pub fn new(scene: Scene, air: Air, config: MovingConfig) -> Result<Self, Error> {
        let prepared = Arc::new(PathTracer::new(config.tracer.clone())?.prepare(&scene)?);
        OutOfRange::check("memory_m", config.memory_m, 1e-3, 1e3, "between 1 mm and 1 km")?;
        OutOfRange::check("most_frames", config.most_frames as f64, 1.0, 1e3, "between 1 and 1000")?;
        let early = EarlyMemory::default();
        Ok(Self { scene, prepared, closed: false, air, config, early, past: VecDeque::new(), count: 0 })
    }

    /// The settings.
    pub fn config(&self) -> &MovingConfig {
        &self.config
    }

    /// Forgets all frames: after a leap, or when the room has changed.
    pub fn clear(&mut self) {
        self.past.clear();
        self.early.clear();
    }

    /// Traces the frame of these places.
    ///
    /// # Errors
    /// As [`PathTracer`]'s: a source or listener in a wall, a room with holes, no path at all. The frame is lost then, the older
    /// ones are kept.
    pub fn update(&mut self, source: &Source, receiver: &Receiver) -> Result<Frame, Error> {
        self.update_observed(source, receiver, &())
    }

    /// As [`MovingTracer::update`], under an observer that may stop it.
    ///
    /// # Errors
    /// As [`MovingTracer::update`], and [`sabine_acoustics::Error::Cancelled`].
    pub fn update_observed(
        &mut self,
        source: &Source,
        receiver: &Receiver,
        observer: &dyn Observer,
    ) -> Result<Frame, Error> {
        let seed = self.config.tracer.seed.wrapping_add(self.count);
        self.count += 1;
        let tracer = PathTracer::new(TracerConfig { seed, ..self.config.tracer.clone() })?;
        if !self.closed && !self.config.tracer.allow_leaks {
            self.prepared.check_leaks(&self.scene, source.position_m)?;
            self.closed = true;
        }
        let mut paths = tracer.trace_prepared(&self.prepared, source, receiver, &self.air, observer)?;
        let (source_m, receiver_m) = (source.position_m, receiver.position_m);
        self.early.complete(&mut paths, &self.prepared.mesh, [source_m, receiver_m]);
        if let Some(last) = self.past.front() {
            let moved_m = norm(sub(source_m, last.source_m)) + norm(sub(receiver_m, last.receiver_m));
            self.past.iter_mut().for_each(|past| past.moved_m += moved_m);
        }
        self.past.push_front(Past { paths, source_m, receiver_m, moved_m: 0.0 });
        self.past.truncate(self.config.most_frames);
        Ok(self.averaged())
    }

    fn averaged(&self) -> Frame {
        let weights: Vec<f64> =
            self.past.iter().map(|past| (-past.moved_m / self.config.memory_m).exp()).collect();
        let sum: f64 = weights.iter().sum();
        let newest = &self.past[0];
        let mut paths = PathSet::new(self.scene.materials().len(), newest.paths.max_length_m());
        paths.append_exact(&newest.paths);
        let least_length_m = norm(sub(newest.source_m, newest.receiver_m));
        for (past, weight) in self.past.iter().zip(&weights) {
            let displacements =
                [sub(newest.source_m, past.source_m), sub(newest.receiver_m, past.receiver_m)];
            paths.append_displaced(&past.paths, displacements, least_length_m, weight / sum);
        }
        let rays = self.config.tracer.rays;
        let squares: f64 = weights.iter().map(|w| w * w).sum();
        Frame { paths, rays, effective_rays: rays as f64 * sum * sum / squares }
    }
}
