//! A measured room that is believed to be another than its file says.

use super::MeasuredRoom;
use crate::{Air, Error, Receiver, Scene, Source};

impl MeasuredRoom {
    /// The same measurement with another model of the room: materials, mesh, air and places may differ, names may not.
    /// Priors and responses stay as they are.
    ///
    /// # Errors
    /// [`Error::MaterialCount`] and [`Error::UnknownId`] for materials, sources or receivers of other names or in another
    /// order.
    pub fn with_model(
        &self,
        scene: Scene,
        air: Air,
        sources: Vec<Source>,
        receivers: Vec<Receiver>,
    ) -> Result<Self, Error> {
        let (expected, found) = (self.scene.materials().len(), scene.materials().len());
        if expected != found {
            return Err(Error::MaterialCount { expected, found });
        }
        let names = |scene: &Scene| scene.materials().iter().map(|m| m.name.clone()).collect::<Vec<_>>();
        let of_sources = |all: &[Source]| all.iter().map(|s| s.id.clone()).collect::<Vec<_>>();
        let of_receivers = |all: &[Receiver]| all.iter().map(|r| r.id.clone()).collect::<Vec<_>>();
        for (own, other) in [
            (names(&self.scene), names(&scene)),
            (of_sources(&self.sources), of_sources(&sources)),
            (of_receivers(&self.receivers), of_receivers(&receivers)),
        ] {
            let missing = own.iter().enumerate().find(|(i, id)| other.get(*i) != Some(id));
            if let Some(id) = missing.map(|(_, id)| id).or(other.get(own.len())) {
                return Err(Error::UnknownId { id: id.clone() });
            }
        }
        Ok(Self { scene, air, sources, receivers, ..self.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_may_move_but_not_change_their_names() {
        let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room");
        let room = MeasuredRoom::read(fixture).unwrap();
        let parts = || (room.scene().clone(), room.air(), room.sources().to_vec(), room.receivers().to_vec());
        let (scene, air, mut sources, receivers) = parts();
        sources[0].position_m[0] += 0.1;
        let other = room.with_model(scene, air, sources.clone(), receivers).unwrap();
        assert_eq!(other.sources(), sources);
        assert_eq!(other.responses(), room.responses());
        let (scene, air, sources, mut receivers) = parts();
        receivers.swap(0, 1);
        let wrong = room.with_model(scene, air, sources, receivers);
        assert!(matches!(wrong, Err(Error::UnknownId { id }) if id == room.receivers()[0].id));
    }
}
