//! Why a command did not do its job.

/// Any error of the libraries or of a command: a program's last words to its user, never matched on.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;
