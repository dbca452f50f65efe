//! Extended models: rooms as diagnoses found them.

use crate::failure::Failure;
use pyo3::prelude::*;
use sabine::diagnose::ExtendedModel as Model;
use std::path::{Path, PathBuf};

/// The extended model of a file, or of text.
#[pyclass(frozen)]
pub struct ExtendedModel(Model);

#[pymethods]
impl ExtendedModel {
    /// That of a file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> Result<Self, Failure> {
        Ok(Self(py.detach(|| Model::read(path))?))
    }

    /// That of the text of a file.
    #[staticmethod]
    fn parse(text: &str) -> Result<Self, Failure> {
        Ok(Self(Model::from_toml(text, Path::new("model"))?))
    }
}

impl ExtendedModel {
    /// The model.
    pub fn model(&self) -> &Model {
        &self.0
    }
}
