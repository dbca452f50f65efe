//! Responses of polyhedral rooms, traced by whoever can trace.

use crate::corpus::{LeftOut, ResponseCorpus, ResponseFilter, hash_bytes};
use crate::error::Error;
use crate::polyhedral_room::{PolyhedralRoom, PolyhedralRoomConfig};
use crate::seed::derive;
use rayon::prelude::*;
use sabine_acoustics::{Air, ImpulseResponse, Observer, report};
use sabine_paths::{PathSet, Propagator};
use sabine_scene::Scene;
use safetensors::tensor::{Dtype, TensorView};
use std::collections::{BTreeMap, HashMap};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Turns paths into a pressure response: the paths, the room they were traced in, its air, and a seed for what is random.
pub type RenderPaths<'a> =
    dyn Fn(&PathSet, &Scene, &Air, u64) -> Result<ImpulseResponse, sabine_acoustics::Error> + Sync + 'a;

/// Rooms drawn before a number is given up.
const ATTEMPTS: u64 = 8;

/// Draws polyhedral rooms and has them traced and rendered: a second source of responses besides measurements.
///
/// Which tracer and which renderer is the caller's affair ([`Propagator`], [`RenderPaths`]); the command `sabine augment`
/// takes those of `sabine-propagate`. A response depends on seed, settings, tracer and renderer alone.
///
/// ```no_run
/// # use sabine_acoustics::{Air, ImpulseResponse};
/// # use sabine_paths::{PathSet, Propagator};
/// # use sabine_scene::Scene;
/// # use sabine_augment::{PolyhedralRoomConfig, ResponseFilter, TracedRooms};
/// # fn wired(tracer: &dyn Propagator, render: &sabine_augment::RenderPaths) -> Result<(), sabine_augment::Error> {
/// let rooms = TracedRooms::new(PolyhedralRoomConfig::default(), tracer, render)?;
/// let responses = rooms.corpus(300, 1, &ResponseFilter::default(), None, &())?;
/// assert_eq!(responses.rooms().len(), 300); // each a room of its own
/// # Ok(())
/// # }
/// ```
pub struct TracedRooms<'a> {
    config: PolyhedralRoomConfig,
    propagator: &'a dyn Propagator,
    render: &'a RenderPaths<'a>,
}

/// Where traced responses are kept between runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RoomCache {
    /// Folder, made if it is not there.
    pub folder: PathBuf,
    /// Settings of tracer and renderer in words: responses are found again only under the same ones.
    pub tracer: String,
}

impl<'a> TracedRooms<'a> {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub fn new(
        config: PolyhedralRoomConfig,
        propagator: &'a dyn Propagator,
        render: &'a RenderPaths<'a>,
    ) -> Result<Self, Error> {
        config.check()?;
        Ok(Self { config, propagator, render })
    }

    /// The response of the room that belongs to this seed, its largest sample at 1.
    ///
    /// # Errors
    /// What [`PolyhedralRoom::draw`], the propagator and the renderer refuse; [`Error::NoDirectSound`] for silence.
    pub fn response(&self, seed: u64) -> Result<ImpulseResponse, Error> {
        let room = PolyhedralRoom::draw(&self.config, derive(seed, 1))?;
        let paths = self.propagator.trace(&room.scene, &room.source, &room.receiver, &room.air, &())?;
        let response = (self.render)(&paths, &room.scene, &room.air, derive(seed, 2))?;
        let (peak, rate_hz) = (response.peak(), response.sample_rate_hz());
        if peak <= 0.0 {
            return Err(Error::NoDirectSound { peak_db: f64::NEG_INFINITY });
        }
        let samples = response.into_samples().into_iter().map(|s| s / peak).collect();
        Ok(ImpulseResponse::new(samples, rate_hz)?)
    }

