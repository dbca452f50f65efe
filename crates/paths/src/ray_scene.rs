//! The seam between a tracer and the surfaces that rays meet.

/// Where a ray meets the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Distance along the ray in units of its direction's length.
    pub distance: f64,
    /// Index of the triangle.
    pub triangle: u32,
}

/// Answers which surface a ray meets first.
pub trait RayScene: Send + Sync {
    /// The nearest triangle within `max_distance` along a unit `direction`, either side of it.
    fn closest_hit(&self, origin: [f64; 3], direction: [f64; 3], max_distance: f64) -> Option<RayHit>;

    /// Whether there is any triangle within `max_distance` along a unit `direction`: what a shadow ray asks, and cheaper
    /// than the nearest one where an implementor says so.
    fn any_hit(&self, origin: [f64; 3], direction: [f64; 3], max_distance: f64) -> bool {
        self.closest_hit(origin, direction, max_distance).is_some()
    }
}
