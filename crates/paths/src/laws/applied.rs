//! Laws applied to paths.

use crate::conditions::Conditions;
use crate::laws::blocks::{Argument, Program};
use crate::laws::bound::{BoundLaw, BoundLaws};
use crate::laws::columns::{BLOCK, Columns, Slot};
use crate::laws::error::{LawError, LawFault, Place};
use crate::laws::formula::Op;
use crate::laws::gain::{MAX_GAIN_DB, NEPERS_PER_DB, check_gain, nepers};
use crate::laws::law::Law;
use crate::laws::reflections::ReflectionTables;
use crate::laws::target::LawTarget;
use crate::laws::variable::Variable;
use crate::path_set::PathSet;
use crate::reweighting::{LANES, Lanes};
use sabine_acoustics::{Bands, Error};
use std::ops::Range;

/// Laws that act on the energy of paths, and walls that react locally, prepared for one set of paths.
pub(crate) struct PathLaws<'l> {
    programs: Vec<Program<'l>>,
    reflections: Option<ReflectionTables>,
    bands: Bands,
    last: Option<&'l Law>,
}

impl<'l> PathLaws<'l> {
    /// Prepares what acts; `None` where nothing does. What is recorded at a time is what arrives then, so that laws of the
    /// recorder act on paths by their time of arrival.
    pub fn new(conditions: &Conditions<'l>, paths: &PathSet, bands: Bands) -> Result<Option<Self>, Error> {
        if conditions.laws.is_none() && conditions.local_reaction.is_none() {
            return Ok(None);
        }
        let mut columns = Columns::new(paths, conditions.air.speed_of_sound_m_s());
        let all = || conditions.laws.into_iter();
        let of = |target| all().flat_map(move |laws| laws.of(target));
        let of_paths = of(LawTarget::Path).chain(of(LawTarget::Recorder));
        let programs =
            of_paths.map(|bound| Program::new(bound, bands, &mut columns)).collect::<Result<Vec<_>, _>>()?;
        let reflections = ReflectionTables::new(conditions, paths, bands)?;
        let acts = reflections.is_some() || !programs.is_empty();
        let last = all().flat_map(|laws| &laws.laws).last().map(|bound| &bound.law);
        Ok(acts.then_some(Self { programs, reflections, bands, last }))
    }

    /// The laws of reflections.
    pub fn reflections(&self) -> Option<&ReflectionTables> {
        self.reflections.as_ref()
    }

    /// What the laws do in the bands from `first` on.
    pub fn in_bands(&self, paths: &PathSet, first: usize) -> Result<LawLanes<'_>, LawError> {
        let lanes = LANES.min(self.bands.len() - first);
        let mut uniform = [0.0; LANES];
        for program in self.programs.iter().filter(|program| program.is_uniform()) {
            for (lane, sum) in uniform.iter_mut().enumerate().take(lanes) {
                let db = program.result(&[], &(0..1), (first, lane)).at(0);
                let place = Place { path: None, band_hz: Some(self.bands.nominal_hz(first + lane)) };
                check_gain(&program.bound.law, db, place)?;
                *sum += nepers(db) as f32;
            }
        }
        Ok(LawLanes {
            laws: self,
            first,
            lanes,
            uniform,
            along_axes: self.reflections.as_ref().and_then(|tables| tables.along_axes(paths, first)),
            slots: self.programs.iter().map(Program::new_slots).collect(),
        })
    }
}

/// Laws applied in a few bands.
pub(crate) struct LawLanes<'l> {
    laws: &'l PathLaws<'l>,
    first: usize,
    lanes: usize,
    /// What is the same for all paths.
    uniform: Lanes,
    along_axes: Option<Vec<Lanes>>,
    slots: Vec<Vec<Slot>>,
}

