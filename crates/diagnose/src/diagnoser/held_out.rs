//! Receivers that a diagnosis never fits.

use crate::error::Error;
use sabine_scene::MeasuredRoom;

/// Receivers (indices) at which something was measured: responses, or tables where there are none.
fn measured_receivers(room: &MeasuredRoom) -> Vec<usize> {
    if room.responses().is_empty() {
        room.parameters().iter().map(|entry| entry.receiver).collect()
    } else {
        room.responses().iter().map(|response| response.receiver).collect()
    }
}

/// Receivers (indices) to be held out.
pub(super) fn held_receivers(room: &MeasuredRoom, hold_out: &[String]) -> Result<Vec<usize>, Error> {
    let measured = measured_receivers(room);
    let mut held: Vec<usize> = Vec::new();
    for id in hold_out {
        let index = room.receivers().iter().position(|r| r.id == *id);
        let index = index.filter(|i| measured.contains(i));
        held.push(index.ok_or_else(|| Error::UnknownHoldOut { id: id.clone() })?);
    }
    if !measured.is_empty() && measured.iter().all(|receiver| held.contains(receiver)) {
        return Err(Error::AllHeldOut);
    }
    Ok(held)
}
