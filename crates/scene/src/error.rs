//! What can go wrong with meshes, floor plans and room files.

use crate::mesh_file::up_axis::UpAxis;
use sabine_acoustics::{NoReading, OutOfRange};
#[cfg(feature = "rooms")]
use std::path::Path;
use std::path::PathBuf;

/// Errors of this crate; each names the offending field, and the file where there is one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A value that cannot be, or a file that cannot be read or written.
    #[error(transparent)]
    Acoustics(#[from] sabine_acoustics::Error),
    /// Something wrong in a field of a file: the cause says what.
    #[error("{}: {field}: {source}", path.display())]
    InFile {
        /// The file.
        path: PathBuf,
        /// The field, as a person would look for it: `materials.wall.absorption`, `line 12`, `samples`.
        field: String,
        /// What is wrong with it.
        source: Box<Error>,
    },
    /// TOML that cannot be read: a slip in its grammar, an unknown or missing key, or a value of the wrong type.
    #[cfg(feature = "rooms")]
    #[error("{}: line {line}: {}{}", path.display(), if field.is_empty() { String::new() } else { format!("{field}: ") }, source.message().trim_end())]
    Toml {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// The table and the key of that line, as far as they can be read: `materials.wall.absorption`.
        field: String,
        /// Where and what.
        source: Box<toml::de::Error>,
    },
    /// A file that another one names, but that does not lie below the folder that may be read.
    #[error("{} lies outside the folder {}; it is read only with `allow_outside`", named.display(), folder.display())]
    OutsideFolder {
        /// The file that is named.
        named: PathBuf,
        /// The folder below which it must lie.
        folder: PathBuf,
    },
    /// A material whose absorption is given twice.
    #[error("`library` and `absorption` both give this material's absorption; keep one of them")]
    TwoTables,
    /// A source or receiver that lies outside the mesh as it is read, whereas all lie inside if another axis points up.
    #[error(
        "{position_m:?} m is outside the mesh, which reaches from {low_m:.2?} to {high_m:.2?} m; if its {up_axis} axis pointed up, the mesh would hold every source and receiver: add up_axis = \"{up_axis}\" to [room]"
    )]
    TurnedMesh {
        /// The position in metres.
        position_m: [f64; 3],
        /// The lowest coordinates of the mesh in metres.
        low_m: [f64; 3],
        /// The highest coordinates of the mesh in metres.
        high_m: [f64; 3],
        /// The axis that would have to point up.
        up_axis: UpAxis,
    },
    /// Sound without a single sample that differs from zero.
    #[error("silent: every sample is zero")]
    Silent,
    /// A response in which no direct sound can be found.
    #[error("no direct sound: {source}")]
    NoDirectSound {
        /// Why.
        source: NoReading,
    },
    /// A line of an OBJ file that cannot be understood.
    #[error("cannot read `{text}` as {expected}")]
    ObjSyntax {
        /// What was expected.
        expected: &'static str,
        /// The offending word.
        text: String,
    },
    /// Faces that name no material where the room has no table `default` for them.
    #[error("{faces} faces of the mesh {} name no material, and there is no table `default` for them", mesh.display())]
    FacesWithoutMaterial {
        /// Number of such faces.
        faces: usize,
        /// The mesh.
        mesh: PathBuf,
    },
    /// A polygon that cannot be cut into triangles, because its outline crosses itself.
    #[error("the outline of this polygon crosses itself")]
    CrossedPolygon,
    /// A mesh file whose ending is none of those that can be read.
    #[error("{}: neither .obj nor .gltf nor .glb", path.display())]
    UnknownMeshFormat {
        /// The file.
        path: PathBuf,
    },
    /// A glTF file, but this build cannot read it.
    #[error("{}: glTF meshes need the feature `gltf`", path.display())]
    GltfFeature {
        /// The file.
        path: PathBuf,
    },
    /// A mesh file that is not what its ending says.
    #[error("{}: {source}", path.display())]
    MeshFormat {
        /// The file.
        path: PathBuf,
        /// The decoder's cause.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A mesh with more vertices or triangles than can be meant.
    #[error("{found} {what}; at most {limit} are read")]
    MeshTooLarge {
        /// "vertices", "triangles", "corners of a face" ...
        what: &'static str,
        /// How many the file asks for, as far as it was read.
        found: u64,
        /// The limit.
        limit: u64,
    },
    /// Numbers of a mesh that are said to lie where its file has none.
    #[error("ends at byte {needed_bytes} of {found_bytes}")]
    BeyondBuffer {
        /// Where the numbers would end.
        needed_bytes: u64,
        /// How many bytes there are.
        found_bytes: u64,
    },
    /// A buffer of a mesh that lies neither in the file nor beside it.
    #[error("cannot read `{uri}`: neither base64 data nor a file beside the mesh")]
    BufferUri {
        /// The address, or its beginning.
        uri: String,
    },
    /// A part of a mesh file that is not read, and without which the mesh would not be whole.
    #[error("`{found}` where only {expected} can be read")]
    UnsupportedMesh {
        /// What was found.
        found: String,
        /// What is read.
        expected: &'static str,
    },
    /// A node of a mesh file that is its own ancestor, or has two parents.
    #[error("node {node} hangs in the tree of nodes twice")]
    NodeTwice {
        /// Index of the node.
        node: usize,
    },
    /// A material of the mesh without a table in the room file.
    #[error("the mesh {} uses the material `{material}`, for which there is no table", mesh.display())]
    MaterialWithoutTable {
        /// The material's name in the mesh.
        material: String,
        /// The mesh.
        mesh: PathBuf,
    },
    /// A table for a material that no face of the mesh has.
    #[error("no face of the mesh {} has this material", mesh.display())]
    TableWithoutMaterial {
        /// The mesh.
        mesh: PathBuf,
    },
    /// Two things of one name.
    #[error("`{id}` is there twice")]
    DuplicateId {
        /// The name.
        id: String,
    },
    /// A response that ends before the direct sound can arrive.
    #[error("{duration_s:.4} s long, but the direct sound arrives after {direct_s:.4} s")]
    ShorterThanDirectSound {
        /// Length of the response, in seconds.
        duration_s: f64,
        /// Time of flight from source to receiver, in seconds.
        direct_s: f64,
    },
    /// A floor plan that crosses or touches itself.
    #[error("wall {first} and wall {second} cross or touch each other")]
    CrossedPlan {
        /// The wall from this corner to the next, counted from 1.
        first: usize,
        /// The other wall.
        second: usize,
    },
    /// A position that is not in the room.
    #[error("`{id}` at {position_m:?} m is not inside the room, or nearer than {margin_m} m to a surface")]
    OutsidePlan {
        /// Identifier of the source or receiver.
        id: String,
        /// The position in metres.
        position_m: [f64; 3],
        /// The least distance from floor, ceiling and walls, in metres.
        margin_m: f64,
    },
    /// A file that is no HDF5, is cut short or damaged, or has parts that are not read.
    #[error("cannot be read: {source}")]
    Hdf5 {
        /// The decoder's cause.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A SOFA file of something else than room responses.
    #[error("`{found}` where SingleRoomSRIR 1 or SingleRoomMIMOSRIR 1 can be read{}", if found.contains("FreeField") { ": head-related responses are no room; `sabine walk --head` renders with them" } else { "" })]
    SofaConvention {
        /// Convention and version that were found.
        found: String,
    },
    /// A program that does not answer at this address.
    #[cfg(feature = "rew-http")]
    #[error("{address}: no answer: {source}")]
    Http {
        /// The address.
        address: String,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// An answer that is a refusal.
    #[cfg(feature = "rew-http")]
    #[error("{address}: answers with status {status}: {text}")]
    HttpStatus {
        /// The address.
        address: String,
        /// The status: 404 where there is no such measurement.
        status: u16,
        /// The beginning of the answer.
        text: String,
    },
    /// Something that a file must have.
    #[error("is missing")]
    Missing,
    /// An array of another shape than it must have.
    #[error("has the shape {found}, where {expected} is needed")]
    Shape {
        /// What can be read.
        expected: String,
        /// What was found.
        found: String,
    },
    /// A unit, a type or a word that is not known.
    #[error("is `{found}`; {expected} can be read")]
    Unit {
        /// What was found.
        found: String,
        /// What is known.
        expected: &'static str,
    },
    /// A file that claims to hold more than can be meant.
    #[error("{found} where at most {limit} are taken")]
    TooManyValues {
        /// How many the file claims.
        found: u64,
        /// The limit.
        limit: u64,
    },
    /// One name for two places.
    #[error("`{id}` is at {here_m:?} m here and at {before_m:?} m before")]
    MovedPlace {
        /// The name.
        id: String,
        /// Its position here, in metres.
        here_m: [f64; 3],
        /// Its position in a line above, in metres.
        before_m: [f64; 3],
    },
    /// Two names for one place.
    #[error("`{id}` is where `{other}` is, or within 1 mm of it")]
    SamePlace {
        /// The name.
        id: String,
        /// The other name.
        other: String,
    },
    /// A grid of responses with a hole.
    #[error("there is no response from `{source_id}` to `{receiver_id}`, and this convention needs all")]
    MissingPair {
        /// The source.
        source_id: String,
        /// The receiver.
        receiver_id: String,
    },
    /// A line of a text file that is not what it should be.
    #[error("cannot read `{text}` as {expected}")]
    TextLine {
        /// What was expected.
        expected: &'static str,
        /// The line.
        text: String,
    },
}

impl From<OutOfRange> for Error {
    fn from(error: OutOfRange) -> Self {
        Self::Acoustics(error.into())
    }
}

impl Error {
    /// Names the file and the field in which this error arose.
    pub(crate) fn in_file(self, path: impl Into<PathBuf>, field: impl Into<String>) -> Self {
        Self::InFile { path: path.into(), field: field.into(), source: Box::new(self) }
    }

    /// Says where in the text of a TOML file something is wrong.
    #[cfg(feature = "rooms")]
    pub fn toml(path: impl AsRef<Path>, text: &str, source: toml::de::Error) -> Self {
        let at = source.span().map_or(0, |span| span.start.min(text.len()));
        let (line, field) = crate::toml_field::line_and_field(text, at);
        Self::Toml { path: path.as_ref().to_owned(), line, field, source: Box::new(source) }
    }
}
