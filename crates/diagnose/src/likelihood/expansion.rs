//! What a measurement would say, expanded to first order about some values: normal bins (or arrival times), some of whose errors they
//! share.

use nalgebra::{DMatrix, DVector};

/// The data of one response, expanded about some values of a model.
#[derive(Clone, Debug)]
pub(crate) struct Expansion {
    /// Prediction of each datum: the logarithm of a bin's energy, or a time in seconds.
    pub predicted: DVector<f64>,
    /// Its change with each parameter of the model, `(datum, parameter)`.
    pub slopes: DMatrix<f64>,
    /// One over the variance that each datum has by itself.
    pub weights: DVector<f64>,
    /// What a standard normal deviate moves each datum by, `(datum, deviate)`: errors that the data share.
    pub shared: DMatrix<f64>,
}

impl Expansion {
    /// The same with a parameter, known within `sd`, as an error that the data share: it is this response's own.
    pub fn owning(&mut self, parameter: usize, sd: f64) {
        let moved = self.slopes.column(parameter) * sd;
        self.slopes.column_mut(parameter).fill(0.0);
        let place = self.shared.ncols();
        self.shared = std::mem::take(&mut self.shared).insert_column(place, 0.0);
        self.shared.set_column(place, &moved);
    }

    /// Columns `(datum, column)` over the covariance V of the data: V^-1 X (Woodbury 1950: what is shared is taken
    /// off what the data say one by one).
    pub fn over_covariance(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let weighted = |m: &DMatrix<f64>| {
            let mut out = m.clone();
            out.column_iter_mut().for_each(|mut column| column.component_mul_assign(&self.weights));
            out
        };
        let weighted_shared = weighted(&self.shared);
        let among = DMatrix::identity(self.shared.ncols(), self.shared.ncols())
            + self.shared.tr_mul(&weighted_shared);
        let onto = weighted_shared.tr_mul(columns);
        match among.cholesky() {
            Some(factor) => weighted(columns) - weighted_shared * factor.solve(&onto),
            // The identity and a square: it has a factor unless a figure is none.
            None => DMatrix::from_element(columns.nrows(), columns.ncols(), f64::NAN),
        }
    }

    /// Products of columns `(datum, column)` over the covariance V of the data: X' V^-1 X.
    pub fn products(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        columns.tr_mul(&self.over_covariance(columns))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a panic is how a test fails
    use super::*;

    #[test]
    fn products_are_those_over_the_whole_covariance() {
        let mut one = Expansion {
            predicted: DVector::zeros(4),
            slopes: DMatrix::from_fn(4, 2, |i, j| (1.3 * i as f64 + 0.7 * j as f64).sin()),
            weights: DVector::from_vec(vec![2.0, 5.0, 1.0, 0.5]),
            shared: DMatrix::from_fn(4, 1, |i, _| 0.3 + 0.1 * i as f64),
        };
        let columns = DMatrix::from_fn(4, 3, |i, j| (i as f64 - 1.2 * j as f64).cos());
        let gain = one.slopes.column(1) * 0.8;
        let covariance = DMatrix::from_diagonal(&one.weights.map(|w| 1.0 / w))
            + &one.shared * one.shared.transpose()
            + &gain * gain.transpose();
        one.owning(1, 0.8);
        assert!(one.slopes.column(1).amax() == 0.0);
        let expected = covariance.try_inverse().unwrap() * &columns;
        assert!((one.over_covariance(&columns) - &expected).amax() < 1e-12);
        assert!((one.products(&columns) - columns.transpose() * expected).amax() < 1e-12);
    }
}
