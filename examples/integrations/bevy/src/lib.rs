//! A room in Bevy whose walls change their materials while one listens.
//!
//! A wall is an entity with [`Wall`] and [`WallMaterial`]. The paths of sound are traced once, when [`RoomPlugin`] is made; when a
//! material changes, a thread of its own weighs them again and hands the response to the node of [`sabine_with_firewheel`], which
//! cross-fades. No update and no callback waits for it.
//!
//! The stream renders into memory, [`Loudspeaker`]; a game starts firewheel's stream on the sound card in its place.

mod acoustics;

pub use acoustics::{Acoustics, RoomError, Shoebox};

use bevy_app::{App, Plugin, PostUpdate, Update};
use bevy_ecs::prelude::{Changed, Component, NonSendMut, Query, Res, ResMut, Resource};
use firewheel::channel_config::ChannelCount;
use firewheel::{FirewheelConfig, FirewheelContext, Volume};
use sabine_acoustics::{Material, library_material};
use sabine_with_firewheel::offline::Offline;
use sabine_with_firewheel::{RoomHandle, RoomNode, RoomNodeConfig};
use std::num::NonZeroU32;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

/// Updates of the app per second.
pub const UPDATES_HZ: u32 = 60;

/// A wall of the box: x = 0, x = length, y = 0, y = width, floor, ceiling.
#[derive(Clone, Copy, Component, Debug, PartialEq, Eq)]
pub struct Wall(pub usize);

/// What the wall is made of: a name that `sabine materials` lists. It may change at any time.
#[derive(Clone, Component, Debug, PartialEq, Eq)]
pub struct WallMaterial(pub &'static str);

/// The sound that the engine is given: mono, repeated without end.
#[derive(Clone, Debug, Resource)]
pub struct Voice(pub Vec<f32>);

/// What is to be heard, in place of a sound card: left and right alternating.
#[derive(Clone, Debug, Default, Resource)]
pub struct Loudspeaker(pub Vec<f32>);

/// Rooms under way to the ears.
#[derive(Resource)]
pub struct Rooms {
    jobs: Sender<[Material; 6]>,
    progress: Arc<Mutex<Progress>>,
}

/// What became of the changes of materials.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progress {
    /// Changes that were asked for.
    pub asked: usize,
    /// Changes that are heard, or that a later one has overtaken.
    pub heard: usize,
    /// Why the last change that failed did; the sound stays as it was.
    pub problem: Option<String>,
}

impl Progress {
    /// Whether a change is not heard yet.
    pub fn is_under_way(&self) -> bool {
        self.heard < self.asked
    }
}

impl Rooms {
    /// How far it is.
    pub fn progress(&self) -> Progress {
        lock(&self.progress).clone()
    }
}

/// The engine. firewheel keeps it on the thread that made it.
struct Engine {
    // Ends before the context does, which would wait for it.
    stream: Offline,
    context: FirewheelContext,
    position: usize,
}

/// Puts a room into an app: a box, a source and a listener, and the engine that plays in it.
pub struct RoomPlugin {
    acoustics: Arc<Acoustics>,
}

impl RoomPlugin {
    /// Traces the box.
    ///
    /// # Errors
    /// [`RoomError`] where box, places or materials do not fit.
    pub fn new(shoebox: Shoebox) -> Result<Self, RoomError> {
        Ok(Self { acoustics: Arc::new(Acoustics::new(shoebox)?) })
    }

    /// What the room is computed by.
    pub fn acoustics(&self) -> &Acoustics {
        &self.acoustics
    }

