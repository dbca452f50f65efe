//! A test run again in a process of its own, where something goes wrong: the folder cannot be written to, the disk is full, or the
//! process is killed.

use std::collections::BTreeMap;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

const FOLDER: &str = "SABINE_FAULT_FOLDER";
/// The child says this when it has done what it was to do; a child that never ran does not.
const DONE: &str = "the child is done";
/// Size of the full disk, in KiB.
const DISK_KIB: usize = 256;

/// Folder to work in if this process is the child; the tests that only a child runs return at once otherwise.
pub fn folder() -> Option<PathBuf> {
    std::env::var_os(FOLDER).map(PathBuf::from)
}

/// The child's last words.
pub fn done() {
    println!("{DONE}");
}

fn command(wrapper: &[&str], test: &str, folder: &Path) -> Command {
    let program = std::env::current_exe().unwrap();
    let mut words = wrapper.iter().map(Into::into).collect::<Vec<std::ffi::OsString>>();
    words.push(program.into());
    let mut command = Command::new(&words[0]);
    command.args(&words[1..]).args(["--exact", test, "--ignored", "--nocapture"]).env(FOLDER, folder);
    command
}

fn is_root() -> bool {
    std::fs::metadata("/proc/self").is_ok_and(|me| me.uid() == 0)
}

fn check(output: &Output) {
    let text =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && text.contains(DONE), "{text}");
}

/// Runs the test of this name in a folder in which nothing can be made or changed.
#[allow(dead_code)] // each test file uses its part of this one
pub fn in_read_only_folder(test: &str, folder: &Path) {
    // The superuser may write anywhere: the child is nobody.
    let nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"];
    let wrapper: &[&str] = if is_root() { &nobody } else { &[] };
    let folders: Vec<PathBuf> =
        snapshot(folder).into_keys().filter(|path| path.is_dir()).chain([folder.to_owned()]).collect();
    let set = |mode: u32| {
        for folder in &folders {
            std::fs::set_permissions(folder, PermissionsExt::from_mode(mode)).unwrap();
        }
    };
    set(0o555);
    let output = command(wrapper, test, folder).output();
    set(0o755);
    match output {
        Err(error) if is_root() => println!("skipped: no setpriv to become nobody by ({error})"),
        output => check(&output.unwrap()),
    }
}

/// Runs the test of this name on a disk of 256 KiB mounted over the folder; where nothing can be mounted, under a limit on
/// the size of files, which fails in the same place. What the child leaves on the disk only the child can see.
#[allow(dead_code)] // each test file uses its part of this one
pub fn on_full_disk(test: &str, folder: &Path) {
    let mount = format!(
        "mount -t tmpfs -o size={DISK_KIB}k none \"${FOLDER}\" && chmod 777 \"${FOLDER}\" && exec \"$@\""
    );
    let own = if is_root() { "-m" } else { "-rm" };
    let mounted = command(&["unshare", own, "sh", "-c", &mount, "sh"], test, folder).output();
    if let Ok(output) = &mounted
        && String::from_utf8_lossy(&output.stdout).contains("running 1 test")
    {
        return check(output);
    }
    println!("no disk can be mounted here: a limit on the size of files instead");
    let limit = format!("trap '' XFSZ; ulimit -f {}; exec \"$@\"", 2 * DISK_KIB);
    check(&command(&["sh", "-c", &limit, "sh"], test, folder).output().unwrap());
}

/// Runs the test of this name with so much memory and no more, in KiB.
#[allow(dead_code)] // each test file uses its part of this one
pub fn with_memory(test: &str, folder: &Path, kib: usize) {
    let limit = format!("ulimit -v {kib}; exec \"$@\"");
    check(&command(&["sh", "-c", &limit, "sh"], test, folder).output().unwrap());
}

/// Starts the test of this name and kills it, some time after `ready` says that it has begun.
#[allow(dead_code)] // each test file uses its part of this one
pub fn killed(test: &str, folder: &Path, after: Duration, ready: impl Fn() -> bool) {
    struct Killed(Child);
    impl Drop for Killed {
        fn drop(&mut self) {
            let _ = self.0.kill();
            let _ = self.0.wait();
        }
    }
    let mut child = Killed(command(&[], test, folder).stdout(Stdio::null()).spawn().unwrap());
    let start = Instant::now();
    while !ready() {
        assert!(start.elapsed() < Duration::from_secs(60), "the child does not begin");
        assert!(child.0.try_wait().unwrap().is_none(), "the child ended by itself");
        std::thread::sleep(Duration::from_millis(2));
    }
    std::thread::sleep(after);
    assert!(child.0.try_wait().unwrap().is_none(), "the child ended by itself");
}

/// Every file below a folder, with its content.
#[allow(dead_code)] // each test file uses its part of this one
pub fn snapshot(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            // An empty folder is something left behind, too.
            found.insert(path.clone(), Vec::new());
            found.extend(snapshot(&path));
        } else {
            found.insert(path.clone(), std::fs::read(&path).unwrap());
        }
    }
    found
}
