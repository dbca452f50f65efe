//! Re-tracing after a position, the air or the dimensions change.

use super::Simulation;
use crate::effect::Nuisance;
use crate::error::Error;
use crate::extend::model_change::ModelChange;
use crate::simulate::edges::Edges;
use crate::simulate::traced_pair::TracedPair;
use crate::survey::Survey;
use sabine_acoustics::Air;

impl Simulation {
    /// Takes a change into all paths that it moves, and says whether there are any. Energies follow with the next expansion; arrival times
    /// stay relative to what is stated.
    pub fn apply(&mut self, change: &ModelChange, survey: &Survey) -> Result<bool, Error> {
        match change {
            ModelChange::Position { id, position_m } => {
                if let Some(i) = self.sources.iter().position(|s| s.id == *id) {
                    self.sources[i].position_m = *position_m;
                    self.retrace(Nuisance::SourcePosition(i), survey)?;
                } else if let Some(i) = self.receivers.iter().position(|r| r.id == *id) {
                    self.receivers[i].position_m = *position_m;
                    self.retrace(Nuisance::ReceiverPosition(i), survey)?;
                }
            }
            ModelChange::Temperature(celsius) => {
                let warmer_k = celsius - survey.air.temperature_c();
                if warmer_k == 0.0 {
                    return Ok(false);
                }
                self.warmer_k = warmer_k;
                (0..self.pairs.len()).try_for_each(|pair| self.set_air(pair, survey))?;
            }
            ModelChange::Dimensions(dimensions) => {
                let resized = dimensions.applied(&self.scene)?;
                self.prepared = self.tracer.prepare(&resized, self.traced_until_s)?;
                self.edges = Edges::find(&resized)?;
                self.resized = Some(resized);
                for source in 0..self.sources.len() {
                    self.retrace(Nuisance::SourcePosition(source), survey)?;
                }
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Traces the pairs of a place again. If the fitted position lies outside the room, the paths from the stated one are kept.
    fn retrace(&mut self, place: Nuisance, survey: &Survey) -> Result<(), Error> {
        for pair in 0..survey.responses.len() {
            let response = &survey.responses[pair];
            let concerned = place == Nuisance::SourcePosition(response.source)
                || place == Nuisance::ReceiverPosition(response.receiver);
            if !concerned {
                continue;
            }
            let ends = (&self.sources[response.source], &self.receivers[response.receiver]);
            if let Ok(paths) = self.prepared.trace(ends.0, ends.1, &response.air) {
                let places_m = [ends.0.position_m, ends.1.position_m];
                let diffracted = Edges::paths(self.edges.as_ref(), places_m, paths.max_length_m());
                self.pairs[pair] = TracedPair::new(paths, diffracted, response.air, &self.materials)?;
                self.direct_s[pair] = self.pairs[pair].direct_s;
                self.set_air(pair, survey)?;
            }
        }
        Ok(())
    }

    /// The air of a pair, as it was found.
    fn set_air(&mut self, pair: usize, survey: &Survey) -> Result<(), Error> {
        if self.warmer_k == 0.0 {
            return Ok(());
        }
        let stated = survey.responses[pair].air;
        let temperature_c = (stated.temperature_c() + self.warmer_k).clamp(-40.0, 60.0);
        let air = Air::new(temperature_c, stated.relative_humidity_percent(), stated.pressure_kpa())?;
        self.pairs[pair].set_air(air);
        self.direct_s[pair] = self.pairs[pair].direct_s;
        Ok(())
    }
}
