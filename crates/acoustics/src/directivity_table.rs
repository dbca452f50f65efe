//! Directivities given by numbers: magnitudes of pressure at nodes, linear in between.

use crate::error::Error;
use crate::out_of_range::OutOfRange;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Up to four nodes and their weights.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Stencil {
    nodes: [u32; 4],
    weights: [f64; 4],
}

impl Stencil {
    fn sum(&self, magnitudes: &[f64]) -> f64 {
        self.nodes.iter().zip(self.weights).map(|(&node, weight)| weight * magnitudes[node as usize]).sum()
    }
}

/// Magnitudes of one band, from levels in dB.
fn magnitudes(levels_db: &[f64], expected: usize) -> Result<Vec<f64>, Error> {
    if levels_db.len() != expected {
        return Err(Error::Length { expected, found: levels_db.len() });
    }
    levels_db
        .iter()
        .map(|&level| {
            OutOfRange::check("level (dB)", level, f64::NEG_INFINITY, 300.0, "minus infinity to 300 dB")?;
            Ok(10f64.powf(0.05 * level))
        })
        .collect()
}

/// Divides by the magnitude on the axis.
fn normalised(mut magnitudes: Vec<f64>, on_axis: &Stencil) -> Result<Vec<f64>, Error> {
    let reference = on_axis.sum(&magnitudes);
    OutOfRange::check("pressure on the axis", reference, 1e-15, 1e15, "not silent")?;
    magnitudes.iter_mut().for_each(|m| *m /= reference);
    Ok(magnitudes)
}

/// Over the angle to the axis.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AngleTable {
    angles: Vec<f64>,
    bands: Vec<Vec<f64>>,
}

impl AngleTable {
    pub(crate) fn new(angles_deg: &[f64], levels_db: &[Vec<f64>]) -> Result<Self, Error> {
        let (first, last) = (angles_deg.first().copied(), angles_deg.last().copied());
        OutOfRange::check("first angle (degrees)", first.unwrap_or(f64::NAN), 0.0, 0.0, "0")?;
        OutOfRange::check("last angle (degrees)", last.unwrap_or(f64::NAN), 180.0, 180.0, "180")?;
        for pair in angles_deg.windows(2) {
            OutOfRange::check("step between angles (degrees)", pair[1] - pair[0], 1e-6, 180.0, "positive")?;
        }
        let table = Self { angles: angles_deg.iter().map(|a| a.to_radians()).collect(), bands: Vec::new() };
        let on_axis = table.stencil([1.0, 0.0, 0.0]);
        let band = |levels: &Vec<f64>| normalised(magnitudes(levels, angles_deg.len())?, &on_axis);
        Ok(Self { bands: levels_db.iter().map(band).collect::<Result<_, Error>>()?, ..table })
    }

    pub(crate) fn stencil(&self, [x, y, z]: [f64; 3]) -> Stencil {
        let angle = y.hypot(z).atan2(x);
        let upper = self.angles.partition_point(|&a| a < angle).clamp(1, self.angles.len() - 1);
        let (from, to) = (self.angles[upper - 1], self.angles[upper]);
        let share = ((angle - from) / (to - from)).clamp(0.0, 1.0);
        Stencil { nodes: [upper as u32 - 1, upper as u32, 0, 0], weights: [1.0 - share, share, 0.0, 0.0] }
    }

    pub(crate) fn magnitude(&self, stencil: &Stencil, band: usize) -> f64 {
        stencil.sum(&self.bands[band])
    }

    pub(crate) fn picked(&self, bands: &[usize]) -> Self {
        Self { angles: self.angles.clone(), bands: bands.iter().map(|&b| self.bands[b].clone()).collect() }
    }
}

/// Over azimuth and elevation.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SphereTable {
    azimuths: usize,
    elevations: usize,
    bands: Vec<Vec<f64>>,
}

impl SphereTable {
    pub(crate) fn new(azimuths: usize, elevations: usize, levels_db: &[Vec<f64>]) -> Result<Self, Error> {
        OutOfRange::check("number of azimuths", azimuths as f64, 3.0, 3600.0, "between 3 and 3600")?;
        OutOfRange::check("number of elevations", elevations as f64, 3.0, 1801.0, "between 3 and 1801")?;
        let table = Self { azimuths, elevations, bands: Vec::new() };
        let on_axis = table.stencil([1.0, 0.0, 0.0]);
        let band = |levels: &Vec<f64>| {
            let mut magnitudes = magnitudes(levels, azimuths * elevations)?;
            for row in [0, elevations - 1] {
                let pole = &mut magnitudes[row * azimuths..][..azimuths];
                let mean = pole.iter().sum::<f64>() / azimuths as f64;
                pole.fill(mean);
            }
            normalised(magnitudes, &on_axis)
        };
        Ok(Self { bands: levels_db.iter().map(band).collect::<Result<_, Error>>()?, ..table })
    }

    pub(crate) fn stencil(&self, [x, y, z]: [f64; 3]) -> Stencil {
        let column = (y.atan2(x) / TAU).rem_euclid(1.0) * self.azimuths as f64;
        let row = (z.atan2(x.hypot(y)) + FRAC_PI_2) / PI * (self.elevations - 1) as f64;
        // Rounding may reach the seam from below.
        let (left, low) = (column as usize % self.azimuths, (row as usize).min(self.elevations - 2));
        let right = (left + 1) % self.azimuths;
        let (across, up) = (column - column.floor(), (row - low as f64).clamp(0.0, 1.0));
        let node = |row: usize, column: usize| (row * self.azimuths + column) as u32;
        Stencil {
            nodes: [node(low, left), node(low, right), node(low + 1, left), node(low + 1, right)],
            weights: [(1.0 - up) * (1.0 - across), (1.0 - up) * across, up * (1.0 - across), up * across],
        }
    }

    pub(crate) fn magnitude(&self, stencil: &Stencil, band: usize) -> f64 {
        stencil.sum(&self.bands[band])
    }

    pub(crate) fn picked(&self, bands: &[usize]) -> Self {
        let picked = bands.iter().map(|&b| self.bands[b].clone()).collect();
        Self { azimuths: self.azimuths, elevations: self.elevations, bands: picked }
    }
}