impl LawLanes<'_> {
    /// Adds what laws do to the logarithm of the energy of some paths, at most [`BLOCK`](crate::laws::BLOCK), beside what they do along chains.
    pub fn add_to_paths(&mut self, range: &Range<usize>, block: &mut [Lanes]) -> Result<(), LawError> {
        let uniform = self.uniform;
        block.iter_mut().for_each(|x| *x = std::array::from_fn(|i| x[i] + uniform[i]));
        if let Some(added) = &self.along_axes {
            let added = &added[range.clone()];
            block.iter_mut().zip(added).for_each(|(x, added)| *x = std::array::from_fn(|i| x[i] + added[i]));
        }
        let varied = self.laws.programs.iter().zip(&mut self.slots).filter(|(p, _)| !p.is_uniform());
        for (program, slots) in varied {
            program.in_bands(slots, range, (self.first, self.lanes))?;
            // Lanes beyond the last band repeat it: nobody reads them.
            let results: [Argument<'_>; LANES] = std::array::from_fn(|lane| {
                program.result(slots, range, (self.first, lane.min(self.lanes - 1)))
            });
            let [Argument::Many(a), Argument::Many(b), Argument::Many(c), Argument::Many(d)] = results else {
                continue;
            };
            for (lane, db) in [a, b, c, d].into_iter().enumerate().take(self.lanes) {
                if !db.iter().fold(true, |within, db| within & (*db <= MAX_GAIN_DB)) {
                    let greatest = db.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                    let band_hz = Some(self.laws.bands.nominal_hz(self.first + lane));
                    check_gain(&program.bound.law, greatest, Place { path: None, band_hz })?;
                }
            }
            for (x, (((&a, &b), &c), &d)) in block.iter_mut().zip(a.iter().zip(b).zip(c).zip(d)) {
                let added = [a, b, c, d].map(|db| nepers(db) as f32);
                *x = std::array::from_fn(|lane| x[lane] + added[lane]);
            }
        }
        self.check_sum(range, block)
    }

    /// All laws together, and the geometric weight, leave the exponential in its range.
    fn check_sum(&self, range: &Range<usize>, block: &[Lanes]) -> Result<(), LawError> {
        // Walls alone reflect no more than they receive.
        let Some(last) = self.laws.last else { return Ok(()) };
        let most = (MAX_GAIN_DB * NEPERS_PER_DB) as f32;
        let none = [true; LANES];
        let within = block.iter().fold(none, |within, x| std::array::from_fn(|i| within[i] & (x[i] <= most)));
        // Lanes beyond the last band hold the weight alone, which may be any where paths stand for many.
        if within[..self.lanes] == none[..self.lanes] {
            return Ok(());
        }
        let read = block.iter().flat_map(|x| &x[..self.lanes]);
        let greatest = read.fold(f32::NEG_INFINITY, |greatest, &x| greatest.max(x));
        let path = block.iter().position(|x| x.contains(&greatest)).map(|i| range.start + i);
        let found_db = f64::from(greatest) / NEPERS_PER_DB;
        let place = Place { path, band_hz: None };
        Err(last.error(None, LawFault::TooLoud { found_db, max_db: MAX_GAIN_DB, place }))
    }
}

/// What laws of delay add to the time of arrival of each path, in seconds; `None` where there are none.
pub(crate) fn delays_s(
    laws: &BoundLaws,
    paths: &PathSet,
    speed_m_s: f64,
    bands: Bands,
) -> Result<Option<Vec<f64>>, LawError> {
    let mut delays_s: Option<Vec<f64>> = None;
    for bound in laws.of(LawTarget::Delay) {
        let program = Program::new(bound, bands, &mut Columns::new(paths, speed_m_s))?;
        let sum = delays_s.get_or_insert_with(|| vec![0.0; paths.len()]);
        // Delays are the same in all bands: all that varies has been computed.
        for (block, sums) in sum.chunks_mut(BLOCK).enumerate() {
            let start = block * BLOCK;
            let added = program.result(&[], &(start..start + sums.len()), (0, 0));
            sums.iter_mut().enumerate().for_each(|(i, sum)| *sum += added.at(i));
        }
        for (path, (delay_s, &length_m)) in sum.iter().zip(paths.lengths_m()).enumerate() {
            if delay_s + f64::from(length_m) / speed_m_s < 0.0 {
                let place = Place { path: Some(path), band_hz: None };
                return Err(bound.law.error(None, LawFault::BeforeEmission(place)));
            }
        }
    }
    Ok(delays_s)
}

/// Energy per second that laws add at a time after the direct sound, relative to the direct sound at 1 m, under laws of the recorder.
pub(crate) struct AddedEnergy<'l> {
    added: Vec<&'l BoundLaw>,
    recorder: Vec<&'l BoundLaw>,
    first_s: f64,
}

impl<'l> AddedEnergy<'l> {
    /// The laws of added energy where the direct sound arrives `first_s` after the emission; `None` where there are none.
    pub fn new(laws: &'l BoundLaws, first_s: f64) -> Option<Self> {
        let added: Vec<&BoundLaw> = laws.of(LawTarget::Added).collect();
        (!added.is_empty()).then(|| Self { added, recorder: laws.of(LawTarget::Recorder).collect(), first_s })
    }

    /// Energy per second at a time after the direct sound.
    pub fn per_s(&self, time_after_direct_s: f64, band_hz: f64) -> Result<f64, LawError> {
        let place = Place { path: None, band_hz: Some(band_hz) };
        let variable = |op: Op| match op {
            Op::Variable(Variable::Frequency) => band_hz,
            Op::Variable(Variable::FileTime) => time_after_direct_s + self.first_s,
            _ => time_after_direct_s,
        };
        let level_db = |bound: &BoundLaw| {
            let db = bound.value(place, variable)?;
            check_gain(&bound.law, db, place)?;
            Ok::<f64, LawError>(db)
        };
        let mut energy = 0.0;
        for bound in &self.added {
            energy += 10f64.powf(level_db(bound)? / 10.0);
        }
        for bound in &self.recorder {
            energy *= 10f64.powf(level_db(bound)? / 10.0);
        }
        Ok(energy)
    }
}
