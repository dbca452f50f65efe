//! A diagnosis takes any tracer.
#![allow(clippy::unwrap_used)] // a panic is how a test fails

use sabine_acoustics::{Air, Error, Observer};
use sabine_diagnose::{DiagnoseConfig, Diagnoser, EachScene};
use sabine_paths::{PathSet, Propagator};
use sabine_scene::{Receiver, Scene, Source};
use sabine_testkit::{Hidden, LabConfig, Laboratory, ShoeboxImages};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The image sources of the test kit, which share no code with the path tracer, and how often they were asked.
#[derive(Clone)]
struct Counted {
    images: Arc<ShoeboxImages>,
    asked: Arc<AtomicUsize>,
}

impl Propagator for Counted {
    fn trace(
        &self,
        scene: &Scene,
        source: &Source,
        receiver: &Receiver,
        air: &Air,
        observer: &dyn Observer,
    ) -> Result<PathSet, Error> {
        self.asked.fetch_add(1, Ordering::Relaxed);
        self.images.trace(scene, source, receiver, air, observer)
    }
}

#[test]
fn a_latency_is_found_with_the_paths_of_another_tracer() {
    let lab = Laboratory::new(LabConfig { seed: 3, receivers: 4, ..LabConfig::default() }).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let hidden = [Hidden::TimeZero { latency_s: 5e-3 }];
    let room = lab.write(&hidden, &folder.path().join("room"), None).unwrap();
    let asked = Arc::new(AtomicUsize::new(0));
    let images = Arc::new(ShoeboxImages::new(0.3).unwrap());
    let tracer = EachScene(Counted { images, asked: Arc::clone(&asked) });
    let config = DiagnoseConfig { simulations: 10, ..DiagnoseConfig::default() };
    let only = ["time_zero".to_owned(), "position_error".to_owned()];
    let diagnoser = Diagnoser::new(config).unwrap().with_tracer(tracer).with_only(&only).unwrap();
    let found = diagnoser.diagnose(&room, &[], &()).unwrap();
    assert_eq!(asked.load(Ordering::Relaxed), 4, "one question for each pair");
    // Images know no scattering: whether the decays agree is not the question here.
    let first = &found.candidates[0];
    assert!(first.effect == "time_zero" && first.nats > 100.0, "{:?}", found.candidates);
}
