#![allow(clippy::unwrap_used)]
mod material;
use material::shared_data;
use sabine_acoustics::*;
use sabine_augment::*;
#[test]
fn inv() {
    let data = shared_data().unwrap();
    let by_file = ["python_acoustics".to_owned(), "decayfitnet".to_owned()];
    let filter =
        ResponseFilter { excluded_rooms: vec!["spatialaudio".to_owned()], ..ResponseFilter::default() };
    let mut corpus = ResponseCorpus::read(&data.join("rir"), 16_000, &filter, &by_file, &()).unwrap();
    corpus.extend(ResponseCorpus::read(&data.join("rooms"), 16_000, &filter, &by_file, &()).unwrap());
    let augment = T60Augment::new(T60Config::default()).unwrap();
    for room in corpus.rooms() {
        let own: Vec<_> = corpus.responses().iter().filter(|r| r.room == room).collect();
        for measured in own.iter().step_by(own.len().div_ceil(4)) {
            let full = augment.full_band_s(&measured.response).unwrap();
            let bands = OctaveBands::T60;
            let pick = |r: &ImpulseResponse| -> Vec<(Reading, Result<DecayFit, NoReading>)> {
                let lower = OctaveBands::new(125.0, 4000.0).unwrap();
                let p = RoomParameters::measure(r, lower).unwrap();
                (0..6).map(|i| (p.t60_s.values()[i].clone(), p.fits.values()[i].clone())).collect()
            };
            let before = pick(&measured.response);
            for (j, target) in [0.1, 0.2, 0.4, 0.7, 1.1, 1.5].into_iter().enumerate() {
                let Ok(changed) = augment.to_s(&measured.response, target, j as u64) else {
                    println!("REF {} {target}", measured.path);
                    continue;
                };
                let after = pick(&changed);
                for b in 0..6 {
                    if let (Ok(x), Ok(fx)) = &before[b] {
                        let (y, sy, ny, dy) = match &after[b] {
                            (Ok(y), Ok(f)) => (y.value, y.standard_error, f.slopes().len(), f.dispersion()),
                            _ => (f64::NAN, f64::NAN, 0, f64::NAN),
                        };
                        println!(
                            "ROW {} {} {target} {:.4} {:.4} {:.4} {:.4} {} {:.2} {} {:.2} {:.1} {:.4}",
                            measured.path.replace(' ', "_"),
                            bands.nominal_hz(b),
                            x.value,
                            x.standard_error,
                            y,
                            sy,
                            fx.slopes().len(),
                            fx.dispersion(),
                            ny,
                            dy,
                            fx.range_db(),
                            full
                        );
                    }
                }
            }
        }
    }
}
