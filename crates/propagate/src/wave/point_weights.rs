//! Points between the centres of voxels.

use super::error::WaveError;
use super::room::WaveRoom;
use crate::vector::Vec3;

/// A source or receiver as shares of the voxels around it: where the pressure is read, and where sound is fed in. The same
/// for both, so that exchanging them changes nothing.
#[derive(Clone, Debug)]
pub(crate) struct PointWeights(pub Vec<(usize, f64)>);

impl PointWeights {
    /// `what` and `id` name the point where no voxel stands for it.
    pub fn new(room: &WaveRoom, what: &'static str, id: &str, position_m: Vec3) -> Result<Self, WaveError> {
        let around = room.around(position_m);
        if around.is_empty() {
            let (id, spacing_m) = (id.to_owned(), room.spacing_m());
            return Err(WaveError::BetweenVoxels { what, id, position_m, spacing_m });
        }
        Ok(Self(around))
    }

    pub fn read(&self, pressure: &[f64]) -> f64 {
        self.0.iter().map(|&(voxel, share)| share * pressure[voxel]).sum()
    }
}
