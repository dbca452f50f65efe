//! The augmentations on every usable measured response. Skipped where `../shared/data` is not there.

use crate::material::{quantile, shared_data};
use sabine_acoustics::{
    BandParameters, Bands, FilterBank, ImpulseResponse, PerBand, RoomParameters, equalisation,
};
use sabine_augment::Augment;
use sabine_augment::{
    DrrAugment, DrrConfig, EqAugment, EqConfig, EqStatistics, Labels, MeasuredResponse, ResponseCorpus,
    ResponseFilter, T60Augment, T60Config,
};
use std::collections::BTreeMap;

fn corpus() -> Option<ResponseCorpus> {
    let data = shared_data()?;
    let by_file = ["python_acoustics".to_owned(), "decayfitnet".to_owned()];
    // The hand clap is no response.
    let filter =
        ResponseFilter { excluded_rooms: vec!["spatialaudio".to_owned()], ..ResponseFilter::default() };
    let mut corpus = ResponseCorpus::read(&data.join("rir"), 16_000, &filter, &by_file, &()).unwrap();
    corpus.extend(ResponseCorpus::read(&data.join("rooms"), 16_000, &filter, &by_file, &()).unwrap());
    for left_out in corpus.left_out() {
        eprintln!("left out: {}: {}", left_out.path, left_out.reason);
    }
    Some(corpus)
}

/// At most four responses of each room: the rooms count, not the microphones.
fn few_of_each(corpus: &ResponseCorpus) -> Vec<&MeasuredResponse> {
    let mut chosen = Vec::new();
    for room in corpus.rooms() {
        let own: Vec<_> = corpus.responses().iter().filter(|r| r.room == room).collect();
        chosen.extend(own.iter().step_by(own.len().div_ceil(4)).copied());
    }
    chosen
}

fn times(response: &ImpulseResponse) -> Vec<Option<f64>> {
    let labels = Labels::measure(response).unwrap();
    labels.t60_s().values().iter().map(|r| r.as_ref().ok().map(|e| e.value)).collect()
}

const TARGETS_S: [f64; 6] = [0.1, 0.2, 0.4, 0.7, 1.1, 1.5];

/// What can be judged in an octave: bandwidth times reverberation time of 16 at least, before and as wanted (ISO 3382-2, 7.3,
/// for the filters of ordinary instruments). Below, the filter rings about as long as the room and its direct sound is read.
fn is_usable(octave: usize, before_s: f64, wanted_s: f64) -> bool {
    let (low_hz, high_hz) = Bands::T60.edges_hz(octave);
    // At 16 kHz the 8 kHz octave is read in its lowest third.
    let width_hz = if octave == 6 { 0.2316 * 6310.0 } else { high_hz - low_hz };
    before_s.min(wanted_s) * width_hz >= 16.0
}

/// In the gate, `t60` holds the augmentation against decays that are known.
#[test]
#[ignore = "nightly: 132 changes, each measured; minutes on two cores"]
fn reverberation_times_of_measured_responses_meet_their_targets() {
    let Some(corpus) = corpus() else { return };
    let augment = T60Augment::new(T60Config::default()).unwrap();
    let (mut all, mut refused, mut asked, mut unread) = (Vec::new(), 0, 0, 0);
    // Error of every reading that can be judged, with octave and target.
    let mut usable: Vec<(usize, usize, f64)> = Vec::new();
    for (i, measured) in few_of_each(&corpus).into_iter().enumerate() {
        let before = times(&measured.response);
        let full_band_s = augment.full_band_s(&measured.response).unwrap();
        for (j, target_s) in TARGETS_S.into_iter().enumerate() {
            asked += 1;
            let Ok(changed) = augment.to_s(&measured.response, target_s, (10 * i + j) as u64) else {
                refused += 1;
                continue;
            };
            // The direct sound and all before it stay to the bit.
            let peak = peak_index(&measured.response);
            assert_eq!(changed.samples()[..peak + 40], measured.response.samples()[..peak + 40]);
            for (octave, (before, after)) in before.iter().zip(times(&changed)).enumerate() {
                let Some(before) = before else { continue };
                let wanted = before * target_s / full_band_s;
                let Some(after) = after else {
                    unread += 1;
                    continue;
                };
                let error = after / wanted - 1.0;
                all.push(error.abs());
                if is_usable(octave, *before, wanted) {
                    usable.push((octave, j, error.abs()));
                    if error.abs() > 0.1 {
                        eprintln!(
                            "{} {target_s} s, {} Hz: {:+.0} % ({before:.2} -> {after:.2} s)",
                            measured.path,
                            125 << octave,
                            100.0 * error
                        );
                    }
                }
            }
        }
    }
    let percent = |mut errors: Vec<f64>| match errors.len() {
        0 => "-".to_owned(),
        n => format!(
            "{:.1} / {:.1} ({n})",
            100.0 * quantile(&mut errors, 0.5),
            100.0 * quantile(&mut errors, 0.95)
        ),
    };
    let of = |octave: Option<usize>, target: Option<usize>| -> Vec<f64> {
        let wanted =
            usable.iter().filter(|u| octave.is_none_or(|o| o == u.0) && target.is_none_or(|t| t == u.1));
        wanted.map(|u| u.2).collect()
    };
    eprintln!("{asked} changes asked, {refused} refused, {unread} readings not possible afterwards");
    eprintln!("all readings: median / 95th percentile (readings) in % {}", percent(all));
    for octave in (0..7).map(Some).chain([None]) {
        let name = octave.map_or("all".to_owned(), |o| format!("{} Hz", 125 << o));
        let cells: Vec<String> =
            (0..6).map(Some).chain([None]).map(|target| percent(of(octave, target))).collect();
        eprintln!("| {name} | {} |", cells.join(" | "));
    }
    let (median, high) = (quantile(&mut of(None, None), 0.5), quantile(&mut of(None, None), 0.95));
    assert!(median < 0.03, "median {median}");
    assert!(high < 0.10, "95th percentile {high}");
    // 125 Hz misses the 10 %: docs/validation/augment.md.
    for octave in 1..7 {
        let (median, high) =
            (quantile(&mut of(Some(octave), None), 0.5), quantile(&mut of(Some(octave), None), 0.95));
        assert!(median < 0.03 && high < 0.10, "{} Hz: {median}, {high}", 125 << octave);
    }
    assert!(refused * 10 < asked, "{refused} of {asked} refused");
}

