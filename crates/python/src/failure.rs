//! Errors of the library as exceptions of Python.

use pyo3::PyErr;
use pyo3::exceptions::PyValueError;
use std::error::Error;
use std::io;

/// An exception to be raised: one of Python's own as it is; `OSError`, or the kind of it that fits, where a file is at fault; else
/// `ValueError`. The message is the library's, which names file and field.
#[derive(Debug)]
pub struct Failure(PyErr);

impl<E: Error + Send + Sync + 'static> From<E> for Failure {
    fn from(error: E) -> Self {
        let error: Box<dyn Error + Send + Sync> = Box::new(error);
        match error.downcast::<PyErr>() {
            Ok(exception) => Self(*exception),
            Err(error) => Self(exception(error.as_ref())),
        }
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        failure.0
    }
}

/// A `ValueError` in words of this crate.
pub fn refused(message: impl Into<String>) -> Failure {
    Failure(PyValueError::new_err(message.into()))
}

fn exception(error: &(dyn Error + 'static)) -> PyErr {
    let mut causes = std::iter::successors(Some(error), |&error| error.source());
    let of_file = causes.find_map(|cause| cause.downcast_ref::<io::Error>());
    match of_file {
        Some(cause) => io::Error::new(cause.kind(), error.to_string()).into(),
        None => PyValueError::new_err(error.to_string()),
    }
}
