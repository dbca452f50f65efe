//! Where the numbers of a glTF file lie, and how they are read from there.

use super::item;
use crate::error::Error;
use crate::inside_folder::check_inside;
use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Root, buffer::Buffer};
use sabine_acoustics::{Error as ValueError, read_at_most};
use std::borrow::Cow;
use std::path::Path;

/// Bytes of all buffers of a file: many may name the same large one.
const MOST_BYTES: u64 = 4 << 30;
/// Elements of an accessor that has only a sparse part: the others are zero and cost the file nothing.
const MOST_ABSENT: u64 = 1_000_000;

/// The buffers of a file, in memory, none shorter than it claims to be.
pub(super) struct Buffers<'a>(Vec<Cow<'a, [u8]>>);

impl<'a> Buffers<'a> {
    /// Takes buffers from the file (`blob`: the binary part of a GLB), from its text or from files beside it, which must lie
    /// below `folder`, if one is named.
    pub fn load(
        path: &Path,
        root: &Root,
        blob: Option<&'a [u8]>,
        folder: Option<&Path>,
    ) -> Result<Self, Error> {
        let mut total = 0u64;
        let mut buffers = Vec::with_capacity(root.buffers.len());
        for (i, buffer) in root.buffers.iter().enumerate() {
            let field = || format!("buffers[{i}]");
            total = super::within("bytes of buffers", total, buffer.byte_length.0, MOST_BYTES)
                .map_err(|e| e.in_file(path, field()))?;
            let bytes = match (&buffer.uri, blob) {
                (None, Some(blob)) if i == 0 => Cow::Borrowed(blob),
                _ => Cow::Owned(fetch(path, buffer, folder).map_err(|e| e.in_file(path, field()))?),
            };
            let (needed_bytes, found_bytes) = (buffer.byte_length.0, bytes.len() as u64);
            if found_bytes < needed_bytes {
                return Err(Error::BeyondBuffer { needed_bytes, found_bytes }.in_file(path, field()));
            }
            buffers.push(bytes);
        }
        Ok(Self(buffers))
    }

    /// Points of an accessor, checked.
    pub fn positions(&self, root: &Root, index: usize) -> Result<Vec<[f32; 3]>, Error> {
        let accessor = item("accessor", &root.accessors, index)?;
        match (kind(accessor), &accessor.type_) {
            (Some(ComponentType::F32), Checked::Valid(Type::Vec3)) => {}
            _ => return Err(unsupported(index, "positions of three 32-bit floats")),
        }
        let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        self.elements(root, accessor, 12, &|b| [float(b), float(&b[4..]), float(&b[8..])])
    }

    /// Whole numbers of an accessor, checked.
    pub fn indices(&self, root: &Root, index: usize) -> Result<Vec<u32>, Error> {
        let accessor = item("accessor", &root.accessors, index)?;
        let scalar = matches!(accessor.type_, Checked::Valid(Type::Scalar));
        match kind(accessor).filter(|_| scalar).and_then(whole) {
            Some((size, read)) => self.elements(root, accessor, size, &read),
            None => Err(unsupported(index, "indices of 8, 16 or 32 bits without sign")),
        }
    }

