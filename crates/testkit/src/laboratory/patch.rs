//! A hole in a wall: what meets the wall there is gone.

use super::hidden::Hidden;
use super::truth::Truth;
use super::unfolded::meetings;
use sabine_acoustics::{Error, OutOfRange};

/// A rectangle of a face of the box.
#[derive(Clone, Debug)]
pub(crate) struct Patch {
    face: usize,
    centre_m: [f64; 3],
    size_m: [f64; 2],
}

impl Patch {
    /// All holes of a room.
    pub(crate) fn all(truth: &Truth) -> Vec<Self> {
        truth
            .effects
            .iter()
            .filter_map(|effect| match effect {
                Hidden::OpenPatch { face, centre_m, size_m } => {
                    Some(Self { face: *face, centre_m: *centre_m, size_m: *size_m })
                }
                _ => None,
            })
            .collect()
    }

    pub(crate) fn new(face: usize, centre_m: [f64; 3], size_m: [f64; 2]) -> Self {
        Self { face, centre_m, size_m }
    }

    /// Whether a place on the face lies in the hole.
    pub(crate) fn holds(&self, place: [f64; 3]) -> bool {
        let own = (0..3).filter(|&k| k != self.face / 2);
        own.zip(self.size_m).all(|(k, side)| (place[k] - self.centre_m[k]).abs() < 0.5 * side)
    }

    /// Refuses a hole that does not fit its wall.
    pub(crate) fn check(&self, truth: &Truth) -> Result<(), Error> {
        if self.face >= 6 {
            return Err(Error::Index { what: "face", index: self.face, count: 6 });
        }
        let own = (0..3).filter(|&k| k != self.face / 2);
        for (k, side) in own.zip(self.size_m) {
            OutOfRange::check("side of the hole (m)", side, 0.0, 20.0, "between 0 and 20 m")?;
            for edge in [self.centre_m[k] - 0.5 * side, self.centre_m[k] + 0.5 * side] {
                OutOfRange::check("edge of the hole (m)", edge, 0.0, truth.size_m[k], "within its wall")?;
            }
        }
        Ok(())
    }
}

/// Whether the path of an image is lost through a hole. `offset` leads from the receiver to the image.
pub(crate) fn is_lost(truth: &Truth, patches: &[Patch], receiver: [f64; 3], offset: [f64; 3]) -> bool {
    meetings(truth, receiver, offset)
        .iter()
        .any(|m| patches.iter().any(|p| p.face == m.face && p.holds(m.place_m)))
}