    /// The graph, the thread that renders, and the walls as they are at first.
    fn start(&self, app: &mut App) -> Result<(), RoomError> {
        let names = self.acoustics.shoebox().materials;
        let responses = self.acoustics.responses(&materials(names)?)?;
        let mut context = FirewheelContext::new(FirewheelConfig {
            num_graph_inputs: ChannelCount::MONO,
            ..FirewheelConfig::default()
        });
        let config = RoomNodeConfig {
            responses: responses.to_vec(),
            longest_s: self.acoustics.duration_s(),
            ..RoomNodeConfig::default()
        };
        // The paths hold the direct sound: nothing is missing that a dry part would have to add.
        let gains = RoomNode { wet: Volume::UNITY_GAIN, dry: Volume::SILENT };
        let room = context.add_node(gains, Some(config)).map_err(RoomError::engine)?;
        let (input, output) = (context.graph_in_node_id(), context.graph_out_node_id());
        context.connect(input, room, &[(0, 0)], true).map_err(RoomError::engine)?;
        context.connect(room, output, &[(0, 0), (1, 1)], true).map_err(RoomError::engine)?;
        let handle =
            RoomHandle::of(&context, room).ok_or_else(|| RoomError::engine("the room has no handle"))?;
        let rate_hz = NonZeroU32::new(self.acoustics.sample_rate_hz()).unwrap_or(NonZeroU32::MIN);
        let stream = Offline::start(&mut context, rate_hz, 1).map_err(RoomError::engine)?;

        let (jobs, waiting) = channel();
        let progress = Arc::new(Mutex::new(Progress::default()));
        let (acoustics, told) = (Arc::clone(&self.acoustics), Arc::clone(&progress));
        std::thread::spawn(move || render(&acoustics, &handle, &waiting, &told));
        app.insert_non_send(Engine { stream, context, position: 0 });
        app.insert_resource(Rooms { jobs, progress });
        for (wall, name) in names.into_iter().enumerate() {
            app.world_mut().spawn((Wall(wall), WallMaterial(name)));
        }
        Ok(())
    }
}

impl Plugin for RoomPlugin {
    /// # Panics
    /// If the room cannot be rendered or the engine does not start: Bevy's plugins have no other way to say so.
    fn build(&self, app: &mut App) {
        if let Err(error) = self.start(app) {
            panic!("the room does not start: {error}");
        }
        app.init_resource::<Loudspeaker>()
            .add_systems(Update, follow_materials)
            .add_systems(PostUpdate, play);
    }
}

/// Renders the room of the latest materials, as long as the app runs.
fn render(
    acoustics: &Acoustics,
    handle: &RoomHandle,
    waiting: &Receiver<[Material; 6]>,
    progress: &Mutex<Progress>,
) {
    while let Ok(mut materials) = waiting.recv() {
        let mut taken = 1;
        while let Ok(later) = waiting.try_recv() {
            (materials, taken) = (later, taken + 1);
        }
        let done =
            acoustics.responses(&materials).and_then(|responses| Ok(handle.change_room(responses.to_vec())?));
        let mut progress = lock(progress);
        progress.heard += taken;
        if let Err(error) = done {
            progress.problem = Some(error.to_string());
        }
    }
}

/// Asks for another room when a wall has changed.
fn follow_materials(
    changed: Query<(), Changed<WallMaterial>>,
    walls: Query<(&Wall, &WallMaterial)>,
    rooms: Res<Rooms>,
) {
    if changed.is_empty() {
        return;
    }
    let mut names = [""; 6];
    for (wall, material) in &walls {
        if let Some(name) = names.get_mut(wall.0) {
            *name = material.0;
        }
    }
    let mut progress = lock(&rooms.progress);
    let sent = materials(names).and_then(|materials| {
        rooms.jobs.send(materials).map_err(|_| RoomError::engine("the thread that renders has ended"))
    });
    match sent {
        Ok(()) => progress.asked += 1,
        Err(error) => progress.problem = Some(error.to_string()),
    }
}

/// Plays for as long as an update lasts, and lets firewheel do what it does once an update.
fn play(
    mut engine: NonSendMut<Engine>,
    voice: Res<Voice>,
    rooms: Res<Rooms>,
    mut heard: ResMut<Loudspeaker>,
) {
    let engine = &mut *engine;
    let rate_hz = engine.context.stream_info().map_or(0, |stream| stream.sample_rate.get());
    let frames = (rate_hz / UPDATES_HZ) as usize;
    let next = voice.0.iter().cycle().skip(engine.position).take(frames);
    let input: Vec<f32> = if voice.0.is_empty() { vec![0.0; frames] } else { next.copied().collect() };
    engine.position = (engine.position + frames) % voice.0.len().max(1);
    let begin = heard.0.len();
    heard.0.resize(begin + 2 * frames, 0.0);
    engine.stream.render(&input, &mut heard.0[begin..]);
    if let Err(error) = engine.context.update() {
        lock(&rooms.progress).problem = Some(error.to_string());
    }
}

/// Materials of the library.
fn materials(names: [&str; 6]) -> Result<[Material; 6], RoomError> {
    let found = names.map(|name| library_material(name)?.material(acoustics::BANDS));
    let mut materials = Vec::new();
    for material in found {
        materials.push(material.map_err(RoomError::Acoustics)?);
    }
    materials.try_into().map_err(|_| RoomError::engine("a box has six walls"))
}

fn lock(progress: &Mutex<Progress>) -> std::sync::MutexGuard<'_, Progress> {
    progress.lock().unwrap_or_else(PoisonError::into_inner)
}
