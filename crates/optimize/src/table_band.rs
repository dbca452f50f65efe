//! The parameters of one pair that a table holds in one band, and the paths that are to give them.

use crate::MeasuredParameter;
use crate::expansion::Bins;
use crate::history::{History, Traces};
use crate::parameter_readings::{reading, scaled, scaled_sd};
use crate::response_spread::scatter;
use nalgebra::{DMatrix, DVector};
use sabine_acoustics::{Bands, NoReading, ParameterKind};
use sabine_paths::PathSet;

/// Batches of rays, and one place more for the exact paths.
const PARTS: usize = PathSet::BATCHES as usize + 1;

/// What a table says of a pair in a band.
pub(crate) struct TableBand<'a> {
    /// One trace, counted from the first arrival.
    pub traces: Traces<&'a History>,
    pub values: Vec<TableValue>,
    /// Width of the band in Hz: 1 / (width x duration) is the relative variance of the energy of a diffuse field.
    pub width_hz: f64,
}

/// A measured value on the scale of the fit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TableValue {
    /// Its place in the pair's list.
    pub place: usize,
    pub kind: ParameterKind,
    pub measured: f64,
    /// What is not known of it, whatever the paths say.
    pub sd: f64,
}

impl TableValue {
    /// A measured value: its stated error, or else one just-noticeable difference.
    pub fn of(place: usize, measured: &MeasuredParameter) -> Self {
        let kind = measured.kind;
        Self {
            place,
            kind,
            measured: scaled(kind, measured.value),
            sd: scaled_sd(kind, measured.value, measured.sd()),
        }
    }
}

/// What paths give for the values of a table, and how far chance puts a measurement from it.
pub(crate) struct TableReadings {
    /// On the scale of the fit.
    pub predicted: DVector<f64>,
    /// Covariance by the measurement and by the interference of arrivals.
    pub chance: DMatrix<f64>,
    /// What each batch of rays adds to the predictions, to first order.
    pub parts: Vec<DVector<f64>>,
}

impl<'a> TableBand<'a> {
    /// The values that a table holds in the band, less those that follow from others.
    pub fn new(
        list: &[MeasuredParameter],
        (bands, band): (Bands, usize),
        (history, weights): (&'a History, Vec<f32>),
    ) -> Self {
        let here: Vec<(usize, &MeasuredParameter)> =
            list.iter().enumerate().filter(|(_, p)| bands.index_of(p.band_hz) == Some(band)).collect();
        let stated = |kind| here.iter().any(|(_, p)| p.kind == kind);
        // D50 is a function of C50: together they are one value.
        let follows = |kind: ParameterKind| kind == ParameterKind::D50 && stated(ParameterKind::C50);
        let of = |(place, p): &(usize, &MeasuredParameter)| TableValue::of(*place, p);
        let values = here.iter().filter(|(_, p)| !follows(p.kind)).map(of).collect();
        let (lower_hz, upper_hz) = bands.edges_hz(band);
        Self { traces: vec![(history, weights)], values, width_hz: upper_hz - lower_hz }
    }

    /// Leaves out what the paths cannot give at an absorption, and says why: pairs of place and reason.
    pub fn leave_unreadable(&mut self, absorption: &[f64]) -> Vec<(usize, NoReading)> {
        let bins = Bins::of(&self.traces, absorption);
        let (can, cannot): (Vec<TableValue>, Vec<TableValue>) =
            self.values.iter().partition(|value| reading(value.kind, &bins.energy, bins.bin_s).is_some());
        self.values = can;
        cannot.iter().map(|value| (value.place, NoReading::NoDecay)).collect()
    }

    /// Reads the paths at an absorption. `None` where a value cannot be read.
    ///
    /// Interference: arrivals of random phase make the energy of a stretch of a band-limited response random. Within 1 / width of each other
    /// all interfere: its variance is there that of the sum of phasors, (sum e)^2 - sum e^2, the squares being those of the exact paths, of
    /// which each is one arrival (a ray stands for many); over longer stretches it falls as 1 / (width x duration), that of a diffuse field
    /// (Davy, Dunn, Dubout 1979; Kuttruff, Room Acoustics, 3.4). A parameter's variance follows from its derivative by the
    /// energies. An exact path is known to a relative standard deviation of `path_error`.
    pub fn readings(&self, absorption: &[f64], path_error: f64) -> Option<TableReadings> {
        let (history, weights) = &self.traces[0];
        let by_batch = history.batch_energies(weights, absorption);
        let energy: Vec<f64> = by_batch.energy.chunks_exact(PARTS).map(|bin| bin.iter().sum()).collect();
        let bin_s = history.bin_s;
        let read: Vec<(f64, Vec<f64>)> =
            self.values.iter().map(|value| reading(value.kind, &energy, bin_s)).collect::<Option<_>>()?;
        let n = read.len();
        let mut chance = DMatrix::<f64>::zeros(n, n);
        for (i, value) in self.values.iter().enumerate() {
            chance[(i, i)] = value.sd * value.sd;
        }
        let mut add = |variance: f64, slopes: DVector<f64>| chance += &slopes * slopes.transpose() * variance;
        let cell = ((1.0 / (self.width_hz * bin_s)).round() as usize).max(1);
        let independent = (self.width_hz * bin_s * cell as f64).max(1.0);
        for first in (0..energy.len()).step_by(cell) {
            let bins = first..(first + cell).min(energy.len());
            let whole: f64 = energy[bins.clone()].iter().sum();
            if whole <= 0.0 {
                continue;
            }
            let squares: f64 = by_batch.exact_squares[bins.clone()].iter().sum();
            let mean = |by: &Vec<f64>| bins.clone().map(|j| by[j] * energy[j]).sum::<f64>() / whole;
            let variance = (whole * whole - squares).max(0.0) / independent;
            add(variance, DVector::from_iterator(n, read.iter().map(|(_, by)| mean(by))));
        }
        for (j, squares) in by_batch.exact_squares.iter().enumerate().filter(|(_, s)| **s > 0.0) {
            let slopes = DVector::from_iterator(n, read.iter().map(|(_, by)| by[j]));
            add(path_error * path_error * squares, slopes);
        }
        let part = |batch: usize| {
            let of = |(_, by): &(f64, Vec<f64>)| -> f64 {
                by.iter().enumerate().map(|(j, b)| b * by_batch.energy[j * PARTS + batch]).sum()
            };
            DVector::from_iterator(n, read.iter().map(of))
        };
        Some(TableReadings {
            predicted: DVector::from_iterator(n, read.iter().map(|(value, _)| *value)),
            parts: (0..history.batch_count).map(part).collect(),
            chance,
        })
    }
}

impl TableReadings {
    /// Covariance of the predictions by the rays: the scatter of their batches.
    pub fn rays(&self) -> DMatrix<f64> {
        scatter(&self.parts, self.predicted.len())
    }

    /// Inverse covariance of measured less predicted.
    pub fn weight(&self) -> DMatrix<f64> {
        let n = self.predicted.len();
        // Positive definite: every value has a variance of its own.
        (&self.chance + self.rays()).try_inverse().unwrap_or_else(|| DMatrix::identity(n, n))
    }
}
