//! What can go wrong between a mesh and its waves.

/// What only the wave solver refuses; [`Error::Wave`](crate::Error::Wave) holds it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WaveError {
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
}
