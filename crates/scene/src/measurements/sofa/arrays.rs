//! A SOFA file as netCDF-4 keeps it: text attributes and arrays of numbers, every size checked before memory is taken for it.

use crate::error::Error;
use hdf5_pure::{AttrValue, DType, Dataset, File};
use sabine_acoustics::{Error as ValueError, read_at_most};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Largest file that is read (bytes): it is held in memory.
const MAX_FILE_BYTES: u64 = 4 << 30;
/// Largest number of values of one array. Where addresses have 32 bits, as in a browser, an eighth of it: an allocation that fails
/// there ends everything.
const MAX_VALUES: u64 = if cfg!(target_pointer_width = "32") { 1 << 25 } else { 1 << 28 };
/// Deflate makes at most so many bytes of one (RFC 1951: 258 bytes of 2 bits); what claims more was never written.
const MAX_DEFLATE: u64 = 1040;
/// Largest number of dimensions of an array; SOFA has four.
const MAX_RANK: usize = 8;

/// An open file.
pub(super) struct SofaFile {
    path: PathBuf,
    file: File,
    bytes: u64,
    attributes: HashMap<String, AttrValue>,
}

/// An array of numbers; the last dimension is the fastest.
#[derive(Debug)]
pub(super) struct Array {
    pub shape: Vec<usize>,
    pub values: Vec<f64>,
}

impl SofaFile {
    pub(super) fn open(path: &Path) -> Result<Self, Error> {
        Self::of_bytes(path, read_at_most(path, MAX_FILE_BYTES + 1)?)
    }

    /// From the bytes of a file; `path` is its name in messages.
    pub(super) fn of_bytes(path: &Path, content: Vec<u8>) -> Result<Self, Error> {
        let bytes = content.len() as u64;
        if bytes > MAX_FILE_BYTES {
            let error = Error::TooManyValues { found: bytes, limit: MAX_FILE_BYTES };
            return Err(error.in_file(path, "bytes"));
        }
        let hdf5 = |source: hdf5_pure::Error| Error::Hdf5 { source: source.into() }.in_file(path, "HDF5");
        let file = File::from_bytes(content).map_err(hdf5)?;
        let attributes = file.root().attrs().map_err(hdf5)?;
        Ok(Self { path: path.to_owned(), file, bytes, attributes })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// A text attribute of the file.
    pub(super) fn attribute(&self, name: &str) -> Option<String> {
        self.attributes.get(name).and_then(text)
    }

    /// A text attribute of an array.
    pub(super) fn attribute_of(&self, variable: &str, name: &str) -> Result<Option<String>, Error> {
        let Some(dataset) = self.dataset(variable)? else { return Ok(None) };
        let attributes = dataset.attrs().map_err(|error| self.hdf5(error, variable))?;
        Ok(attributes.get(name).and_then(text))
    }

    /// An array of numbers, if the file has it.
    ///
    /// # Errors
    /// [`Error::Hdf5`], [`Error::Shape`], [`Error::TooManyValues`], [`sabine_acoustics::Error::NotFinite`]; each names the array.
    pub(super) fn numbers(&self, name: &str) -> Result<Option<Array>, Error> {
        let Some(dataset) = self.dataset(name)? else { return Ok(None) };
        let shape = self.shape(&dataset, name)?;
        let numeric = matches!(
            dataset.dtype().map_err(|error| self.hdf5(error, name))?,
            DType::F64
                | DType::F32
                | DType::I8
                | DType::I16
                | DType::I32
                | DType::I64
                | DType::U8
                | DType::U16
                | DType::U32
                | DType::U64
        );
        if !numeric {
            let error = Error::Unit { found: "text or records".into(), expected: "numbers" };
            return Err(error.in_file(&self.path, name));
        }
        let values = dataset.read_f64().map_err(|error| self.hdf5(error, name))?;
        let expected: usize = shape.iter().product();
        if values.len() != expected {
            let error = ValueError::Length { expected, found: values.len() };
            return Err(Error::from(error).in_file(&self.path, name));
        }
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            let error = ValueError::NotFinite { what: "array", index };
            return Err(Error::from(error).in_file(&self.path, name));
        }
        Ok(Some(Array { shape, values }))
    }

    /// An array that must be there.
    pub(super) fn needed(&self, name: &str) -> Result<Array, Error> {
        self.numbers(name)?.ok_or_else(|| Error::Missing.in_file(&self.path, name))
    }

    fn dataset(&self, name: &str) -> Result<Option<Dataset>, Error> {
        let listed = self.file.root().datasets().map_err(|error| self.hdf5(error, "root"))?;
        if !listed.iter().any(|other| other == name) {
            return Ok(None);
        }
        self.file.dataset(name).map(Some).map_err(|error| self.hdf5(error, name))
    }

    /// The shape, once it is clear that the array can be read in bounded memory.
    fn shape(&self, dataset: &Dataset, name: &str) -> Result<Vec<usize>, Error> {
        let shape = dataset.shape().map_err(|error| self.hdf5(error, name))?;
        if shape.is_empty() || shape.len() > MAX_RANK || shape.contains(&0) {
            let expected = format!("1 to {MAX_RANK} dimensions, none of them empty");
            return Err(Error::Shape { expected, found: format!("{shape:?}") }.in_file(&self.path, name));
        }
        let product = |lengths: &[u64]| lengths.iter().try_fold(1u64, |product, &n| product.checked_mul(n));
        // A chunk is unpacked whole, however little of it lies within the array.
        let chunk = dataset.chunk_shape().map_err(|error| self.hdf5(error, name))?.unwrap_or_default();
        let found = product(&shape).unwrap_or(u64::MAX).max(product(&chunk).unwrap_or(u64::MAX));
        let limit = MAX_VALUES.min(self.bytes.saturating_mul(MAX_DEFLATE));
        if found > limit {
            return Err(Error::TooManyValues { found, limit }.in_file(&self.path, name));
        }
        Ok(shape.into_iter().map(|length| length as usize).collect())
    }

    fn hdf5(&self, source: hdf5_pure::Error, field: &str) -> Error {
        Error::Hdf5 { source: source.into() }.in_file(&self.path, field)
    }
}

/// Text as writers keep it: of fixed or variable length, alone or the only element of a list.
fn text(value: &AttrValue) -> Option<String> {
    use AttrValue as A;
    let found = match value {
        A::String(text) | A::AsciiString(text) | A::VarLenString(text) | A::VarLenAsciiString(text) => text,
        A::StringSized { value, .. } | A::AsciiStringSized { value, .. } => value,
        A::StringArray(list)
        | A::AsciiStringArray(list)
        | A::VarLenStringArray(list)
        | A::VarLenAsciiStringArray(list) => match list.as_slice() {
            [only] => only,
            _ => return None,
        },
        _ => return None,
    };
    Some(found.trim_end_matches(['\0', ' ']).to_owned())
}
