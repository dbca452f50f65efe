//! The part of HDF5 that a SOFA file needs, written: text attributes, named dimensions, and arrays of numbers.
//!
//! Superblock version 2, object headers of version 2, links and attributes within the headers, contiguous data, and dimensions
//! as netCDF-4 keeps them (HDF5 Dimension Scale Specification 1.0; netCDF-4 File Format, "Dimensions"). The crate that reads
//! writes no list of dimension scales, without which netCDF names the dimensions `phony_dim_0`.
//!
//! Source: HDF5 File Format Specification Version 3.0, sections II.A (superblock), III.E (global heap), IV.A (messages).

use super::hdf5_checksum::lookup3;

/// "Undefined address".
const UNDEFINED: u64 = u64::MAX;
/// Least size of a global heap (specification III.E).
const MIN_HEAP_BYTES: usize = 4096;
/// Largest body of a message: its length has 16 bits.
pub(super) const MAX_MESSAGE_BYTES: usize = u16::MAX as usize;

// Types of messages.
const DATASPACE: u8 = 0x01;
const LINK_INFO: u8 = 0x02;
const DATATYPE: u8 = 0x03;
const FILL_VALUE: u8 = 0x05;
const LINK: u8 = 0x06;
const LAYOUT: u8 = 0x08;
const GROUP_INFO: u8 = 0x0a;
const ATTRIBUTE: u8 = 0x0c;

/// What a file is to hold.
#[derive(Default)]
pub(super) struct Hdf5Content {
    /// Text attributes of the file.
    pub attributes: Vec<(String, String)>,
    /// Name and length of each dimension; no length is zero.
    pub dimensions: Vec<(&'static str, usize)>,
    /// Arrays, in the order in which they are listed.
    pub variables: Vec<Variable>,
}

/// An array.
pub(super) struct Variable {
    /// Its name.
    pub name: &'static str,
    /// Its dimensions, by index.
    pub dimensions: Vec<usize>,
    /// Its values, the last dimension fastest.
    pub values: Vec<f64>,
    /// Its text attributes.
    pub attributes: Vec<(&'static str, String)>,
}

impl Hdf5Content {
    /// The file. Attributes must fit into messages ([`MAX_MESSAGE_BYTES`], with their names), values must fill their dimensions.
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        // The superblock comes last: it names the root.
        let mut bytes = vec![0; 48];
        let scales: Vec<u64> =
            (0..self.dimensions.len()).map(|index| append(&mut bytes, &self.dimension(index))).collect();
        let heap = append(&mut bytes, &heap(&scales));
        let mut links: Vec<(&str, u64)> =
            self.dimensions.iter().zip(&scales).map(|(&(name, _), &address)| (name, address)).collect();
        for variable in &self.variables {
            let data: Vec<u8> = variable.values.iter().flat_map(|x| x.to_le_bytes()).collect();
            let address = append(&mut bytes, &data);
            let header = self.header(variable, address, data.len(), heap);
            links.push((variable.name, append(&mut bytes, &header)));
        }
        let root = append(&mut bytes, &self.root(&links));
        let mut superblock = b"\x89HDF\r\n\x1a\n\x02\x08\x08\x00".to_vec();
        for number in [0, UNDEFINED, bytes.len() as u64, root] {
            superblock.extend(number.to_le_bytes());
        }
        superblock.extend(lookup3(&superblock).to_le_bytes());
        bytes[..48].copy_from_slice(&superblock);
        bytes
    }

    /// A dimension without values: netCDF's way, a data set that takes no room.
    fn dimension(&self, index: usize) -> Vec<u8> {
        let length = self.dimensions[index].1;
        let mut messages = Messages::default();
        messages.add(DATASPACE, dataspace(&[length as u64]));
        // Big-endian floats of 32 bits, as netCDF chooses them.
        messages.add(DATATYPE, float_type(true, 4, [23, 8, 0, 23], 127));
        messages.add(FILL_VALUE, vec![3, 0x0a]);
        messages.add(LAYOUT, contiguous(UNDEFINED, 4 * length));
        messages.attribute("CLASS", &text_type(16), &[], b"DIMENSION_SCALE\0");
        let name = format!("This is a netCDF dimension but not a netCDF variable. {length:>10}\0");
        messages.attribute("NAME", &text_type(name.len()), &[], name.as_bytes());
        messages.attribute("_Netcdf4Dimid", &INTEGER, &[], &(index as u32).to_le_bytes());
        messages.header()
    }

    fn header(&self, variable: &Variable, data: u64, data_bytes: usize, heap: u64) -> Vec<u8> {
        let shape: Vec<u64> = variable.dimensions.iter().map(|&d| self.dimensions[d].1 as u64).collect();
        let mut messages = Messages::default();
        messages.add(DATASPACE, dataspace(&shape));
        messages.add(DATATYPE, float_type(false, 8, [52, 11, 0, 52], 1023));
        messages.add(FILL_VALUE, vec![3, 0x0a]);
        messages.add(LAYOUT, contiguous(data, data_bytes));
        let rank = shape.len() as u64;
        let mut list = Vec::new();
        for &dimension in &variable.dimensions {
            // One reference, object `dimension + 1` of the heap.
            list.extend(1u32.to_le_bytes());
            list.extend(heap.to_le_bytes());
            list.extend((dimension as u32 + 1).to_le_bytes());
        }
        messages.attribute("DIMENSION_LIST", &REFERENCES, &[rank], &list);
        let ids: Vec<u8> = variable.dimensions.iter().flat_map(|&d| (d as u32).to_le_bytes()).collect();
        messages.attribute("_Netcdf4Coordinates", &INTEGER, &[rank], &ids);
        for (name, text) in &variable.attributes {
            messages.text(name, text);
        }
        messages.header()
    }

