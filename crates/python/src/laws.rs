//! Laws: formulas that change what paths carry.

use crate::failure::Failure;
use pyo3::prelude::*;
use sabine::diagnose::{laws_of_toml, read_laws};
use sabine::paths::laws::Law;
use std::path::{Path, PathBuf};

/// Laws of a file, or of text.
#[pyclass(frozen)]
pub struct Laws(Vec<Law>);

#[pymethods]
impl Laws {
    /// Those of a file, or of all files `*.toml` of a folder.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> Result<Self, Failure> {
        Ok(Self(py.detach(|| read_laws(path))?))
    }

    /// Those of the text of a file.
    #[staticmethod]
    fn parse(text: &str) -> Result<Self, Failure> {
        Ok(Self(laws_of_toml(text, Path::new("laws"))?))
    }
}

impl Laws {
    /// The laws.
    pub fn laws(&self) -> &[Law] {
        &self.0
    }
}
