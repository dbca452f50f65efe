//! A room without a mesh: drawn from a floor plan, a height and names of the material library.

use super::file::{BandsTable, MaterialTable, RoomFile, RoomTable};
use super::tables::DEFAULT_SCATTERING;
use super::write::{place, write_folder};
use super::{MaterialPrior, MeasuredRoom};
use crate::error::Error;
use crate::floor_plan::FloorPlan;
use crate::scene::{NamedMaterial, Receiver, Scene, Source};
use sabine_acoustics::{Bands, Error as ValueError, Material, library_material};
use std::collections::{BTreeMap, HashSet};
use std::path::Path;

/// Nearer to a surface than this, a place is not in the room (m).
const MARGIN_M: f64 = 2e-3;

/// A room to be drawn: [`DrawnRoom::write`] makes a folder of it that [`MeasuredRoom::read`] reads.
///
/// Surfaces are named `floor`, `ceiling`, `walls` and, for a wall with a material of its own, `wall_3`. Each takes a table of
/// [`sabine_acoustics::material_library`], or is left open: its absorption is then unknown, to be fitted.
///
/// ```
/// use sabine_scene::{DrawnRoom, FloorPlan, Receiver, Source};
/// let room = DrawnRoom {
///     plan: FloorPlan::rectangle(5.0, 4.0)?,
///     height_m: 2.6,
///     floor: Some("parquet_on_concrete".into()),
///     ceiling: Some("plasterboard_ceiling".into()),
///     walls: Some("rendered_brick".into()),
///     wall: [(2, "glass_window".into())].into(),
///     sources: vec![Source::omni("talker", [1.0, 2.0, 1.5])?],
///     receivers: vec![Receiver::omni("listener", [4.0, 1.5, 1.2])?],
/// };
/// let folder = tempfile::tempdir()?;
/// let read = room.write(folder.path().join("living_room"))?; // room.toml and room.obj
/// assert!((read.scene().volume_m3() - 52.0).abs() < 1e-9);
/// let names: Vec<_> = read.scene().materials().iter().map(|m| m.name.as_str()).collect();
/// assert_eq!(names, ["floor", "ceiling", "walls", "wall_2"]);
/// assert_eq!(read.scene().material_areas_m2()[3].round(), 10.0); // 4 x 2.6 m
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnRoom {
    /// The outline.
    pub plan: FloorPlan,
    /// Height in metres, 0.1 to 1000.
    pub height_m: f64,
    /// Library name of the floor's material; `None`: unknown.
    pub floor: Option<String>,
    /// Library name of the ceiling's material; `None`: unknown.
    pub ceiling: Option<String>,
    /// Library name of the material of all walls that have none of their own; `None`: unknown.
    pub walls: Option<String>,
    /// Library names of single walls, by number from 1: wall 1 goes from the first corner to the second.
    pub wall: BTreeMap<usize, String>,
    /// Sources.
    pub sources: Vec<Source>,
    /// Receivers.
    pub receivers: Vec<Receiver>,
}

impl DrawnRoom {
    /// Writes `room.toml` and `room.obj` as a new folder and reads it back. The folder appears when it is complete, or not at
    /// all; it must not exist before, or be empty.
    ///
    /// # Errors
    /// [`sabine_acoustics::Error::UnknownMaterial`]; [`sabine_acoustics::Error::Index`] for a wall that the plan does not have; [`Error::OutsidePlan`] for a source or
    /// receiver outside or within 2 mm of a surface, [`Error::DuplicateId`], [`sabine_acoustics::Error::Empty`] for an empty identifier;
    /// else as [`FloorPlan::extruded`], [`MeasuredRoom::read`] and [`super::NewRoom::write`].
    pub fn write(&self, folder: impl AsRef<Path>) -> Result<MeasuredRoom, Error> {
        self.check_places()?;
        let (scene, libraries) = self.scene()?;
        let table = |(named, library): (&NamedMaterial, Option<String>)| {
            (named.name.clone(), MaterialTable { library, ..MaterialTable::default() })
        };
        let file = RoomFile {
            room: RoomTable { mesh: "room.obj".into(), units: None, up_axis: None },
            air: None,
            measurement: None,
            bands: BandsTable { centres_hz: Bands::T60.iter_hz().collect() },
            materials: scene.materials().iter().zip(libraries).map(table).collect(),
            sources: self.sources.iter().map(|s| place(&s.id, s.position_m, s.axis, None)).collect(),
            receivers: self.receivers.iter().map(|r| place(&r.id, r.position_m, r.axis, None)).collect(),
            responses: Vec::new(),
            parameters: Vec::new(),
        };
        write_folder(folder.as_ref(), &file, &scene.to_obj(), &[])
    }

