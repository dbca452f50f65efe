//! What is measured of one first-order reflection.

/// One first-order reflection of one response.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ReflectionGate {
    /// Index of its response.
    pub response: usize,
    /// Where it is reflected, in metres.
    pub place_m: [f64; 3],
    /// Index of its surface among [`Survey::planes`](crate::Survey::planes).
    pub plane: usize,
    /// How probable (logarithm, in nats) what was measured is if the surface is as the model says, odd reflections allowed for.
    pub present_nats: f64,
    /// The same if the reflection is missing.
    pub missing_nats: f64,
}
