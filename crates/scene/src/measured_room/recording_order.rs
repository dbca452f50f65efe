//! In which order responses were recorded.

use super::MeasuredRoom;

impl MeasuredRoom {
    /// When the response between a source and a receiver (indices) was recorded, as the room file states it; for a pair that was not measured,
    /// when the first of all was: what drifts over the recordings has not begun. `None` where no response says.
    pub fn recorded_at(&self, source: usize, receiver: usize) -> Option<f64> {
        let of_pair = self.responses.iter().filter(|r| (r.source, r.receiver) == (source, receiver));
        of_pair
            .filter_map(|r| r.recorded_at)
            .next()
            .or_else(|| self.responses.iter().filter_map(|r| r.recorded_at).min_by(f64::total_cmp))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_measured_counts_as_recorded_first() {
        let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room");
        let mut room = MeasuredRoom::read(fixture).unwrap();
        let [first, second] = [0, 1].map(|i| (room.responses[i].source, room.responses[i].receiver));
        assert_eq!(room.recorded_at(first.0, first.1), None);
        room.responses.truncate(3);
        for (response, at) in room.responses.iter_mut().zip([7.0, 4.0, 5.0]) {
            response.recorded_at = Some(at);
        }
        assert_eq!(room.recorded_at(first.0, first.1), Some(7.0));
        assert_eq!(room.recorded_at(second.0, second.1), Some(4.0));
        room.responses.remove(0);
        assert_eq!(room.recorded_at(first.0, first.1), Some(4.0));
    }
}
