//! Points between the centres of voxels.

use super::room::WaveRoom;
use crate::Error;
use crate::vector::Vec3;

/// A source or receiver as shares of the voxels around it.
#[derive(Clone, Debug)]
pub(crate) struct PointWeights(pub Vec<(usize, f64)>);

impl PointWeights {
    /// Linear interpolation; what falls to a voxel behind a wall goes to those before it, for the pressure hardly changes
    /// across a wall.
    pub fn new(room: &WaveRoom, what: &'static str, id: &str, position_m: Vec3) -> Result<Self, Error> {
        let around = room.around(position_m);
        let sum: f64 = around.iter().map(|(_, share)| share).sum();
        if sum < 1e-3 {
            let (id, spacing_m) = (id.to_owned(), room.spacing_m());
            return Err(Error::BetweenVoxels { what, id, position_m, spacing_m });
        }
        Ok(Self(around.into_iter().map(|(voxel, share)| (voxel, share / sum)).collect()))
    }

    pub fn read(&self, pressure: &[f64]) -> f64 {
        self.0.iter().map(|&(voxel, share)| share * pressure[voxel]).sum()
    }
}