/// Index of the largest sample: the direct sound reaches 40 samples (2.5 ms) beyond it.
fn peak_index(response: &ImpulseResponse) -> usize {
    response.samples().iter().position(|s| s.abs() == response.peak()).unwrap()
}

#[test]
fn measured_decays_go_on_below_their_noise() {
    let Some(corpus) = corpus() else { return };
    let augment = T60Augment::new(T60Config::default()).unwrap();
    let bands = Bands::octaves(250.0, 4000.0).unwrap();
    let mut judged = 0;
    for (i, measured) in few_of_each(&corpus).into_iter().enumerate() {
        let before = RoomParameters::measure(&measured.response, bands).unwrap();
        let changed = augment.by_factor(&measured.response, 1.0, i as u64).unwrap();
        let split = FilterBank::new(bands, 16_000).unwrap().split(changed.samples());
        let decay_s =
            |band: usize| before.fits.values()[band].as_ref().map_or(f64::INFINITY, |f| f.t60_s().value);
        for (band, part) in split.values().iter().enumerate().take(4).skip(1) {
            let Ok(fit) = &before.fits.values()[band] else { continue };
            // So far down, a neighbour that decays more slowly is heard through the skirt of the filter.
            if decay_s(band - 1).max(decay_s(band + 1)) > 1.1 * decay_s(band) {
                continue;
            }
            // From the old knee on, over 30 dB of the decay in steps of 10 dB; the slowest slope alone is left there.
            let slowest_s = fit.slopes().iter().map(|s| s.t60_s.value).fold(0.0, f64::max);
            let step = (slowest_s / 6.0 * 16e3) as usize;
            let from = (fit.knee_s() * 16e3) as usize;
            if fit.slopes().len() > 1 || from + 4 * step > part.len() {
                continue;
            }
            let level_db: Vec<f64> = (0..4)
                .map(|k| {
                    let block = &part[from + k * step..from + (k + 1) * step];
                    10.0 * (block.iter().map(|&s| f64::from(s).powi(2)).sum::<f64>() / step as f64).log10()
                })
                .collect();
            judged += 1;
            // A block holds B T / 6 / 2.6 independent values or so, decaying: 20 at 500 Hz and 0.3 s, 1 dB of scatter; the
            // correction of the factor adds up to 2 %. Five standard errors of the difference over 30 dB.
            let values = 0.5 * bands.exact_hz(band) * slowest_s / 15.0;
            let tolerance_db = 5.0 * 4.34 * (2.0 / values).sqrt() + 1.0;
            let fall_db = level_db[0] - level_db[3];
            assert!(
                (fall_db - 30.0).abs() < tolerance_db,
                "{} octave {band}: {fall_db:.1} dB instead of 30, {tolerance_db:.1} allowed",
                measured.path
            );
        }
    }
    eprintln!("{judged} octaves judged");
    assert!(judged > 15, "{judged}");
}

