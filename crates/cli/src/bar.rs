//! How far work has come: a bar in the terminal, or a line now and then in a log; and how it is stopped.

use crate::stop;
use indicatif::{ProgressBar, ProgressStyle};
use sabine::acoustics::Observer;
use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::ops::ControlFlow;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Time between two lines of a log.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Draws one bar for each stage on standard error. Where that is not a terminal, a line tells every ten seconds how far work has come: a log
/// shows what happens.
pub struct Bar {
    started: Instant,
    place: Arc<Mutex<Place>>,
    drawn: Mutex<Option<ProgressBar>>,
    /// Ends the log when it goes.
    log: Mutex<Option<Sender<()>>>,
    /// Whether signals stop the work, and when it must be done.
    stops: Option<Option<Duration>>,
}

/// How far work has come.
#[derive(Default)]
struct Place {
    stage: String,
    done: u64,
    total: u64,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.stage.as_str(), self.total) {
            ("", _) => f.write_str("the beginning"),
            (stage, 0) => f.write_str(stage),
            (stage, total) => write!(f, "{stage} ({} of {total})", self.done),
        }
    }
}

/// A poisoned lock holds what it held: these are words about progress.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Bar {
    /// No stage yet.
    #[allow(clippy::new_without_default)] // there is nothing to configure
    pub fn new() -> Self {
        let (started, place) = (Instant::now(), Arc::default());
        let log =
            (!io::stderr().is_terminal()).then(|| log(io::stderr(), LINE_EVERY, started, Arc::clone(&place)));
        Self { started, place, drawn: Mutex::new(None), log: Mutex::new(log), stops: None }
    }

    /// Work that Ctrl-C, a request to terminate, or the end of the time limit stops at its next step, so that it can say how far it came.
    ///
    /// # Errors
    /// As [`stop::listen`].
    pub fn stopped_on_request(time_limit: Option<Duration>) -> Result<Self, stop::NoSignals> {
        stop::listen()?;
        Ok(Self { stops: Some(time_limit), ..Self::new() })
    }

    /// Closes the last stage's bar.
    pub fn finish(&self) {
        if let Some(bar) = locked(&self.drawn).take() {
            bar.finish();
        }
        *locked(&self.log) = None;
    }

    /// How far work came that was stopped, in words; none if it was not stopped.
    pub fn stopped(&self) -> Option<String> {
        let cause = self.cause()?;
        let spent_s = self.started.elapsed().as_secs_f64();
        Some(format!("stopped {cause} after {spent_s:.0} s, during {}", locked(&self.place)))
    }

    /// Why work is to stop.
    fn cause(&self) -> Option<&'static str> {
        match self.stops? {
            _ if stop::is_requested() => Some("on request"),
            Some(limit) if self.started.elapsed() > limit => Some("by the time limit"),
            _ => None,
        }
    }
}

impl Observer for Bar {
    fn progress(&self, stage: &str, done: u64, total: u64) -> ControlFlow<()> {
        if self.cause().is_some() {
            return ControlFlow::Break(());
        }
        let is_new = {
            let mut place = locked(&self.place);
            let is_new = place.stage != stage;
            *place = Place { stage: stage.to_owned(), done, total };
            is_new
        };
        let mut drawn = locked(&self.drawn);
        if is_new {
            if let Some(bar) = drawn.take() {
                bar.finish();
            }
            let bar = ProgressBar::new(total);
            let style = ProgressStyle::with_template("{msg:28} {bar:30} {pos}/{len}  {per_sec}  {eta} left");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar.set_message(stage.to_owned());
            *drawn = Some(bar);
        }
        if let Some(bar) = drawn.as_ref() {
            bar.set_length(total);
            bar.set_position(done);
        }
        ControlFlow::Continue(())
    }
}

/// Writes a line at once in a while, also during steps that take long, until the sender goes.
fn log(
    mut to: impl Write + Send + 'static,
    every: Duration,
    started: Instant,
    place: Arc<Mutex<Place>>,
) -> Sender<()> {
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        while receiver.recv_timeout(every) == Err(RecvTimeoutError::Timeout) {
            let line = format!("{:5.0} s: {}\n", started.elapsed().as_secs_f64(), locked(&place));
            // Whoever closed standard error does not read it.
            if to.write_all(line.as_bytes()).is_err() {
                return;
            }
        }
    });
    sender
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a log was told, as others see it.
    #[derive(Clone, Default)]
    struct Told(Arc<Mutex<Vec<u8>>>);

    impl Write for Told {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            locked(&self.0).write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Told {
        fn text(&self) -> String {
            String::from_utf8_lossy(&locked(&self.0)).into_owned()
        }
    }

    #[test]
    fn a_log_tells_the_stage_again_and_again_and_ends_with_the_work() {
        let (told, place) = (Told::default(), Arc::default());
        let sender = log(told.clone(), Duration::from_millis(5), Instant::now(), Arc::clone(&place));
        let waits_for = |words: &str| {
            let patience = Instant::now();
            while !told.text().contains(words) {
                assert!(patience.elapsed() < Duration::from_secs(20), "{}", told.text());
                std::thread::sleep(Duration::from_millis(2));
            }
        };
        waits_for("s: the beginning\n");
        *locked(&place) = Place { stage: "tracing".to_owned(), done: 3, total: 12 };
        waits_for("s: tracing (3 of 12)\n");
        drop(sender);
        let patience = Instant::now();
        // The thread holds one of the two counts until it ends.
        while Arc::strong_count(&told.0) > 1 {
            assert!(patience.elapsed() < Duration::from_secs(20), "the log goes on");
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    #[test]
    fn work_stops_at_the_time_limit_and_says_where() {
        let bar = Bar { stops: Some(Some(Duration::from_secs(3600))), ..Bar::new() };
        assert!(bar.progress("tracing", 1, 4).is_continue());
        assert_eq!(bar.stopped(), None);
        let bar = Bar { stops: Some(Some(Duration::ZERO)), ..bar };
        assert!(bar.progress("tracing", 2, 4).is_break());
        assert_eq!(
            bar.stopped().as_deref(),
            Some("stopped by the time limit after 0 s, during tracing (1 of 4)")
        );
        // Most commands end at once, as their shell ends them.
        let bar = Bar { stops: None, ..bar };
        assert!(bar.progress("tracing", 2, 4).is_continue());
    }
}
