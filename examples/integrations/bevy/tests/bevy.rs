//! A scene without a window: what is heard is the room of the walls as they are.

#![allow(clippy::unwrap_used)] // a panic is how a test fails

use bevy_app::App;
use sabine_acoustics::{ImpulseResponse, Material, library_material};
use sabine_with_bevy::{
    Acoustics, Loudspeaker, Progress, RoomPlugin, Rooms, Shoebox, UPDATES_HZ, Voice, Wall, WallMaterial,
};
use std::time::{Duration, Instant};

const RATE_HZ: u32 = 24_000;

fn shoebox() -> Shoebox {
    Shoebox {
        size_m: [7.0, 5.0, 3.0],
        materials: ["rendered_brick"; 6],
        source_m: [1.5, 2.0, 1.5],
        listener_m: [5.0, 3.5, 1.2],
        rays: 500,
        duration_s: 0.5,
        sample_rate_hz: RATE_HZ,
    }
}

fn noise(samples: usize) -> Vec<f32> {
    let mut state = 1_u32;
    (0..samples)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            0.1 * (state as f32 / u32::MAX as f32 - 0.5)
        })
        .collect()
}

fn app(voice: &[f32]) -> (App, [[ImpulseResponse; 2]; 2]) {
    let plugin = RoomPlugin::new(shoebox()).unwrap();
    let responses = |names: [&str; 6]| expected(plugin.acoustics(), names);
    let bare = responses(["rendered_brick"; 6]);
    let furnished = responses([
        "rendered_brick",
        "rendered_brick",
        "rendered_brick",
        "rendered_brick",
        "carpet_thin",
        "acoustic_plaster",
    ]);
    let mut app = App::new();
    app.insert_resource(Voice(voice.to_vec())).add_plugins(plugin);
    (app, [bare, furnished])
}

/// The responses of the same paths with these walls.
fn expected(acoustics: &Acoustics, names: [&str; 6]) -> [ImpulseResponse; 2] {
    let bands = sabine_acoustics::Bands::T60;
    let walls: [Material; 6] = names.map(|name| library_material(name).unwrap().material(bands).unwrap());
    acoustics.responses(&walls).unwrap()
}

fn change(app: &mut App, wall: usize, material: &'static str) {
    let world = app.world_mut();
    let mut walls = world.query::<(&Wall, &mut WallMaterial)>();
    for (_, mut found) in walls.iter_mut(world).filter(|(found, _)| found.0 == wall) {
        found.0 = material;
    }
}

fn progress(app: &App) -> Progress {
    app.world().resource::<Rooms>().progress()
}

/// As many updates, and more until the last change is heard.
fn updates(app: &mut App, count: usize) {
    let begin = Instant::now();
    for update in 0.. {
        if update >= count && !progress(app).is_under_way() {
            return;
        }
        app.update();
        assert!(begin.elapsed() < Duration::from_secs(120), "the room is not rendered");
        if progress(app).is_under_way() {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

/// The voice convolved, tap by tap, in double precision, and the sample that was heard.
fn difference(app: &App, voice: &[f32], room: &[ImpulseResponse; 2], frame: usize) -> (f64, f64) {
    let (mut off, mut peak) = (0.0_f64, 0.0_f64);
    for (side, response) in room.iter().enumerate() {
        let taps = response.samples().iter().enumerate();
        // Later than the input by a block of 64.
        let terms = taps.filter_map(|(k, &h)| {
            Some(f64::from(h) * f64::from(voice[frame.checked_sub(k + 64)? % voice.len()]))
        });
        let wanted: f64 = terms.sum();
        let heard = f64::from(app.world().resource::<Loudspeaker>().0[2 * frame + side]);
        (off, peak) = (off.max((heard - wanted).abs()), peak.max(wanted.abs()));
    }
    (off, peak)
}

fn level(app: &App, frames: std::ops::Range<usize>) -> f64 {
    let heard = &app.world().resource::<Loudspeaker>().0[2 * frames.start..2 * frames.end];
    let energy: f64 = heard.iter().map(|&s| f64::from(s).powi(2)).sum();
    10.0 * (energy / heard.len() as f64).log10()
}

#[test]
fn walls_change_their_materials_while_one_listens() {
    let voice = noise(5003);
    let (mut app, [bare, furnished]) = app(&voice);
    updates(&mut app, 50);
    let update = (RATE_HZ / UPDATES_HZ) as usize;
    let before = app.world().resource::<Loudspeaker>().0.len() / 2;
    assert!(before >= 50 * update);
    for frame in (0..before).step_by(97) {
        let (off, peak) = difference(&app, &voice, &bare, frame);
        assert!(off < 1e-5, "bare, frame {frame}: {off} of {peak}");
    }

    change(&mut app, 4, "carpet_thin");
    change(&mut app, 5, "acoustic_plaster");
    updates(&mut app, 1);
    // Time for the cross-fade, which is 50 ms long.
    updates(&mut app, 10);
    let faded = app.world().resource::<Loudspeaker>().0.len() / 2;
    updates(&mut app, 50);
    let end = app.world().resource::<Loudspeaker>().0.len() / 2;
    assert!(end >= 100 * update, "a hundred updates");
    for frame in (faded..end).step_by(97) {
        let (off, peak) = difference(&app, &voice, &furnished, frame);
        assert!(off < 1e-5, "furnished, frame {frame}: {off} of {peak}");
    }
    assert_eq!(progress(&app).problem, None);
    let fallen = level(&app, before - 20 * update..before) - level(&app, end - 20 * update..end);
    assert!((3.0..20.0).contains(&fallen), "carpet and plaster take {fallen} dB");
}

#[test]
fn a_material_that_nobody_knows_is_a_problem_and_no_silence() {
    let voice = noise(1009);
    let (mut app, [bare, furnished]) = app(&voice);
    updates(&mut app, 2);
    change(&mut app, 4, "cheese");
    updates(&mut app, 40);
    let problem = progress(&app).problem.unwrap();
    assert!(problem.contains("cheese"), "{problem}");
    let last = app.world().resource::<Loudspeaker>().0.len() / 2 - 1;
    assert!(difference(&app, &voice, &bare, last).0 < 1e-5, "the room is as it was");

    // Several changes at once: the last one counts.
    for floor in ["carpet_on_felt", "rendered_brick", "carpet_thin"] {
        change(&mut app, 4, floor);
        change(&mut app, 5, "acoustic_plaster");
        app.update();
    }
    updates(&mut app, 3);
    updates(&mut app, 40);
    let last = app.world().resource::<Loudspeaker>().0.len() / 2 - 1;
    assert!(difference(&app, &voice, &furnished, last).0 < 1e-5, "the last walls are heard");
}

#[test]
fn a_room_that_is_none_is_refused_before_the_app_runs() {
    let refused = |shoebox| RoomPlugin::new(shoebox).err().unwrap().to_string();
    for (error, expected) in [
        (refused(Shoebox { materials: ["cheese"; 6], ..shoebox() }), "cheese"),
        (refused(Shoebox { size_m: [0.0, 5.0, 3.0], ..shoebox() }), "side of the box"),
        (refused(Shoebox { source_m: [f64::NAN, 2.0, 1.5], ..shoebox() }), "position"),
        (refused(Shoebox { rays: 0, ..shoebox() }), "rays"),
        (refused(Shoebox { sample_rate_hz: 10, ..shoebox() }), "sample_rate_hz"),
        (refused(Shoebox { listener_m: shoebox().source_m, ..shoebox() }), "forward vector"),
    ] {
        assert!(error.contains(expected), "{error}");
    }
}
