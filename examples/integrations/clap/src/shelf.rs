//! The folder in which users lay rooms that the parameter "Room" chooses from.

use crate::room::Place;
use std::path::{Path, PathBuf};

/// Names another folder than [`FOLDER`] in the home folder.
pub const VARIABLE: &str = "SABINE_ROOMS";
/// Folder of rooms in the home folder.
pub const FOLDER: &str = "Sabine Rooms";
/// More rooms are left out: hosts show a list.
const MOST: usize = 126;

/// Rooms in the folder, as they were when the instance was made: what a value of the parameter means must not change under way.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shelf(Vec<PathBuf>);

impl Shelf {
    /// Looks into the user's folder; there need not be one.
    pub fn of_user() -> Self {
        let home = || std::env::home_dir().map(|home| home.join(FOLDER));
        let folder = std::env::var_os(VARIABLE).map(PathBuf::from).or_else(home);
        folder.map_or_else(Self::default, |folder| Self::of_folder(&folder))
    }

    /// Sound files and folders that hold a `room.toml`, in the order of their names.
    pub fn of_folder(folder: &Path) -> Self {
        let Ok(folder) = std::path::absolute(folder) else { return Self::default() };
        let Ok(entries) = std::fs::read_dir(&folder) else { return Self::default() };
        let is_room = |path: &PathBuf| {
            let is_wav = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("wav"));
            path.to_str().is_some() && (is_wav && path.is_file() || path.join("room.toml").is_file())
        };
        let mut rooms: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).filter(is_room).collect();
        rooms.sort();
        rooms.truncate(MOST);
        Self(rooms)
    }

    /// Values of the parameter: the built-in room, that of the project, those of the folder.
    pub fn values(&self) -> u32 {
        self.0.len() as u32 + 2
    }

    /// What a value means; `project` is the room of the project's state, if it is not on the shelf.
    pub fn place(&self, value: f64, project: Option<&PathBuf>) -> Place {
        let of_shelf = |index: usize| self.0.get(index).cloned().map_or(Place::Nothing, Place::At);
        match value as usize {
            0 => Place::BuiltIn,
            1 => project.cloned().map_or(Place::Nothing, Place::At),
            value => of_shelf(value - 2),
        }
    }

    /// The value that means a place, and what the room of the project is then.
    pub fn value(&self, place: &Place) -> (f64, Option<PathBuf>) {
        match place {
            Place::BuiltIn => (0.0, None),
            Place::Nothing => (1.0, None),
            Place::At(path) => match self.0.iter().position(|room| room == path) {
                Some(index) => (index as f64 + 2.0, None),
                None => (1.0, Some(path.clone())),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rooms_of_the_folder_and_of_the_project_have_values_and_back() {
        let folder = tempfile::tempdir().unwrap();
        for file in ["b.WAV", "a.wav", "notes.txt"] {
            std::fs::write(folder.path().join(file), "").unwrap();
        }
        for name in ["c hall", "no room"] {
            std::fs::create_dir(folder.path().join(name)).unwrap();
        }
        std::fs::write(folder.path().join("c hall/room.toml"), "").unwrap();
        let shelf = Shelf::of_folder(folder.path());
        assert_eq!(shelf.values(), 5);
        let at = |name: &str| Place::At(folder.path().join(name));
        let elsewhere = Place::At(folder.path().join("no room/x.wav"));
        let all = [Place::BuiltIn, Place::Nothing, at("a.wav"), at("b.WAV"), at("c hall")];
        for (value, place) in all.into_iter().enumerate() {
            assert_eq!(shelf.value(&place), (value as f64, None));
            assert_eq!(shelf.place(value as f64, None), place);
        }
        let (value, project) = shelf.value(&elsewhere);
        assert_eq!((value, shelf.place(value, project.as_ref())), (1.0, elsewhere));
        assert_eq!(shelf.place(99.0, None), Place::Nothing);
        assert_eq!(Shelf::of_folder(&folder.path().join("none")), Shelf::default());
    }
}
