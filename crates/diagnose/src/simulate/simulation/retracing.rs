//! Re-tracing after a position, the air or the dimensions change.

use super::Simulation;
use crate::effect::Nuisance;
use crate::error::Error;
use crate::extend::extended_model::Dimensions;
use crate::simulate::edges::Edges;
use crate::simulate::traced_pair::TracedPair;
use crate::survey::Survey;
use sabine_acoustics::Air;

/// A change that moves paths. Arrival times stay relative to what is stated.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Retracing {
    /// A source or receiver stands so many metres off along each axis.
    Position(Nuisance, [f64; 3]),
    /// The air is so many kelvin warmer.
    Warmer(f64),
    /// The room has another size.
    Dimensions(Dimensions),
}

impl Simulation {
    /// Takes the change into all paths that it concerns. Energies follow with the next expansion.
    pub fn apply(&mut self, change: &Retracing, survey: &Survey) -> Result<(), Error> {
        let moved = |position: [f64; 3], by: &[f64; 3]| std::array::from_fn(|k| position[k] + by[k]);
        match change {
            Retracing::Position(place, offset_m) => {
                match *place {
                    Nuisance::SourcePosition(i) => {
                        self.sources[i].position_m = moved(survey.sources[i].position_m, offset_m);
                    }
                    Nuisance::ReceiverPosition(i) => {
                        self.receivers[i].position_m = moved(survey.receivers[i].position_m, offset_m);
                    }
                    Nuisance::Absorption(_) | Nuisance::ResponseGain(_) => return Ok(()),
                }
                self.retrace(*place, survey)
            }
            Retracing::Warmer(kelvin) => {
                self.warmer_k = *kelvin;
                (0..self.pairs.len()).try_for_each(|pair| self.set_air(pair, survey))
            }
            Retracing::Dimensions(dimensions) => {
                let resized = dimensions.applied(&self.scene)?;
                self.prepared = self.tracer.prepare(&resized, self.traced_until_s)?;
                self.edges = Edges::find(&resized)?;
                self.resized = Some(resized);
                (0..self.sources.len())
                    .try_for_each(|source| self.retrace(Nuisance::SourcePosition(source), survey))
            }
        }
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
