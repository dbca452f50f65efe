//! What can go wrong with vocabulary values and measures.

use crate::{Bands, Engineering, NoReading};
use std::path::{Path, PathBuf};

/// Errors of this crate; each names the offending field, and the file where there is one.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A centre frequency that is not nominal.
    #[error(
        "{centre_hz} Hz is not a nominal centre of an octave (31.5, 63, 125, ... 16000) or third octave (25, 31.5, 40, ... 20000)"
    )]
    UnknownBand {
        /// The frequency asked for, in Hz.
        centre_hz: f64,
    },
    /// Band centres that do not rise octave by octave, or third by third.
    #[error("bands from {first_hz} to {last_hz} Hz are not a contiguous rising run")]
    BandOrder {
        /// First centre, in Hz.
        first_hz: f64,
        /// Last centre, in Hz.
        last_hz: f64,
    },
    /// A list whose length is not the number of bands.
    #[error("{found} values for {expected} bands")]
    BandCount {
        /// Number of bands.
        expected: usize,
        /// Number of values.
        found: usize,
    },
    /// Quantities of different runs of bands were combined.
    #[error("cannot combine {} bands from {} Hz with {} bands from {} Hz", left.len(), left.nominal_hz(0), right.len(), right.nominal_hz(0))]
    BandMismatch {
        /// Bands of the left operand.
        left: Bands,
        /// Bands of the right operand.
        right: Bands,
    },
    /// A number outside its physical range, or not finite.
    #[error("{field} is {}; it must be {range}", Engineering(*value))]
    OutOfRange {
        /// What the number stands for, with its unit.
        field: &'static str,
        /// The number.
        value: f64,
        /// The range in words.
        range: &'static str,
    },
    /// No samples, no vertices, no triangles, ...
    #[error("{what} is empty")]
    Empty {
        /// What is empty.
        what: &'static str,
    },
    /// A sample that is NaN or infinite.
    #[error("{what}: sample {index} is not finite")]
    NotFinite {
        /// Which signal.
        what: &'static str,
        /// Index of the first such sample.
        index: usize,
    },
    /// An index that points past the end of what it indexes.
    #[error("{what} {index} does not exist; there are {count}")]
    Index {
        /// What is indexed.
        what: &'static str,
        /// The index.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A list of materials that does not match the scene or the paths.
    #[error("{found} materials given where {expected} are needed")]
    MaterialCount {
        /// Number of materials of the scene.
        expected: usize,
        /// Number given.
        found: usize,
    },
    /// The caller's observer asked to stop.
    #[error("stopped on request during {stage}")]
    Cancelled {
        /// The stage that was under way.
        stage: String,
    },
    /// A file that cannot be opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
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
    /// A folder, a named pipe or a device where a file is needed.
    #[error("{}: is {found}; a file is needed", path.display())]
    NotAFile {
        /// Its name.
        path: PathBuf,
        /// What it is, in words.
        found: &'static str,
    },
    /// A file that is no sound, or sound in a format that is not read.
    #[error("{}: this is {found}; sound is read from {}", path.display(), crate::audio::READ_FORMATS)]
    AudioKind {
        /// The file.
        path: PathBuf,
        /// What its first bytes, or its header, say that it is.
        found: crate::FileKind,
    },
    /// An audio file that contradicts itself, breaks off or holds what cannot be decoded.
    #[error("{}: {source}", path.display())]
    AudioFormat {
        /// The file.
        path: PathBuf,
        /// The decoder's cause.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// An audio file that ends before the samples that its header promises.
    #[error("{}: truncated: the header promises {promised_bytes} bytes of samples, the file has {file_bytes} in all", path.display())]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Bytes of samples that the header promises.
        promised_bytes: u64,
        /// Length of the file.
        file_bytes: u64,
    },
    /// A file of several channels where one was expected.
    #[error("{}: {channels} channels where one is needed: choose one, counted from 0, or their mean", path.display())]
    ManyChannels {
        /// The file.
        path: PathBuf,
        /// Number of channels in the file.
        channels: usize,
    },
    /// A list of the wrong length.
    #[error("{found} values; there must be {expected}")]
    Length {
        /// Number wanted.
        expected: usize,
        /// Number found.
        found: usize,
    },
    /// TOML that cannot be read: a slip in its grammar, an unknown or missing key, or a value of the wrong type.
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
        up_axis: crate::UpAxis,
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
    /// Speech, music or several measurements where one impulse response was expected.
    #[error(
        "no impulse response: {bursts} bursts of sound in {duration_s:.1} s, where a response has one onset and a decay. Speech is for `sabine estimate`; several responses in one file must be cut apart"
    )]
    NotAResponse {
        /// Times that the level rises by 10 dB to within 20 dB of the loudest.
        bursts: usize,
        /// Length of the sound in seconds.
        duration_s: f64,
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
    /// A name that nothing has.
    #[error("there is no `{id}`")]
    UnknownId {
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
    /// A material that the library does not hold.
    #[error("the material library has no `{name}`; the nearest names are {}", nearest.join(", "))]
    UnknownMaterial {
        /// The name asked for.
        name: String,
        /// The names of the library that are most like it, the nearest first.
        nearest: Vec<&'static str>,
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
    /// A line of a text file that is not what it should be.
    #[error("cannot read `{text}` as {expected}")]
    TextLine {
        /// What was expected.
        expected: &'static str,
        /// The line.
        text: String,
    },
    /// An implementation of one of the traits failed.
    #[error("{what}: {source}")]
    Implementation {
        /// Which stage failed.
        what: &'static str,
        /// The cause.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

impl Error {
    /// Names the file and the field in which this error arose.
    pub(crate) fn in_file(self, path: impl Into<PathBuf>, field: impl Into<String>) -> Self {
        Self::InFile { path: path.into(), field: field.into(), source: Box::new(self) }
    }

    /// Says where in the text of a TOML file something is wrong.
    pub fn toml(path: impl AsRef<Path>, text: &str, source: toml::de::Error) -> Self {
        let at = source.span().map_or(0, |span| span.start.min(text.len()));
        let (line, field) = crate::toml_field::line_and_field(text, at);
        Self::Toml { path: path.as_ref().to_owned(), line, field, source: Box::new(source) }
    }

    /// Wraps the error of a trait's implementation.
    pub fn implementation(
        what: &'static str,
        source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
    ) -> Self {
        Self::Implementation { what, source: source.into() }
    }
}

/// Checks that a number is finite and within `low..=high`.
pub(crate) fn check_range(
    field: &'static str,
    value: f64,
    low: f64,
    high: f64,
    range: &'static str,
) -> Result<(), Error> {
    // Written so that NaN fails.
    if value >= low && value <= high { Ok(()) } else { Err(Error::OutOfRange { field, value, range }) }
}
