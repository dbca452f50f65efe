//! What can go wrong between a mesh and a response.

use crate::wave::WaveError;
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
    /// What the wave solver cannot do.
    #[error(transparent)]
    Wave(#[from] WaveError),
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
