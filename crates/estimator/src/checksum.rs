//! A flipped bit is found: SHA-256 over the names, shapes and bytes of all tensors and over the header.

use crate::{Error, WeightsFault};
use safetensors::SafeTensors;
use safetensors::tensor::TensorView;
use sha2::{Digest, Sha256};
use std::collections::HashMap;

/// The one metadata field.
pub(crate) const FIELD: &str = "sabine";

/// Between the header's own fields and the digest, which ends the text: `..., "sha256": "<64 digits>"}`.
const BEFORE: &str = ",\"sha256\":\"";
const AFTER: &str = "\"}";

/// The header with the digest as its last field. `header` is a JSON object.
pub(crate) fn seal(header: &str, tensors: &[(String, TensorView<'_>)]) -> String {
    let open = header.strip_suffix('}').unwrap_or(header);
    format!("{open}{BEFORE}{}{AFTER}", digest(header, tensors))
}

/// Compares the digest of a sealed header with that of what was read.
pub(crate) fn verify(sealed: &str, tensors: &SafeTensors<'_>) -> Result<(), WeightsFault> {
    let parts = sealed.strip_suffix(AFTER).and_then(|text| text.rsplit_once(BEFORE));
    let (open, expected) = parts.ok_or(WeightsFault::NoChecksum)?;
    let found = digest(&format!("{open}}}"), &tensors.tensors());
    if found == expected {
        return Ok(());
    }
    Err(WeightsFault::Checksum { found, expected: expected.to_owned() })
}

fn digest(header: &str, tensors: &[(String, TensorView<'_>)]) -> String {
    let mut sorted: Vec<_> = tensors.iter().collect();
    sorted.sort_by(|a, b| a.0.cmp(&b.0));
    let mut hash = Sha256::new();
    // Lengths first, so that no two files give the same bytes.
    let mut add = |bytes: &[u8]| {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    add(header.as_bytes());
    for (name, tensor) in sorted {
        add(name.as_bytes());
        add(format!("{:?} {:?}", tensor.dtype(), tensor.shape()).as_bytes());
        add(tensor.data());
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The bytes of a weights file of an older version with the checksum that [`Model::from_safetensors`](crate::Model::from_safetensors)
/// asks for. Tensors and header stay as they are, whole or damaged: whoever adds a checksum vouches for them.
///
/// # Errors
/// [`Error::Weights`] if the bytes are no weights file, or if it has a checksum already that does not fit.
pub fn add_checksum(bytes: &[u8]) -> Result<Vec<u8>, Error> {
    let fault = |fault| Error::Weights { name: "in memory".into(), fault: Box::new(fault) };
    let container = |source| fault(WeightsFault::Container { source });
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(container)?;
    let tensors = SafeTensors::deserialize(bytes).map_err(container)?;
    let missing = || fault(WeightsFault::Metadata { field: FIELD });
    let header = metadata.metadata().as_ref().and_then(|fields| fields.get(FIELD)).ok_or_else(missing)?;
    match verify(header, &tensors) {
        Ok(()) => return Ok(bytes.to_vec()),
        Err(WeightsFault::NoChecksum) => {}
        Err(other) => return Err(fault(other)),
    }
    let views = tensors.tensors();
    let sealed = HashMap::from([(FIELD.to_owned(), seal(header, &views))]);
    safetensors::serialize(views, Some(sealed)).map_err(container)
}
