//! A progress bar in the terminal for whatever reports progress.

use indicatif::{ProgressBar, ProgressStyle};
use sabine::acoustics::Observer;
use std::ops::ControlFlow;
use std::sync::Mutex;

/// Draws one bar for each stage on standard error; silent where that is not a terminal.
pub struct Bar {
    current: Mutex<Option<(String, ProgressBar)>>,
}

impl Bar {
    /// No stage yet.
    #[allow(clippy::new_without_default)] // there is nothing to configure
    pub fn new() -> Self {
        Self { current: Mutex::new(None) }
    }

    /// Closes the last stage's bar.
    pub fn finish(&self) {
        if let Ok(mut current) = self.current.lock()
            && let Some((_, bar)) = current.take()
        {
            bar.finish();
        }
    }
}

impl Observer for Bar {
    fn progress(&self, stage: &str, done: u64, total: u64) -> ControlFlow<()> {
        let Ok(mut current) = self.current.lock() else { return ControlFlow::Continue(()) };
        if current.as_ref().is_none_or(|(name, _)| name != stage) {
            if let Some((_, bar)) = current.take() {
                bar.finish();
            }
            let bar = ProgressBar::new(total);
            let style = ProgressStyle::with_template("{msg:28} {bar:30} {pos}/{len}  {per_sec}  {eta} left");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar.set_message(stage.to_owned());
            *current = Some((stage.to_owned(), bar));
        }
        if let Some((_, bar)) = current.as_ref() {
            bar.set_length(total);
            bar.set_position(done);
        }
        ControlFlow::Continue(())
    }
}