    /// The numbers of an accessor, those of its sparse part put in their places.
    fn elements<T: Copy + Default>(
        &self,
        root: &Root,
        accessor: &Accessor,
        size: u64,
        read: &dyn Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, Error> {
        let count = accessor.count.0;
        let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
        let mut elements: Vec<T> = match accessor.buffer_view {
            Some(view) => self.slices(root, view.value(), offset, count, size)?.map(read).collect(),
            None if accessor.sparse.is_some() => {
                super::within("elements that are not in the file", 0, count, MOST_ABSENT)?;
                vec![T::default(); count as usize]
            }
            None => return Err(ValueError::Empty { what: "bufferView of the accessor" }.into()),
        };
        if let Some(sparse) = &accessor.sparse {
            let (places, values) = (&sparse.indices, &sparse.values);
            let kind = match places.component_type {
                Checked::Valid(kind) => whole(kind.0),
                Checked::Invalid => None,
            };
            let expected = "sparse indices of 8, 16 or 32 bits without sign";
            let (place_size, place) =
                kind.ok_or(Error::UnsupportedMesh { found: "componentType".into(), expected })?;
            let places = self.slices(
                root,
                places.buffer_view.value(),
                places.byte_offset.0,
                sparse.count.0,
                place_size,
            )?;
            let values =
                self.slices(root, values.buffer_view.value(), values.byte_offset.0, sparse.count.0, size)?;
            for (index, value) in places.map(place).zip(values) {
                let index = index as usize;
                let element = elements.get_mut(index).ok_or(ValueError::Index {
                    what: "sparse element",
                    index,
                    count: count as usize,
                })?;
                *element = read(value);
            }
        }
        Ok(elements)
    }

    /// `count` pieces of `size` bytes within a view, all of which are there.
    fn slices(
        &self,
        root: &Root,
        view: usize,
        offset: u64,
        count: u64,
        size: u64,
    ) -> Result<impl Iterator<Item = &[u8]>, Error> {
        let view = item("bufferView", &root.buffer_views, view)?;
        let buffer = item("buffer", &self.0, view.buffer.value())?;
        let stride = view.byte_stride.map_or(size, |stride| stride.0 as u64);
        if stride < size {
            let expected = "strides of at least an element";
            return Err(Error::UnsupportedMesh { found: format!("byteStride {stride}"), expected });
        }
        // In 128 bits nothing overflows.
        let [start, length] = [view.byte_offset.map_or(0, |o| o.0), view.byte_length.0].map(u128::from);
        let end = match count {
            0 => u128::from(offset),
            n => u128::from(offset) + u128::from(n - 1) * u128::from(stride) + u128::from(size),
        };
        let found = length.min((buffer.len() as u128).saturating_sub(start));
        if end > found {
            let [needed_bytes, found_bytes] = [end, found].map(|n| u64::try_from(n).unwrap_or(u64::MAX));
            return Err(Error::BeyondBuffer { needed_bytes, found_bytes });
        }
        let first = (start + u128::from(offset)) as usize;
        let (size, stride) = (size as usize, stride as usize);
        Ok((0..count as usize).map(move |i| &buffer[first + i * stride..][..size]))
    }
}

fn kind(accessor: &Accessor) -> Option<ComponentType> {
    match accessor.component_type {
        Checked::Valid(kind) => Some(kind.0),
        Checked::Invalid => None,
    }
}

/// Reads a number from its bytes.
type Number = fn(&[u8]) -> u32;

/// Size in bytes and reader of a whole number.
fn whole(kind: ComponentType) -> Option<(u64, Number)> {
    match kind {
        ComponentType::U8 => Some((1, |b| u32::from(b[0]))),
        ComponentType::U16 => Some((2, |b| u32::from(u16::from_le_bytes([b[0], b[1]])))),
        ComponentType::U32 => Some((4, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
        _ => None,
    }
}

fn unsupported(accessor: usize, expected: &'static str) -> Error {
    Error::UnsupportedMesh { found: format!("accessors[{accessor}]"), expected }
}

/// The bytes of a buffer that is written out in the text or lies in a file beside it.
fn fetch(path: &Path, buffer: &Buffer, folder: Option<&Path>) -> Result<Vec<u8>, Error> {
    let uri = buffer.uri.as_deref().unwrap_or_default();
    let wrong = || Error::BufferUri { uri: uri.chars().take(60).collect() };
    if let Some(data) = uri.strip_prefix("data:") {
        let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
        let decoder = GeneralPurpose::new(&base64::alphabet::STANDARD, config);
        let (_, text) = data.split_once(";base64,").ok_or_else(wrong)?;
        return decoder.decode(text).map_err(|_| wrong());
    }
    let name = percent_encoding::percent_decode_str(uri).decode_utf8().map_err(|_| wrong())?;
    // No scheme (http:, file:, a drive), no root: what a mesh names lies beside it.
    if name.is_empty() || name.contains(':') || Path::new(name.as_ref()).is_absolute() {
        return Err(wrong());
    }
    let file = path.with_file_name(name.as_ref());
    if let Some(folder) = folder {
        check_inside(folder, &file)?;
    }
    Ok(read_at_most(&file, buffer.byte_length.0)?)
}