    /// The mesh, and the library name of each of its materials.
    fn scene(&self) -> Result<(Scene, Vec<Option<String>>), Error> {
        let count = self.plan.walls();
        if let Some(&index) = self.wall.keys().find(|&&number| number == 0 || number > count) {
            return Err(ValueError::Index { what: "wall", index, count }.into());
        }
        let (mut materials, mut libraries) = (Vec::new(), Vec::new());
        let mut surface = |name: String, library: Option<&String>| -> Result<u32, Error> {
            let material = match library {
                Some(entry) => library_material(entry)?.material(Bands::T60)?,
                None => Material::uniform(Bands::T60, MaterialPrior::UNKNOWN_ABSORPTION, DEFAULT_SCATTERING)?,
            };
            materials.push(NamedMaterial { name, material });
            libraries.push(library.cloned());
            Ok(materials.len() as u32 - 1)
        };
        let levels = [
            surface("floor".into(), self.floor.as_ref())?,
            surface("ceiling".into(), self.ceiling.as_ref())?,
        ];
        let mut walls = vec![0; count];
        if self.wall.len() < count {
            walls.fill(surface("walls".into(), self.walls.as_ref())?);
        }
        for (&number, library) in &self.wall {
            walls[number - 1] = surface(format!("wall_{number}"), Some(library))?;
        }
        Ok((self.plan.extruded(self.height_m, materials, levels, &walls)?, libraries))
    }

    fn check_places(&self) -> Result<(), Error> {
        let sources = self.sources.iter().map(|s| (&s.id, s.position_m));
        let receivers = self.receivers.iter().map(|r| (&r.id, r.position_m));
        let mut ids = [HashSet::new(), HashSet::new()];
        let places = sources.map(|place| (0, place)).chain(receivers.map(|place| (1, place)));
        for (kind, (id, position_m)) in places {
            if id.trim().is_empty() {
                return Err(ValueError::Empty { what: "the identifier" }.into());
            }
            if !ids[kind].insert(id) {
                return Err(Error::DuplicateId { id: id.clone() });
            }
            let [x, y, z] = position_m;
            let level = z >= MARGIN_M && z <= self.height_m - MARGIN_M;
            if !level || !self.plan.contains([x, y], MARGIN_M) {
                return Err(Error::OutsidePlan { id: id.clone(), position_m, margin_m: MARGIN_M });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn room() -> DrawnRoom {
        DrawnRoom {
            plan: FloorPlan::new(vec![[0., 0.], [6., 0.], [6., 3.], [3., 3.], [3., 5.], [0., 5.]]).unwrap(),
            height_m: 2.5,
            floor: Some("carpet_thin".into()),
            ceiling: None,
            walls: Some("rendered_brick".into()),
            wall: [(3, "curtain_heavy".into())].into(),
            sources: vec![Source::omni("s1", [1.0, 4.0, 1.5]).unwrap()],
            receivers: vec![Receiver::omni("r1", [5.0, 1.0, 1.2]).unwrap()],
        }
    }

    #[test]
    fn a_drawn_room_is_read_as_it_was_drawn() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("l");
        let read = room().write(&folder).unwrap();
        assert_eq!(read, MeasuredRoom::read(&folder).unwrap());
        assert!((read.scene().volume_m3() - 60.0).abs() < 1e-9);
        let areas = read.scene().material_areas_m2();
        for ((named, area), (name, expected)) in read.scene().materials().iter().zip(areas).zip([
            ("floor", 24.0),
            ("ceiling", 24.0),
            ("walls", 47.5),
            ("wall_3", 7.5),
        ]) {
            assert!(named.name == name && (area - expected).abs() < 1e-9, "{}: {area}", named.name);
        }
        let carpet = library_material("carpet_thin").unwrap().material(Bands::T60).unwrap();
        assert_eq!(read.scene().materials()[0].material, carpet);
        assert_eq!(read.guessed().len(), 1, "the ceiling");
        let text = std::fs::read_to_string(folder.join("room.toml")).unwrap();
        assert!(text.contains("library = \"carpet_thin\""), "{text}");
        assert!(
            matches!(room().write(&folder), Err(Error::Acoustics(ValueError::Io { .. }))),
            "the folder is taken"
        );
    }

    #[test]
    fn what_cannot_be_drawn_leaves_nothing() {
        let parent = tempfile::tempdir().unwrap();
        let refused = |change: &dyn Fn(&mut DrawnRoom), words: &str| {
            let mut room = room();
            change(&mut room);
            let message = room.write(parent.path().join("new")).unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        };
        refused(&|r| r.sources[0].position_m = [4.0, 4.0, 1.0], "`s1` at [4.0, 4.0, 1.0] m is not inside");
        refused(&|r| r.receivers[0].position_m[2] = 2.5, "`r1`");
        refused(&|r| r.receivers[0].position_m[2] = f64::NAN, "`r1`");
        refused(&|r| r.receivers.push(r.receivers[0].clone()), "`r1` is there twice");
        refused(&|r| r.sources[0].id = " ".into(), "identifier is empty");
        refused(&|r| r.floor = Some("parkett".into()), "no `parkett`; the nearest names are");
        refused(&|r| r.height_m = 0.0, "s1");
        refused(&|r| (r.height_m, r.sources, r.receivers) = (0.0, vec![], vec![]), "height (m) is 0");
        refused(&|r| r.wall = [(7, "limestone".into())].into(), "wall 7 does not exist; there are 6");
        assert_eq!(std::fs::read_dir(parent.path()).unwrap().count(), 0);
    }
}