    fn root(&self, links: &[(&str, u64)]) -> Vec<u8> {
        let mut messages = Messages::default();
        // Version 0; the order of creation is kept.
        let mut info = vec![0, 1];
        for number in [links.len() as u64, UNDEFINED, UNDEFINED] {
            info.extend(number.to_le_bytes());
        }
        messages.add(LINK_INFO, info);
        messages.add(GROUP_INFO, vec![0, 0]);
        for (order, (name, address)) in links.iter().enumerate() {
            // Version 1; with the order of creation; a length of one byte.
            let mut link = vec![1, 0x04];
            link.extend((order as u64).to_le_bytes());
            link.push(name.len() as u8);
            link.extend(name.as_bytes());
            link.extend(address.to_le_bytes());
            messages.add(LINK, link);
        }
        for (name, text) in &self.attributes {
            messages.text(name, text);
        }
        messages.header()
    }
}

/// Messages of an object header.
#[derive(Default)]
struct Messages(Vec<u8>);

impl Messages {
    fn add(&mut self, kind: u8, body: Vec<u8>) {
        self.0.push(kind);
        self.0.extend((body.len() as u16).to_le_bytes());
        self.0.push(0);
        self.0.extend(body);
    }

    /// An attribute of this type; of no dimension unless `shape` names some.
    fn attribute(&mut self, name: &str, datatype: &[u8], shape: &[u64], data: &[u8]) {
        let space = dataspace(shape);
        self.attribute_in(name, datatype, &space, data);
    }

    fn attribute_in(&mut self, name: &str, datatype: &[u8], space: &[u8], data: &[u8]) {
        let mut body = vec![3, 0];
        for length in [name.len() + 1, datatype.len(), space.len()] {
            body.extend((length as u16).to_le_bytes());
        }
        body.push(0);
        body.extend(name.as_bytes());
        body.push(0);
        for part in [datatype, space, data] {
            body.extend(part);
        }
        self.add(ATTRIBUTE, body);
    }

    /// Text; an empty one has a data space without elements, as netCDF writes it.
    fn text(&mut self, name: &str, text: &str) {
        if text.is_empty() {
            self.attribute_in(name, &text_type(1), &[2, 0, 0, 2], &[]);
        } else {
            self.attribute(name, &text_type(text.len()), &[], text.as_bytes());
        }
    }

    fn header(self) -> Vec<u8> {
        // Version 2; the size of the messages has four bytes.
        let mut bytes = b"OHDR\x02\x02".to_vec();
        bytes.extend((self.0.len() as u32).to_le_bytes());
        bytes.extend(self.0);
        bytes.extend(lookup3(&bytes).to_le_bytes());
        bytes
    }
}

/// Integers of 32 bits, signed.
const INTEGER: [u8; 12] = [0x10, 0x08, 0, 0, 4, 0, 0, 0, 0, 0, 32, 0];
/// Sequences of references to objects.
const REFERENCES: [u8; 16] = [0x19, 0, 0, 0, 16, 0, 0, 0, 0x17, 0, 0, 0, 8, 0, 0, 0];

/// IEEE 754 numbers: positions and sizes of exponent and mantissa in bits, and the exponent's bias.
fn float_type(
    big_endian: bool,
    bytes: u8,
    [exponent_at, exponent, mantissa_at, mantissa]: [u8; 4],
    bias: u32,
) -> Vec<u8> {
    // The leading bit of the mantissa is implied; the sign is the highest bit.
    let mut body = vec![0x11, 0x20 | u8::from(big_endian), 8 * bytes - 1, 0, bytes, 0, 0, 0];
    body.extend([0, 0, 8 * bytes, 0, exponent_at, exponent, mantissa_at, mantissa]);
    body.extend(bias.to_le_bytes());
    body
}

/// UTF-8 text of so many bytes, ended by its size or by a zero.
fn text_type(bytes: usize) -> Vec<u8> {
    let mut body = vec![0x13, 0x10, 0, 0];
    body.extend((bytes as u32).to_le_bytes());
    body
}

fn dataspace(shape: &[u64]) -> Vec<u8> {
    let mut body = vec![2, shape.len() as u8, 0, u8::from(!shape.is_empty())];
    body.extend(shape.iter().flat_map(|length| length.to_le_bytes()));
    body
}

fn contiguous(address: u64, bytes: usize) -> Vec<u8> {
    let mut body = vec![3, 1];
    body.extend(address.to_le_bytes());
    body.extend((bytes as u64).to_le_bytes());
    body
}

/// A global heap with one reference in each object, counted from 1.
fn heap(addresses: &[u64]) -> Vec<u8> {
    let used = 16 + 24 * addresses.len();
    let size = (used + 16).max(MIN_HEAP_BYTES);
    let mut bytes = b"GCOL\x01\0\0\0".to_vec();
    bytes.extend((size as u64).to_le_bytes());
    for (index, address) in addresses.iter().enumerate() {
        bytes.extend((index as u16 + 1).to_le_bytes());
        bytes.extend([0; 6]);
        bytes.extend(8u64.to_le_bytes());
        bytes.extend(address.to_le_bytes());
    }
    // Object 0 is the space that is left, its own header included.
    bytes.extend([0; 8]);
    bytes.extend(((size - used) as u64).to_le_bytes());
    bytes.resize(size, 0);
    bytes
}

/// Appends an object at the next multiple of eight and returns its address.
fn append(bytes: &mut Vec<u8>, object: &[u8]) -> u64 {
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    let address = bytes.len() as u64;
    bytes.extend_from_slice(object);
    address
}
