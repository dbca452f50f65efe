//! What can go wrong between a mesh and a response.

use sabine_acoustics::OutOfRange;

/// Errors of this crate; each names what is wrong and where.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting outside its range, or not finite.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// Every triangle of the mesh has zero area.
    #[error("the mesh has no surface: all {triangles} triangles have zero area")]
    NoSurface {
        /// Number of triangles.
        triangles: usize,
    },
    /// The source or the receiver stands outside the room.
    #[error("{what} {id:?} at {position_m:?} m is outside the room: {:.0} % of rays from there meet no surface", 100.0 * escaping)]
    Outside {
        /// "source" or "receiver".
        what: &'static str,
        /// Its identifier.
        id: String,
        /// Its position in metres.
        position_m: [f64; 3],
        /// Share of rays from there that meet nothing.
        escaping: f64,
    },
    /// The source or the receiver stands inside a closed body within the room, or in a wall.
    #[error("{what} {id:?} at {position_m:?} m is inside a closed body or a wall: {:.0} % of rays from there cross an even number of surfaces", 100.0 * even)]
    InsideBody {
        /// "source" or "receiver".
        what: &'static str,
        /// Its identifier.
        id: String,
        /// Its position in metres.
        position_m: [f64; 3],
        /// Share of rays that cross an even number of surfaces.
        even: f64,
    },
    /// The source or the receiver touches a surface.
    #[error("{what} {id:?} at {position_m:?} m is on a surface ({:.2} mm from triangle {triangle})", 1e3 * distance_m)]
    OnSurface {
        /// "source" or "receiver".
        what: &'static str,
        /// Its identifier.
        id: String,
        /// Its position in metres.
        position_m: [f64; 3],
        /// Index of the nearest triangle.
        triangle: usize,
        /// Distance to it in metres.
        distance_m: f64,
    },
    /// Source and receiver are at the same place.
    #[error("source {source_id:?} and receiver {receiver_id:?} coincide ({:.2} mm apart)", 1e3 * distance_m)]
    Coincident {
        /// Identifier of the source.
        source_id: String,
        /// Identifier of the receiver.
        receiver_id: String,
        /// Distance in metres.
        distance_m: f64,
    },
    /// Sound escapes through holes of the mesh.
    #[error("the mesh leaks: {:.2} % of rays between surfaces escape, through {open_edges} open edges{}",
        100.0 * escape_rate,
        example_m.map(|[a, b]| format!(" (the longest from {a:?} to {b:?} m)")).unwrap_or_default())]
    Leaking {
        /// Share of rays from surface to surface that meet nothing.
        escape_rate: f64,
        /// Number of edges that belong to one triangle only.
        open_edges: usize,
        /// The longest such edge, in metres.
        example_m: Option<[[f64; 3]; 2]>,
    },
    /// Nothing that leaves the source arrives.
    #[error(
        "no path of up to {max_length_m:.1} m reaches receiver {receiver_id:?} from source {source_id:?}"
    )]
    NoPath {
        /// Identifier of the source.
        source_id: String,
        /// Identifier of the receiver.
        receiver_id: String,
        /// Length up to which paths were looked for, in metres.
        max_length_m: f64,
    },
    /// More reflections than 32-bit indices can name.
    #[error("more than {limit} reflections: use fewer rays or a shorter duration")]
    TooManyReflections {
        /// The limit.
        limit: usize,
    },
    /// All octave bands lie above half the sample rate.
    #[error("no octave band lies below half the sample rate of {sample_rate_hz} Hz")]
    NoBand {
        /// The sample rate in Hz.
        sample_rate_hz: u32,
    },
    /// A room response and head responses of different sample rates.
    #[error("the room response is sampled at {response_hz} Hz, the head responses at {head_hz} Hz")]
    SampleRates {
        /// Sample rate of the room response in Hz.
        response_hz: u32,
        /// Sample rate of the head responses in Hz.
        head_hz: u32,
    },
    /// A wave gets out of the room: the mesh is not closed.
    #[error("waves leave the room near {at_m:.2?} m, on voxels of {:.3} m: the mesh has {open_edges} open edges{}",
        spacing_m[0],
        example_m.map(|[a, b]| format!(" (the longest from {a:.2?} to {b:.2?} m)")).unwrap_or_default())]
    WavesLeak {
        /// Where the wave left the box around the mesh, in metres.
        at_m: [f64; 3],
        /// Sides of a voxel in metres.
        spacing_m: [f64; 3],
        /// Number of edges that belong to one triangle only.
        open_edges: usize,
        /// The longest such edge, in metres.
        example_m: Option<[[f64; 3]; 2]>,
    },
    /// A voxel grid that does not fit into the memory allowed.
    #[error("waves up to {limit_hz} Hz take {voxels} voxels and {} MiB, allowed are {} MiB: up to {fitting_hz} Hz would fit", bytes >> 20, budget_bytes >> 20)]
    GridTooLarge {
        /// The highest frequency asked for, in Hz.
        limit_hz: f64,
        /// Number of voxels.
        voxels: u64,
        /// Memory that they take, in bytes.
        bytes: u64,
        /// Memory allowed, in bytes.
        budget_bytes: u64,
        /// The highest frequency whose grid would fit, in Hz.
        fitting_hz: f64,
    },
    /// A mesh thinner than a few voxels.
    #[error(
        "the mesh is {side_m:.3} m thick, less than four voxels of {spacing_m:.3} m: a limit of {needed_hz:.0} Hz would have them small enough"
    )]
    ThinRoom {
        /// Its shortest side, in metres.
        side_m: f64,
        /// Side of a voxel, in metres.
        spacing_m: f64,
        /// The limit whose voxels are small enough, in Hz.
        needed_hz: f64,
    },
    /// A source or receiver in a place that voxels do not resolve, or that is joined to the source by gaps between them only.
    #[error("no wave joins {what} {id:?} at {position_m:?} m to the room on voxels of {:.3} m: it, or the way there, is too narrow for them", spacing_m[0])]
    BetweenVoxels {
        /// "source" or "receiver".
        what: &'static str,
        /// Its identifier.
        id: String,
        /// Its position in metres.
        position_m: [f64; 3],
        /// Sides of a voxel in metres.
        spacing_m: [f64; 3],
    },
    /// A response in which the lowest mode of the room does not show.
    #[error(
        "a response of {duration_s} s is too short for the lowest mode at {lowest_hz:.1} Hz: it needs {needed_s:.3} s"
    )]
    TooShortForModes {
        /// Its length in seconds.
        duration_s: f64,
        /// The length needed, in seconds.
        needed_s: f64,
        /// About the lowest frequency at which the room resounds, in Hz.
        lowest_hz: f64,
    },
    /// Waves and paths of different sample rates.
    #[error("the waves are sampled at {waves_hz} Hz, the paths at {paths_hz} Hz")]
    JoinedRates {
        /// Sample rate of the waves in Hz.
        waves_hz: u32,
        /// Sample rate of the response from paths in Hz.
        paths_hz: u32,
    },
    /// A SOFA file that cannot be read.
    #[cfg(feature = "sofa")]
    #[error("{}: {source}", path.display())]
    Sofa {
        /// The file.
        path: std::path::PathBuf,
        /// The reader's cause.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A value of the vocabulary was refused, or the observer asked to stop.
    #[error(transparent)]
    Acoustics(#[from] sabine_acoustics::Error),
}

impl From<Error> for sabine_acoustics::Error {
    fn from(error: Error) -> Self {
        match error {
            Error::Acoustics(inner) => inner,
            other => Self::implementation("propagation", other),
        }
    }
}
