//! One run of a command: what is expected, and what came of it.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// No case may take longer; most take less than a second.
const MAX_TIME: Duration = Duration::from_secs(120);

/// What a user would expect.
#[derive(Clone, Copy, Debug)]
pub enum Expected {
    /// The job is done, and the output holds these words.
    Done(&'static [&'static str]),
    /// Exit code 1, and the message holds these words.
    Refused(&'static [&'static str]),
    /// Exit code 2: the arguments were not understood.
    Usage,
}

/// A command with its arguments.
pub struct Case {
    pub name: String,
    pub arguments: Vec<OsString>,
    pub expected: Expected,
}

/// What came of a case.
pub struct Outcome {
    code: Option<i32>,
    seconds: f64,
    peak_mib: u64,
    stdout: String,
    stderr: String,
    /// Files and folders in the output folder of a refused command.
    left: Vec<String>,
}

impl Case {
    pub fn new(name: impl Into<String>, arguments: &str, expected: Expected) -> Self {
        Self {
            name: name.into(),
            arguments: arguments.split_whitespace().map(OsString::from).collect(),
            expected,
        }
    }

    /// With arguments that hold spaces or are no Unicode.
    pub fn with(mut self, arguments: &[OsString]) -> Self {
        self.arguments.extend_from_slice(arguments);
        self
    }
}

/// Runs the cases two at a time, each with an output folder of its own (`OUT` among its arguments).
pub fn run_all(folder: &Path, cases: &[Case]) -> Vec<Outcome> {
    let next = Mutex::new(0..cases.len());
    let done = Mutex::new((0..cases.len()).map(|_| None).collect::<Vec<Option<Outcome>>>());
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let Some(i) = next.lock().unwrap().next() else { break };
                    let outcome = run(folder, &cases[i], i);
                    done.lock().unwrap()[i] = Some(outcome);
                }
            });
        }
    });
    done.into_inner().unwrap().into_iter().map(Option::unwrap).collect()
}

fn run(folder: &Path, case: &Case, number: usize) -> Outcome {
    let out = folder.join(format!("out_{number}"));
    let (stdout, stderr) = (folder.join(format!("stdout_{number}")), folder.join(format!("stderr_{number}")));
    let arguments =
        case.arguments.iter().map(|a| if a == "OUT" { out.clone().into_os_string() } else { a.clone() });
    let before = listing(folder);
    let start = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_sabine"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(std::fs::File::create(&stdout).unwrap())
        .stderr(std::fs::File::create(&stderr).unwrap())
        .spawn()
        .unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut peak_mib = 0;
    let code = loop {
        peak_mib = peak_mib.max(peak_memory_mib(&status));
        if let Some(status) = child.try_wait().unwrap() {
            break status.code();
        }
        if start.elapsed() > MAX_TIME {
            child.kill().unwrap();
            child.wait().unwrap();
            break None;
        }
        std::thread::sleep(Duration::from_millis(3));
    };
    let text = |path: &PathBuf| String::from_utf8_lossy(&std::fs::read(path).unwrap()).into_owned();
    let mut left: Vec<String> = listing(&out).into_iter().collect();
    if out.exists() && left.is_empty() {
        left.push("an empty folder".into());
    }
    // Nothing may appear beside the output folder either; what the case that runs at the same time writes begins like these.
    let known = |name: &String| {
        ["out_", "stdout_", "stderr_", ".unfinished-"].iter().any(|start| name.starts_with(start))
    };
    left.extend(listing(folder).difference(&before).filter(|name| !known(name)).cloned());
    Outcome {
        code,
        seconds: start.elapsed().as_secs_f64(),
        peak_mib,
        stdout: text(&stdout),
        stderr: text(&stderr),
        left,
    }
}

fn listing(folder: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect()
}

/// `VmHWM`: the largest resident set so far.
fn peak_memory_mib(status: &str) -> u64 {
    let text = std::fs::read_to_string(status).unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<u64>().ok()).unwrap_or(0) / 1024
}

impl Outcome {
    /// The answer's first line of weight: an error, else a note, else the last line.
    fn answer(&self) -> &str {
        let lines = || self.stderr.lines().chain(self.stdout.lines()).filter(|line| !line.trim().is_empty());
        let of = |start: &str| lines().find(|line| line.starts_with(start));
        of("error").or_else(|| of("note")).or_else(|| lines().next_back()).unwrap_or("")
    }

    /// A row of the table.
    pub fn row(&self, case: &Case) -> String {
        let code = self.code.map_or("killed".to_owned(), |code| code.to_string());
        let answer: String = self.answer().replace('|', "\\|").chars().take(160).collect();
        format!(
            "| {} | {code} | {:.1} | {} | {answer} |",
            case.name.replace('|', "\\|"),
            self.seconds,
            self.peak_mib
        )
    }

    /// In what the outcome is not what a user would expect.
    pub fn faults(&self, case: &Case, max_mib: u64) -> Vec<String> {
        let mut faults = Vec::new();
        let all = format!("{}{}", self.stdout, self.stderr);
        if all.contains("panicked") || self.code.is_none() {
            faults.push("it panicked, was killed or took too long".to_owned());
        }
        if self.peak_mib > max_mib {
            faults.push(format!("{} MiB", self.peak_mib));
        }
        let (code, words) = match case.expected {
            Expected::Done(words) => (0, words),
            Expected::Refused(words) => (1, words),
            Expected::Usage => (2, &[][..]),
        };
        if self.code != Some(code) {
            faults.push(format!("exit {:?} in place of {code}", self.code));
        }
        for word in words.iter().filter(|word| !all.contains(**word)) {
            faults.push(format!("`{word}` is not said"));
        }
        if code != 0 && !self.left.is_empty() {
            faults.push(format!("left {:?}", self.left));
        }
        faults.into_iter().map(|fault| format!("{}: {fault}: {}", case.name, self.answer())).collect()
    }
}
