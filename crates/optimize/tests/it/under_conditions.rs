//! Fits under laws and another attenuation, against closed forms: what a law takes at each meeting with a wall, absorption need not.

use crate::gradient::gradient_error;
use sabine_acoustics::{Air, Bands, Directivity, Estimate, Material, Orientation, PerBand};
use sabine_optimize::{
    AbsorptionPrior, DecayMisfit, Error, FitConfig, FitProblem, MaterialFit, MaterialFitter, MeasuredDecay,
    MeasuredPair, PredictedChange, SlopeEvaluation,
};
use sabine_paths::laws::{BoundLaws, Law, LawParameter, LawSite, LawTarget};
use sabine_paths::{Conditions, PathSet, Propagator};
use sabine_propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
use sabine_scene::{Levels, MeasuredRoom, Measurement, TimeZero};

/// What the law takes at each meeting with the carpet, in dB.
const TAKEN_DB: f64 = 1.0;
const CARPET: &str = "carpet";

struct Traced {
    room: MeasuredRoom,
    materials: Vec<Material>,
    paths: Vec<PathSet>,
}

impl Traced {
    fn new() -> Self {
        let room = MeasuredRoom::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room")).unwrap();
        let materials: Vec<Material> =
            room.scene().materials().iter().map(|m| m.material.resampled(Bands::T60)).collect();
        let config = TracerConfig { rays: 4000, duration_s: 1.2, ..TracerConfig::default() };
        let tracer = PathTracer::new(config).unwrap();
        let trace =
            |receiver| tracer.trace(room.scene(), &room.sources()[0], receiver, &room.air(), &()).unwrap();
        let paths = room.receivers()[..2].iter().map(trace).collect();
        Self { room, materials, paths }
    }

    fn laws(&self, target: LawTarget, formula: &str) -> Vec<BoundLaws> {
        let unit = if target == LawTarget::Delay { "ms" } else { "dB" };
        let c = LawParameter::new(TAKEN_DB, [0.0, 3.0], unit);
        let law = Law::new("takes", target, None, formula, [("c", c)]).unwrap();
        let bound = |receiver| {
            let site = LawSite::new(self.room.scene(), &self.room.sources()[0], receiver, &self.room.air());
            BoundLaws::new(std::slice::from_ref(&law), &site).unwrap()
        };
        self.room.receivers()[..2].iter().map(bound).collect()
    }

    /// Priors that leave the carpet free and hold all else.
    fn priors(&self) -> Vec<AbsorptionPrior> {
        let sd = |name: &str| if name == CARPET { 10.0 } else { 0.0 };
        let names = self.room.scene().materials().iter().map(|m| m.name.as_str());
        let one = |(name, m): (&str, &Material)| AbsorptionPrior {
            mean: m.absorption().clone(),
            standard_deviation: PerBand::uniform(Bands::T60, sd(name)),
        };
        names.zip(&self.materials).map(one).collect()
    }

    fn carpet(&self, fit: &MaterialFit) -> Vec<f64> {
        let place = self.room.scene().materials().iter().position(|m| m.name == CARPET).unwrap();
        fit.materials[place].absorption().values().to_vec()
    }

    /// Reverberation times of the room if its carpet absorbed so much, in the first pair.
    fn with_carpet_of(&self, absorption: f64) -> PerBand<Estimate> {
        let mut other = self.materials.clone();
        let place = self.room.scene().materials().iter().position(|m| m.name == CARPET).unwrap();
        other[place] = other[place].with_absorption(PerBand::uniform(Bands::T60, absorption)).unwrap();
        let change = PredictedChange::new(&self.paths[0], &self.materials, &other, &self.room.air()).unwrap();
        change.after.t60_s.map(|t60| Estimate::exact(t60.as_ref().unwrap().value))
    }

