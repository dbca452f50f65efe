//! Laws at work on paths.

use crate::laws::blocks::{BLOCK, Program, Slot};
use crate::laws::bound::{BoundLaw, BoundLaws};
use crate::laws::columns::Columns;
use crate::laws::error::{LawError, LawFault, Place};
use crate::laws::formula::Op;
use crate::laws::gain::{MAX_GAIN_DB, NEPERS_PER_DB, check_gain, nepers};
use crate::laws::law::Law;
use crate::laws::reflections::ReflectionTables;
use crate::laws::target::LawTarget;
use crate::laws::variable::Variable;
use crate::path_set::PathSet;
use crate::reweighting::{LANES, Lanes};
use sabine_acoustics::Bands;
use std::ops::Range;

/// Laws that act on the energy of paths, prepared for one set of them.
pub(crate) struct PathLaws<'l> {
    programs: Vec<Program<'l>>,
    columns: Columns<'l>,
    reflections: Option<ReflectionTables>,
    bands: Bands,
    last: &'l Law,
}

impl<'l> PathLaws<'l> {
    /// Prepares the laws; `None` where none acts on the energy of paths. What is recorded at a time is what arrives then, so that laws of the
    /// recorder act on paths by their time of arrival.
    pub fn new(
        laws: &'l BoundLaws,
        paths: &'l PathSet,
        speed_m_s: f64,
        bands: Bands,
    ) -> Result<Option<Self>, LawError> {
        let mut columns = Columns::new(paths, speed_m_s);
        let of_paths = laws.of(LawTarget::Path).chain(laws.of(LawTarget::Recorder));
        let programs = of_paths
            .map(|bound| Program::new(bound, bands, |op| columns.place_of(bound, op)))
            .collect::<Result<Vec<_>, _>>()?;
        let reflections = ReflectionTables::new(laws, paths, bands)?;
        let acting = laws.laws.last().filter(|_| reflections.is_some() || !programs.is_empty());
        Ok(acting.map(|last| Self { programs, columns, reflections, bands, last: &last.law }))
    }

    /// What the laws do in the bands from `first` on.
    pub fn in_bands(&self, paths: &PathSet, first: usize) -> LawLanes<'_> {
        let sums = self.reflections.as_ref().map(|tables| tables.sums(paths, first));
        let (along_chains, along_paths) = sums.unzip();
        LawLanes {
            laws: self,
            first,
            lanes: LANES.min(self.bands.len() - first),
            along_chains,
            along_paths: along_paths.flatten(),
            columns: self.columns.new_slots(),
            slots: self.programs.iter().map(Program::new_slots).collect(),
        }
    }
}

/// Laws at work in a few bands.
pub(crate) struct LawLanes<'l> {
    laws: &'l PathLaws<'l>,
    first: usize,
    lanes: usize,
    along_chains: Option<Vec<Lanes>>,
    along_paths: Option<Vec<Lanes>>,
    columns: Vec<Slot>,
    slots: Vec<Vec<Slot>>,
}

impl LawLanes<'_> {
    /// Adds what laws of reflections do along each chain.
    pub fn add_to_chains(&self, sums: &mut [Lanes]) {
        if let Some(added) = &self.along_chains {
            sums.iter_mut()
                .zip(added)
                .for_each(|(sum, added)| *sum = std::array::from_fn(|i| sum[i] + added[i]));
        }
    }

    /// Adds what laws do to the logarithm of the energy of some paths: at most [`BLOCK`].
    pub fn add_to_paths(&mut self, range: &Range<usize>, block: &mut [Lanes]) -> Result<(), LawError> {
        let count = range.len().min(BLOCK);
        if let Some(added) = &self.along_paths {
            let added = &added[range.clone()];
            block.iter_mut().zip(added).for_each(|(x, added)| *x = std::array::from_fn(|i| x[i] + added[i]));
        }
        self.laws.columns.fill(range, &mut self.columns);
        for (program, slots) in self.laws.programs.iter().zip(&mut self.slots) {
            program.run(&self.columns, slots, (range.start, count), (self.first, self.lanes))?;
            let (columns, slots) = (&self.columns, &*slots);
            let add = |lane: usize| {
                let mut greatest = f64::NEG_INFINITY;
                program.result(columns, slots, count, (self.first, lane), |i, db| {
                    greatest = greatest.max(db);
                    block[i][lane] += nepers(db) as f32;
                });
                let place =
                    Place { path: None, band_hz: Some(self.laws.bands.nominal_hz(self.first + lane)) };
                check_gain(&program.bound.law, greatest, place)
            };
            (0..self.lanes).try_for_each(add)?;
        }
        self.check_sum(range, &block[..count])
    }

    /// All laws together, and the geometric weight, leave the exponential in its range.
    fn check_sum(&self, range: &Range<usize>, block: &[Lanes]) -> Result<(), LawError> {
        let most = (MAX_GAIN_DB * NEPERS_PER_DB) as f32;
        let greatest = block.iter().flatten().fold(f32::NEG_INFINITY, |greatest, &x| greatest.max(x));
        if greatest <= most {
            return Ok(());
        }
        let path = block.iter().position(|x| x.contains(&greatest)).map(|i| range.start + i);
        let found_db = f64::from(greatest) / NEPERS_PER_DB;
        let place = Place { path, band_hz: None };
        Err(self.laws.last.error(None, LawFault::TooLoud { found_db, max_db: MAX_GAIN_DB, place }))
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
        let mut columns = Columns::new(paths, speed_m_s);
        let program = Program::new(bound, bands, |op| columns.place_of(bound, op))?;
        let (mut filled, mut slots) = (columns.new_slots(), program.new_slots());
        let sum = delays_s.get_or_insert_with(|| vec![0.0; paths.len()]);
        for start in (0..paths.len()).step_by(BLOCK) {
            let range = start..paths.len().min(start + BLOCK);
            columns.fill(&range, &mut filled);
            program.run(&filled, &mut slots, (start, range.len()), (0, 1))?;
            program.result(&filled, &slots, range.len(), (0, 0), |i, s| sum[start + i] += s);
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