    /// Responses of `rooms` rooms, one each, named `traced/000000` and so on: the same for the same seed on any number of
    /// threads, and however many of them came out of the cache. A room that cannot be traced, or whose response
    /// `filter` refuses, is listed in [`ResponseCorpus::left_out`] and drawn again.
    ///
    /// A response in the cache is recognised by its settings and checked by its hash; a damaged one is made again.
    ///
    /// # Errors
    /// What was refused the eighth time for the same room, [`Error::Io`] for the cache,
    /// [`sabine_acoustics::Error::Cancelled`].
    pub fn corpus(
        &self,
        rooms: usize,
        seed: u64,
        filter: &ResponseFilter,
        cache: Option<&RoomCache>,
        observer: &dyn Observer,
    ) -> Result<ResponseCorpus, Error> {
        if let Some(cache) = cache {
            std::fs::create_dir_all(&cache.folder)
                .map_err(|source| Error::Io { path: cache.folder.clone(), source })?;
        }
        let done = AtomicU64::new(0);
        let parts: Vec<ResponseCorpus> = (0..rooms as u64)
            .into_par_iter()
            .map(|room| {
                let part = self.room(room, seed, filter, cache)?;
                report(observer, "tracing rooms", done.fetch_add(1, Ordering::Relaxed) + 1, rooms as u64)?;
                Ok(part)
            })
            .collect::<Result<_, Error>>()?;
        let mut corpus = ResponseCorpus::default();
        parts.into_iter().for_each(|part| corpus.extend(part));
        Ok(corpus)
    }

    fn room(
        &self,
        room: u64,
        seed: u64,
        filter: &ResponseFilter,
        cache: Option<&RoomCache>,
    ) -> Result<ResponseCorpus, Error> {
        let mut corpus = ResponseCorpus::default();
        let mut attempt = 0;
        loop {
            let seed = derive(derive(seed, room), attempt);
            let name = format!("traced/{room:06}");
            let path = format!("{name}#{attempt}");
            let made = self
                .cached(seed, cache)
                .and_then(|response| corpus.add(name, path.clone(), response, filter));
            attempt += 1;
            match made {
                Ok(()) => return Ok(corpus),
                Err(error @ Error::Io { .. }) => return Err(error),
                Err(error) if attempt == ATTEMPTS => return Err(error),
                Err(error) => corpus.left_out.push(LeftOut { path, reason: error.to_string() }),
            }
        }
    }

    /// The response out of the cache, or made and put there.
    fn cached(&self, seed: u64, cache: Option<&RoomCache>) -> Result<ImpulseResponse, Error> {
        let Some(cache) = cache else { return self.response(seed) };
        let version = env!("CARGO_PKG_VERSION");
        let key = hash_bytes(format!("{version}|{:?}|{}|{seed}", self.config, cache.tracer).as_bytes());
        let path = cache.folder.join(format!("{}.safetensors", &key[..32]));
        if let Some(found) = read_response(&path) {
            return Ok(found);
        }
        let response = self.response(seed)?;
        write_response(&path, &response)?;
        Ok(response)
    }
}

fn write_response(path: &Path, response: &ImpulseResponse) -> Result<(), Error> {
    let failed = |source| Error::Shard { path: path.to_owned(), source };
    let samples: Vec<u8> = response.samples().iter().flat_map(|s| s.to_le_bytes()).collect();
    let rate = response.sample_rate_hz().to_le_bytes();
    let tensors = BTreeMap::from([
        ("samples", TensorView::new(Dtype::F32, vec![response.samples().len()], &samples).map_err(failed)?),
        ("sample_rate_hz", TensorView::new(Dtype::U32, vec![1], &rate).map_err(failed)?),
    ]);
    // One entry only: more would come in random order.
    let metadata = HashMap::from([("sha256".to_owned(), hash_bytes(&samples))]);
    let bytes = safetensors::serialize(tensors, Some(metadata)).map_err(failed)?;
    Ok(sabine_acoustics::write_atomically(path, |file| file.write_all(&bytes))?)
}

/// A response from the cache, if it is there and whole.
fn read_response(path: &Path) -> Option<ImpulseResponse> {
    let bytes = std::fs::read(path).ok()?;
    let (_, header) = safetensors::SafeTensors::read_metadata(&bytes).ok()?;
    let tensors = safetensors::SafeTensors::deserialize(&bytes).ok()?;
    let samples = tensors.tensor("samples").ok()?;
    if header.metadata().as_ref()?.get("sha256")? != &hash_bytes(samples.data()) {
        return None;
    }
    let rate_hz = u32::from_le_bytes(tensors.tensor("sample_rate_hz").ok()?.data().try_into().ok()?);
    let samples =
        samples.data().chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    ImpulseResponse::new(samples, rate_hz).ok()
}
