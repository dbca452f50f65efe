//! The same measurement with another room model.

use super::{MeasuredRoom, ResponseEntry};
use crate::error::Error;
use crate::measured_room::MaterialPrior;
use crate::scene::{Receiver, Scene, Source};
use sabine_acoustics::{Air, Error as ValueError, PerBand};

impl MeasuredRoom {
    /// The same measurement with another model of the room: materials, mesh, air and places may differ, names may not.
    /// Further materials may follow those of the room; they are trusted as far as tables are
    /// ([`MaterialPrior::TABLE_SD`]). Other priors stay as they are, and so do the responses but for their air: what the room's becomes warmer
    /// or moister, that of each response becomes, too.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::OutOfRange`] for a response whose air becomes warmer or colder than [`Air`] goes;
    /// [`sabine_acoustics::Error::MaterialCount`] for fewer materials; [`sabine_acoustics::Error::UnknownId`] for materials, sources or receivers of other names or in
    /// another order.
    pub fn with_model(
        &self,
        scene: Scene,
        air: Air,
        sources: Vec<Source>,
        receivers: Vec<Receiver>,
    ) -> Result<Self, Error> {
        let (expected, found) = (self.scene.materials().len(), scene.materials().len());
        if expected > found {
            return Err(ValueError::MaterialCount { expected, found }.into());
        }
        let names = |scene: &Scene| scene.materials().iter().map(|m| m.name.clone()).collect::<Vec<_>>();
        let of_sources = |all: &[Source]| all.iter().map(|s| s.id.clone()).collect::<Vec<_>>();
        let of_receivers = |all: &[Receiver]| all.iter().map(|r| r.id.clone()).collect::<Vec<_>>();
        for (own, other) in [
            (names(&self.scene), names(&scene)[..expected].to_vec()),
            (of_sources(&self.sources), of_sources(&sources)),
            (of_receivers(&self.receivers), of_receivers(&receivers)),
        ] {
            let missing = own.iter().enumerate().find(|(i, id)| other.get(*i) != Some(id));
            if let Some(id) = missing.map(|(_, id)| id).or(other.get(own.len())) {
                return Err(ValueError::UnknownId { id: id.clone() }.into());
            }
        }
        let mut priors = self.priors.clone();
        priors.extend(scene.materials()[expected..].iter().map(|more| {
            let absorption = more.material.absorption().clone();
            let absorption_sd = PerBand::uniform(absorption.bands(), MaterialPrior::TABLE_SD);
            MaterialPrior { absorption: Some(absorption), absorption_sd }
        }));
        let taken_in = |entry: &ResponseEntry| -> Result<ResponseEntry, Error> {
            Ok(ResponseEntry { air: changed_as(&entry.air, &self.air, &air)?, ..entry.clone() })
        };
        let responses = self.responses.iter().map(taken_in).collect::<Result<_, _>>()?;
        Ok(Self { scene, air, sources, receivers, priors, responses, ..self.clone() })
    }

    /// The same room with those of its responses alone that are wanted; places stay.
    #[must_use]
    pub fn with_responses(&self, wanted: impl Fn(&ResponseEntry) -> bool) -> Self {
        let responses = self.responses.iter().filter(|r| wanted(r)).cloned().collect();
        Self { responses, ..self.clone() }
    }

    /// The same room with other receivers and without any response or table: nothing has been measured at them yet.
    #[must_use]
    pub fn unmeasured_at(&self, receivers: Vec<Receiver>) -> Self {
        Self { receivers, responses: Vec::new(), parameters: Vec::new(), ..self.clone() }
    }
}

/// An air changed as another one is: as much warmer, as much moister (up to dry or saturated), at as much more pressure.
fn changed_as(own: &Air, from: &Air, to: &Air) -> Result<Air, ValueError> {
    if own == from {
        return Ok(*to);
    }
    let changed = |read: fn(&Air) -> f64| read(own) + read(to) - read(from);
    let pressure_kpa = changed(Air::pressure_kpa);
    let humidity_percent = changed(Air::relative_humidity_percent).clamp(0.0, 100.0);
    Air::new(changed(Air::temperature_c), humidity_percent, pressure_kpa)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_other_receivers_nothing_is_measured() {
        let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room");
        let room = MeasuredRoom::read(fixture).unwrap();
        let planned = vec![Receiver::omni("planned", [1.0, 1.0, 1.0]).unwrap()];
        let other = room.unmeasured_at(planned.clone());
        assert_eq!((other.receivers(), other.responses().len()), (&planned[..], 0));
        assert_eq!((other.scene(), other.sources()), (room.scene(), room.sources()));
        let some = room.with_responses(|r| r.receiver == room.responses()[0].receiver);
        assert!(
            some.responses().len() < room.responses().len() && some.responses()[0] == room.responses()[0]
        );
        assert_eq!(some.receivers(), room.receivers());
    }

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
        let (scene, air, sources, receivers) = parts();
        let mut materials = scene.materials().to_vec();
        materials.push(crate::NamedMaterial { name: "more".into(), ..materials[0].clone() });
        let more = Scene::new(scene.vertices().to_vec(), scene.triangles().to_vec(), materials).unwrap();
        let wider = room.with_model(more.clone(), air, sources.clone(), receivers.clone()).unwrap();
        assert_eq!(wider.priors().len(), room.priors().len() + 1);
        let fewer = wider.with_model(scene, air, sources, receivers);
        assert!(matches!(fewer, Err(Error::Acoustics(ValueError::MaterialCount { .. }))));
        let (scene, air, sources, mut receivers) = parts();
        receivers.swap(0, 1);
        let wrong = room.with_model(scene, air, sources, receivers);
        assert!(
            matches!(wrong, Err(Error::Acoustics(ValueError::UnknownId { id })) if id == room.receivers()[0].id)
        );
    }

    #[test]
    fn the_air_of_responses_changes_as_that_of_the_room() {
        let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room");
        let mut room = MeasuredRoom::read(fixture).unwrap();
        let stated = room.air();
        let air = |warmer: f64, moister: f64| {
            let (celsius, percent) = (stated.temperature_c(), stated.relative_humidity_percent());
            Air::new(celsius + warmer, percent + moister, stated.pressure_kpa()).unwrap()
        };
        room.responses[1].air = air(2.0, -5.0);
        let model = |air: Air| {
            room.with_model(room.scene().clone(), air, room.sources().to_vec(), room.receivers().to_vec())
        };
        let other = model(air(-4.0, 8.0)).unwrap();
        assert_eq!(other.responses()[0].air, other.air());
        let own = other.responses()[1].air;
        assert!((own.temperature_c() - air(-2.0, 0.0).temperature_c()).abs() < 1e-12);
        assert!((own.relative_humidity_percent() - air(0.0, 3.0).relative_humidity_percent()).abs() < 1e-12);
        // Saturated air takes up no more.
        let moist = model(Air::new(stated.temperature_c(), 100.0, stated.pressure_kpa()).unwrap()).unwrap();
        assert!(moist.responses().iter().all(|response| response.air.relative_humidity_percent() <= 100.0));
        assert!(model(Air::new(49.0, 50.0, 101.325).unwrap()).is_err());
    }
}
