//! The demo that is built into the program: a room, a recording of speech in it, and dry speech.
//!
//! It is the fixture of the repository (`fixtures/README.md`), so that an installed program works without a checkout.

use crate::output::OutputError;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Files of the demo: their names below its folder, and what is in them.
const FILES: [(&str, &[u8]); 7] = [
    ("room/room.toml", include_bytes!("../demo/room/room.toml")),
    ("room/room.obj", include_bytes!("../demo/room/room.obj")),
    ("room/ir/talker_corner.wav", include_bytes!("../demo/room/ir/talker_corner.wav")),
    ("room/ir/talker_microphone.wav", include_bytes!("../demo/room/ir/talker_microphone.wav")),
    ("speech/recording.wav", include_bytes!("../demo/speech/recording.wav")),
    ("speech/dry_guest.wav", include_bytes!("../demo/speech/dry_guest.wav")),
    ("speech/dry_reader.wav", include_bytes!("../demo/speech/dry_reader.wav")),
];

/// What stands in for a path that the user did not give.
#[derive(Default)]
pub struct Demo {
    /// Unpacked when it is first asked for; removed with this.
    folder: Option<TempDir>,
}

impl Demo {
    /// The user's own path, or a file or folder of the demo.
    ///
    /// # Errors
    /// The temporary folder cannot be written.
    pub fn or(&mut self, own: Option<&Path>, name: &str) -> Result<PathBuf, OutputError> {
        match own {
            Some(path) => Ok(path.to_owned()),
            None => Ok(self.folder()?.join(name)),
        }
    }

    /// A path as the user should read it: files of the demo by their names in it.
    pub fn name(&self, path: &Path) -> String {
        let inside = self.folder.as_ref().and_then(|folder| path.strip_prefix(folder.path()).ok());
        inside.map_or_else(|| path.display().to_string(), |name| format!("demo/{}", name.display()))
    }

    fn folder(&mut self) -> Result<&Path, OutputError> {
        if self.folder.is_none() {
            let folder = tempfile::Builder::new()
                .prefix("sabine-demo-")
                .tempdir()
                .map_err(|source| OutputError { path: std::env::temp_dir(), source })?;
            for (name, bytes) in FILES {
                let path = folder.path().join(name);
                let unpack = || {
                    std::fs::create_dir_all(path.parent().unwrap_or(folder.path()))?;
                    std::fs::write(&path, bytes)
                };
                unpack().map_err(|source| OutputError { path: path.clone(), source })?;
            }
            self.folder = Some(folder);
        }
        Ok(self.folder.as_ref().map_or(Path::new(""), TempDir::path))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_demo_is_the_fixture() {
        let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
        for (name, bytes) in FILES {
            assert!(
                std::fs::read(fixtures.join(name)).unwrap() == bytes,
                "{name}: copy it anew (fixtures/make.sh)"
            );
        }
    }

    #[test]
    fn the_demo_is_unpacked_named_and_removed() {
        let mut demo = Demo::default();
        let own = Path::new("mine.wav");
        assert_eq!(demo.or(Some(own), "speech/recording.wav").unwrap(), own);
        assert!(demo.folder.is_none(), "nobody asked for it");
        let room = demo.or(None, "room").unwrap();
        assert!(room.join("room.toml").exists() && room.join("ir/talker_corner.wav").exists());
        assert_eq!(demo.name(&room), "demo/room");
        assert_eq!(demo.name(own), "mine.wav");
        drop(demo);
        assert!(!room.exists());
    }
}
