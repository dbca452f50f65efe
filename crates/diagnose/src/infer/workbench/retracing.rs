//! What becomes of everything traced when a place, the air or the room turns out to be another.

use super::Workbench;
use crate::effect::Nuisance;
use crate::error::Error;
use crate::extend::extended_model::Dimensions;
use crate::simulate::edges::Edges;
use crate::simulate::traced_pair::TracedPair;
use sabine_acoustics::Air;

impl Workbench {
    /// Traces the pairs of a source or receiver anew from where it was found to stand: levels of early reflections change with it.
    /// Arrival times stay relative to the stated place.
    pub fn move_place(&mut self, place: Nuisance, offset_m: [f64; 3]) -> Result<(), Error> {
        let moved = |position: [f64; 3]| std::array::from_fn(|k| position[k] + offset_m[k]);
        match place {
            Nuisance::SourcePosition(i) => {
                self.sources[i].position_m = moved(self.survey.sources[i].position_m)
            }
            Nuisance::ReceiverPosition(i) => {
                self.receivers[i].position_m = moved(self.survey.receivers[i].position_m);
            }
            Nuisance::Absorption(_) | Nuisance::ResponseGain(_) => return Ok(()),
        }
        self.retrace(place)?;
        self.expand(true)
    }

    /// Takes all paths at another temperature. Arrival times stay relative to the stated one.
    pub fn warm(&mut self, kelvin: f64) -> Result<(), Error> {
        self.warmer_k = kelvin;
        for pair in 0..self.pairs.len() {
            self.set_air(pair)?;
        }
        self.expand(true)
    }

    /// Traces everything anew in a room of another size. Arrival times stay relative to the stated one.
    pub fn resize(&mut self, dimensions: &Dimensions) -> Result<(), Error> {
        let resized = dimensions.applied(&self.scene)?;
        self.prepared = self.tracer.prepare(&resized)?;
        self.edges = Edges::find(&resized)?;
        self.resized = Some(resized);
        for source in 0..self.sources.len() {
            self.retrace(Nuisance::SourcePosition(source))?;
        }
        self.expand(true)
    }

    /// Traces the pairs of a place anew, as far as it lies in the room: the stated place is as good as one that is none.
    fn retrace(&mut self, place: Nuisance) -> Result<(), Error> {
        for pair in 0..self.survey.responses.len() {
            let response = &self.survey.responses[pair];
            let concerned = place == Nuisance::SourcePosition(response.source)
                || place == Nuisance::ReceiverPosition(response.receiver);
            if !concerned {
                continue;
            }
            let ends = (&self.sources[response.source], &self.receivers[response.receiver]);
            if let Ok(paths) = self.tracer.trace_prepared(&self.prepared, ends.0, ends.1, &response.air, &())
            {
                let places_m = [ends.0.position_m, ends.1.position_m];
                let diffracted = Edges::paths(self.edges.as_ref(), places_m, paths.max_length_m());
                self.pairs[pair] = TracedPair::new(paths, diffracted, response.air, &self.materials)?;
                self.direct_s[pair] = self.pairs[pair].direct_s;
                self.set_air(pair)?;
            }
        }
        Ok(())
    }

    /// The air of a pair, as it was found.
    fn set_air(&mut self, pair: usize) -> Result<(), Error> {
        if self.warmer_k == 0.0 {
            return Ok(());
        }
        let stated = self.survey.responses[pair].air;
        let temperature_c = (stated.temperature_c() + self.warmer_k).clamp(-40.0, 60.0);
        let air = Air::new(temperature_c, stated.relative_humidity_percent(), stated.pressure_kpa())?;
        self.pairs[pair].set_air(air);
        self.direct_s[pair] = self.pairs[pair].direct_s;
        Ok(())
    }
}