    fn fit(&self, under: &[Conditions<'_>]) -> Result<MaterialFit, Error> {
        let paths: Vec<&PathSet> = self.paths.iter().collect();
        let targets = self.with_carpet_of(0.6);
        let (priors, air) = (self.priors(), self.room.air());
        let problem = FitProblem::new(&self.materials, &priors, &air).under(under);
        MaterialFitter::new(FitConfig::default()).unwrap().fit_t60(&paths, &problem, &targets, &())
    }
}

#[test]
fn absorption_leaves_to_a_law_what_the_law_takes() {
    let traced = Traced::new();
    let air = traced.room.air();
    let laws = traced.laws(LawTarget::Path, "-c * hits(carpet)");
    let plain: Vec<Conditions<'_>> = vec![Conditions::new(&traced.materials, &air); 2];
    let under: Vec<Conditions<'_>> =
        plain.iter().zip(&laws).map(|(conditions, laws)| conditions.with_laws(laws)).collect();
    let without = traced.fit(&[]).unwrap();
    // Conditions that change nothing change nothing.
    for (a, b) in traced.carpet(&without).iter().zip(traced.carpet(&traced.fit(&plain).unwrap())) {
        assert!((a - b).abs() < 1e-4, "{a} {b}");
    }
    let with = traced.fit(&under).unwrap();
    let mut compared = 0;
    for (plain, under) in traced.carpet(&without).iter().zip(traced.carpet(&with)) {
        // (1 - a) 10^(-c/10) is what comes back: the same in both.
        let expected = 1.0 - (1.0 - plain) * 10f64.powf(0.1 * TAKEN_DB);
        if expected > 0.01 && *plain < 0.95 {
            assert!((under - expected).abs() < 2e-3, "{under} for {expected}");
            compared += 1;
        }
    }
    assert!(compared >= 3, "{:?} {:?}", traced.carpet(&without), traced.carpet(&with));
    // A change of materials under the law is that of the materials which, without it, give back as much.
    let louder = |materials: &[Material]| -> Vec<Material> {
        let place = traced.room.scene().materials().iter().position(|m| m.name == CARPET).unwrap();
        let mut all = materials.to_vec();
        let given = all[place].absorption().map(|a| 1.0 - (1.0 - a) * 10f64.powf(-0.1 * TAKEN_DB));
        all[place] = all[place].with_absorption(given).unwrap();
        all
    };
    let [paths, _] = &traced.paths[..] else { panic!("two pairs") };
    let found = PredictedChange::under(paths, &under[0], &with.materials).unwrap();
    let (before, after) = (louder(&traced.materials), louder(&with.materials));
    let expected = PredictedChange::new(paths, &before, &after, &air).unwrap();
    for (a, b) in found.difference.c50_db.values().iter().zip(expected.difference.c50_db.values()) {
        assert!((a.as_ref().unwrap().value - b.as_ref().unwrap().value).abs() < 1e-3);
    }
    for (a, b) in without.predicted_t60_s.values().iter().zip(with.predicted_t60_s.values()) {
        let (a, b) = (a.as_ref().unwrap().value, b.as_ref().unwrap().value);
        assert!((a - b).abs() < 2e-3 * a, "{a} s and {b} s");
    }
}

/// Responses rendered under a law are met by the materials that they were rendered with, if the fit knows of the law.
#[test]
fn responses_under_a_law_give_their_materials_back() {
    let traced = Traced::new();
    let air = traced.room.air();
    let laws = traced.laws(LawTarget::Path, "-c * hits(carpet)");
    let conditions: Vec<Conditions<'_>> =
        laws.iter().map(|laws| Conditions::new(&traced.materials, &air).with_laws(laws)).collect();
    let config = RenderConfig { sample_rate_hz: 48_000, ..RenderConfig::default() };
    let renderer = PressureRenderer::new(config).unwrap();
    let decay = |(paths, conditions): (&PathSet, &Conditions<'_>)| {
        MeasuredDecay::new(&renderer.render(paths, conditions).unwrap(), Bands::T60).unwrap()
    };
    let measured: Vec<MeasuredDecay> = traced.paths.iter().zip(&conditions).map(decay).collect();
    let pairs: Vec<MeasuredPair<'_>> = measured
        .iter()
        .zip(&traced.paths)
        .map(|(measured, paths)| MeasuredPair { measured, paths })
        .collect();
    let priors = traced.priors();
    let fit = |under: &[Conditions<'_>]| {
        let problem = FitProblem::new(&traced.materials, &priors, &air).under(under);
        let measurement = Measurement { levels: Levels::Common, time_zero: TimeZero::Emission };
        MaterialFitter::new(FitConfig::default())
            .unwrap()
            .fit_responses(&pairs, measurement, &problem, &())
            .unwrap()
            .fit
    };
    let (knowing, ignorant) = (fit(&conditions), fit(&[]));
    let place = traced.room.scene().materials().iter().position(|m| m.name == CARPET).unwrap();
    let truth = traced.materials[place].absorption().values();
    let off = |fit: &MaterialFit| {
        let all = traced.carpet(fit);
        all.iter().zip(truth).map(|(found, truth)| found - truth).sum::<f64>() / truth.len() as f64
    };
    // Who does not know of the law gives the carpet some 20 % of the sound more: 10^-0.1 of what it reflects.
    assert!(off(&knowing).abs() < 0.05 && off(&ignorant) > 0.1, "{} {}", off(&knowing), off(&ignorant));
    let misfit = |fit: &MaterialFit| {
        let conditions = conditions[0].with_materials(&fit.materials);
        let found = DecayMisfit::under(pairs[0], TimeZero::Emission, &conditions).unwrap();
        found.rmse_db.values().iter().map(|rmse| rmse.as_ref().unwrap()).sum::<f64>()
    };
    assert!(misfit(&knowing) < misfit(&ignorant));
}

/// Materials are fitted with everything else in place: a law, walls that react locally, another attenuation, a directional source.
#[test]
fn gradients_are_exact_under_conditions() {
    let traced = Traced::new();
    let (air, dry) = (traced.room.air(), Air::new(20.0, 15.0, 101.325).unwrap());
    let laws = traced.laws(LawTarget::Path, "-c * hits(carpet)");
    let cardioid = Directivity::first_order(Directivity::CARDIOID).unwrap();
    let facing = Orientation::towards([1.0, 0.2, 0.0]).unwrap();
    let conditions: Vec<Conditions<'_>> = laws
        .iter()
        .map(|laws| {
            Conditions::new(&traced.materials, &air)
                .with_laws(laws)
                .with_attenuation(&dry)
                .with_local_reaction(0.8, &traced.materials)
                .with_source(&cardioid, facing)
        })
        .collect();
    let paths: Vec<&PathSet> = traced.paths.iter().collect();
    let config = FitConfig::default();
    let materials = traced.materials.len();
    for band in [1, 4] {
        let under = SlopeEvaluation::under(&config, &paths, &conditions, band, 0.7).unwrap();
        let plain = SlopeEvaluation::new(&config, &paths, &traced.materials, &air, band, 0.7).unwrap();
        for at in [0.05, 0.3] {
            let x: Vec<f64> = (0..materials).map(|m| at + 0.05 * (m as f64).sin().abs()).collect();
            let error = gradient_error(&under, &x);
            assert!(error < 1e-6, "band {band} at {at}: {error}");
            let slope = |of: &SlopeEvaluation| of.slope_db_per_s(&x, &mut vec![0.0; materials]).unwrap();
            assert!((slope(&under) / slope(&plain) - 1.0).abs() > 0.005, "conditions change nothing");
        }
    }
}

#[test]
fn conditions_that_cannot_be_fitted_under_are_refused() {
    let traced = Traced::new();
    let air = traced.room.air();
    let plain = Conditions::new(&traced.materials, &air);
    assert!(matches!(traced.fit(&[plain]), Err(Error::ConditionCount { pairs: 2, found: 1 })));
    let laws = traced.laws(LawTarget::Added, "-c * 60");
    let under = [plain.with_laws(&laws[0]), plain.with_laws(&laws[1])];
    assert!(matches!(traced.fit(&under), Err(Error::AddedSound)));
    // A delay that all have alike moves no slope.
    let laws = traced.laws(LawTarget::Delay, "10 * c");
    let late = traced.fit(&[plain.with_laws(&laws[0]), plain.with_laws(&laws[1])]).unwrap();
    for (a, b) in traced.carpet(&traced.fit(&[]).unwrap()).iter().zip(traced.carpet(&late)) {
        assert!((a - b).abs() < 0.01, "{a} {b}");
    }
}