#[test]
fn ratio_and_equalisation_of_measured_responses_meet_their_targets() {
    let Some(corpus) = corpus() else { return };
    let drr = DrrAugment::new(DrrConfig::default()).unwrap();
    let eq = EqAugment::new(EqConfig::default(), 16_000).unwrap();
    let (mut met, mut refused) = ([0, 0], [0, 0]);
    for (i, measured) in few_of_each(&corpus).into_iter().enumerate() {
        let response = &measured.response;
        let end = peak_index(response) + 41;
        for target_db in [-6.0, 0.0, 6.0, 12.0, 18.0] {
            let Ok(changed) = drr.to_db(response, target_db) else {
                refused[0] += 1;
                continue;
            };
            met[0] += 1;
            assert_eq!(changed.samples()[end..], response.samples()[end..], "{}: late part", measured.path);
            let found = BandParameters::full_band(&changed).drr_db.unwrap().value;
            assert!((found - target_db).abs() < 0.2, "{}: {found} dB for {target_db} dB", measured.path);
        }
        for k in 0..3 {
            let mut levels: Vec<f64> =
                (0..7).map(|o| f64::from((7 * i as i32 + 5 * k + 3 * o) % 13) - 6.0).collect();
            levels[4] = 0.0;
            let target = PerBand::new(Bands::EQ, levels).unwrap();
            let Ok(changed) = eq.to_db(response, &target) else {
                refused[1] += 1;
                continue;
            };
            met[1] += 1;
            let found = equalisation(&changed, Bands::EQ).unwrap();
            for ((hz, found), wanted) in found.iter().zip(target.values()) {
                let Ok(found) = found else { continue };
                assert!(
                    (found.value - wanted).abs() < 0.5,
                    "{} {hz} Hz: {} dB for {wanted} dB",
                    measured.path,
                    found.value
                );
            }
        }
    }
    eprintln!("DRR: {} met, {} refused; EQ: {} met, {} refused", met[0], refused[0], met[1], refused[1]);
    assert!(met[0] > 50 && met[1] > 40);
}

/// The rooms that `docs/validation/estimator.md` tests the estimator in: nothing that training uses is fitted to them.
const TEST_ROOMS: [&str; 4] =
    ["bbc_listening_room", "bras_cr2", "flamo_otala", "python_acoustics/living_room_1"];

#[test]
fn the_shipped_statistics_are_those_of_the_rooms_that_are_not_for_the_test() {
    let Some(corpus) = corpus() else { return };
    let fit = |wanted: &dyn Fn(&str) -> bool| {
        let labels: Vec<Vec<Labels>> = corpus
            .rooms()
            .iter()
            .filter(|room| wanted(room))
            .map(|room| {
                corpus.responses().iter().filter(|r| &r.room == room).map(|r| r.labels.clone()).collect()
            })
            .collect();
        let fitted = EqStatistics::fit(labels.iter().map(Vec::as_slice)).unwrap();
        eprintln!("{} rooms, {} responses", labels.len(), fitted.responses());
        eprintln!("mean {:.2?}", fitted.mean_db().values());
        eprintln!("sd   {:.2?}", fitted.standard_deviation_db().values());
        fitted
    };
    fit(&|_| true);
    let fitted = fit(&|room| !TEST_ROOMS.contains(&room));
    let shipped = EqStatistics::measured();
    for i in 0..7 {
        assert!((fitted.mean_db().values()[i] - shipped.mean_db().values()[i]).abs() < 0.05);
        assert!(
            (fitted.standard_deviation_db().values()[i] - shipped.standard_deviation_db().values()[i]).abs()
                < 0.05
        );
    }
    assert_eq!(fitted.responses(), shipped.responses());
}

#[test]
fn most_changes_of_measured_responses_are_granted_and_keep_the_direct_sound_in_front() {
    let Some(corpus) = corpus() else { return };
    let chain = sabine_augment::Chain::for_training(16_000).unwrap();
    let t60 = T60Augment::new(T60Config::default()).unwrap();
    let (mut granted, mut asked) = (0, 0);
    for room in corpus.rooms() {
        let measured = few_of_each(&corpus).into_iter().find(|r| r.room == room).unwrap();
        let mut reasons = BTreeMap::new();
        for seed in 0..10 {
            asked += 1;
            let outcome = match chain.augment(&measured.response, seed) {
                Ok(_) => "granted".to_owned(),
                Err(error) => error.to_string().chars().filter(|c| !c.is_ascii_digit()).collect(),
            };
            granted += u32::from(outcome == "granted");
            *reasons.entry(outcome).or_insert(0) += 1;
            if let Ok(changed) = t60.augment(&measured.response, seed) {
                // No late growth: what comes 0.1 s after the largest sample of the recording stays below it.
                let peak = measured
                    .response
                    .samples()
                    .iter()
                    .position(|s| s.abs() == measured.response.peak())
                    .unwrap();
                let late = changed.samples()[peak + 1600..].iter().fold(0.0_f32, |p, s| p.max(s.abs()));
                assert!(
                    late < measured.response.peak(),
                    "{} seed {seed}: the tail grows to {late}",
                    measured.path
                );
            }
        }
        eprintln!("{room}: {reasons:?}");
    }
    eprintln!("{granted} of {asked} granted");
    assert!(granted * 10 > asked * 7, "{granted} of {asked}");
}
