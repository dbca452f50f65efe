//! One room: drawn, diagnosed, judged.

use crate::as_law::as_law;
use crate::change::change_db;
use crate::judge::judge;
use crate::kinds::KINDS;
use crate::outside::{self, OUTSIDE};
use crate::trial::{Discover, Trial};
use crate::worlds::{Contents, World, contents, room};
use sabine::diagnose::{Cause, DiagnoseConfig, Diagnoser, Diagnosis, FitTest};
use sabine_testkit::Laboratory;
use sabine_validation::AnyError;
use sabine_validation::absorption::absorption_errors;
use sabine_validation::room_tasks::RoomTask;
use std::path::Path;
use std::time::Instant;

/// What is to be done.
#[derive(Clone, Copy, Debug)]
pub struct Task {
    /// Number of the kind.
    pub kind: usize,
    pub world: World,
    pub seed: u64,
    pub rays: usize,
    pub receivers: usize,
    pub nuisances: bool,
    pub discover: Discover,
}

impl Task {
    /// By how much its law changes levels in dB, without a diagnosis; none where there is no law.
    pub fn change_db(&self) -> Result<Option<f64>, AnyError> {
        let lab = Laboratory::new(room(self.kind, self.seed, self.receivers + OUTSIDE))?;
        let contents = contents((self.kind, self.world), &lab, self.seed, self.nuisances)?;
        change_by_law(&lab, &contents)
    }
}

impl RoomTask for Task {
    type Trial = Trial;

    fn is_done(&self, trials: &[Trial]) -> bool {
        let own = (self.seed, self.rays, self.receivers, self.nuisances, self.discover);
        trials.iter().any(|t| {
            let world = match (t.size, t.null) {
                (Some(size), _) => World::Law(size),
                (None, Some(null)) => World::Null(null),
                (None, None) => return false,
            };
            t.kind == KINDS[self.kind].id
                && world == self.world
                && (t.seed, t.rays, t.receivers, t.nuisances, t.discover) == own
        })
    }

    fn name(&self) -> String {
        format!("{} {:?} seed {}", KINDS[self.kind].id, self.world, self.seed)
    }

    fn run(&self, folder: &Path) -> Result<Trial, AnyError> {
        let started = Instant::now();
        let kind = &KINDS[self.kind];
        let lab = Laboratory::new(room(self.kind, self.seed, self.receivers + OUTSIDE))?;
        let contents = contents((self.kind, self.world), &lab, self.seed, self.nuisances)?;
        let truth = lab.truth(&contents.hidden)?;
        std::fs::create_dir_all(folder)?;
        let all = lab.write(&contents.hidden, &folder.join("room"), None)?;
        let outside = outside::receivers(&all);
        let measured = all.with_responses(|response| !outside.contains(&response.receiver));
        let config = DiagnoseConfig { rays: self.rays, seed: self.seed, ..DiagnoseConfig::default() };
        let diagnoser = Diagnoser::new(config)?;
        let diagnoser = match self.discover {
            Discover::Always => diagnoser.discovering(),
            Discover::IfNeeded => diagnoser.discovering_if_needed(),
        };
        let first = contents.hidden.first().filter(|_| contents.law || contents.cause.is_some());
        let law = first.filter(|_| contents.law).map(|hidden| as_law(hidden, &truth)).transpose()?.flatten();
        let d_prime = law.map(|law| diagnoser.d_prime_of_law(&measured, &law, &())).transpose()?;
        let found = diagnoser.diagnose(&measured, &[], &())?;
        let [absorption_before, absorption_after] =
            absorption_errors(&found, &lab, &contents.hidden)?.map(Some);
        let extended = contents.law && !found.causes.is_empty();
        let off = || outside::errors(&found, &all, &outside, (self.rays, self.seed));
        let off = extended.then(off).transpose()?;
        let judged = judge(&found, kind, &contents, &truth)?;
        let change_db = change_by_law(&lab, &contents)?;
        let (size, null) = match self.world {
            World::Law(size) => (Some(size), None),
            World::Null(null) => (None, Some(null)),
        };
        let worst = found.lack_of_fit.tests.iter().min_by(|a, b| a.p_value.total_cmp(&b.p_value));
        Ok(Trial {
            kind: kind.id.to_owned(),
            null,
            size,
            seed: self.seed,
            rays: self.rays,
            receivers: self.receivers,
            nuisances: self.nuisances,
            discover: self.discover,
            hidden: first.map(|hidden| format!("{hidden:?}")).unwrap_or_default(),
            change_db,
            d_prime,
            outside_stated_db: off.map(|off| off.stated_db),
            outside_found_db: off.map(|off| off.found_db),
            outside_nats: off.map(|off| off.nats),
            absorption_before,
            absorption_after,
            surface: first.and_then(|hidden| kind.surface_of(hidden, &truth)).map(str::to_owned),
            verdict: found.verdict.to_string(),
            answer: answer(&found),
            laws: laws(&found),
            outcome: judged.outcome,
            false_laws: judged.false_laws,
            false_names: judged.false_names,
            sign_right: judged.agreement.sign,
            edge_right: judged.agreement.edge,
            rms_db: judged.agreement.rms_db,
            hidden_rms_db: judged.agreement.hidden_rms_db,
            family_p: found.laws.first().map(|law| law.family_p),
            vault_gain_nats: found.laws.first().and_then(|law| law.vault_gain_nats),
            fallen: fallen(&found),
            misfit_p: found.lack_of_fit.p_value_explained,
            misfit: worst.map(in_words).unwrap_or_default(),
            misfit_is_right: judged.misfit_is_right,
            seconds: started.elapsed().as_secs_f64(),
        })
    }
}

fn change_by_law(lab: &Laboratory, contents: &Contents) -> Result<Option<f64>, AnyError> {
    match contents.hidden.split_first() {
        Some((_, others)) if contents.law => {
            let (with, without) = (lab.responses(&contents.hidden)?, lab.responses(others)?);
            change_db(&with, &without, lab.config().bands).map(Some)
        }
        _ => Ok(None),
    }
}

/// Causes with their subjects, and the set that the last one stands for.
fn answer(found: &Diagnosis) -> String {
    let one = |cause: &Cause| match &cause.subject {
        Some(subject) => format!("{} ({subject})", cause.effect),
        None => cause.effect.clone(),
    };
    let causes = found.causes.iter().map(one).collect::<Vec<_>>().join(" + ");
    if found.alternatives.is_empty() {
        causes
    } else {
        format!("{causes}: {}", found.alternatives.join(" or "))
    }
}

fn laws(found: &Diagnosis) -> String {
    let one = |law: &sabine::diagnose::FoundLaw| {
        let on = law.surface.as_deref().map(|surface| format!(" {surface}")).unwrap_or_default();
        let values: Vec<String> =
            law.parameters.iter().map(|p| format!("{} = {:.3} {}", p.name, p.value, p.unit)).collect();
        format!("{}{on}: {}, {}", law.target, law.formula, values.join(", "))
    };
    found.laws.iter().map(one).collect::<Vec<_>>().join("; ")
}

fn fallen(found: &Diagnosis) -> String {
    let all = found.law_search.iter().flat_map(|search| &search.fallen);
    all.map(|law| format!("{}: {}", law.goes_with, law.reason)).collect::<Vec<_>>().join("; ")
}

fn in_words(test: &FitTest) -> String {
    match &test.subject {
        Some(subject) => format!("{} ({subject})", test.name),
        None => test.name.clone(),
    }
}
