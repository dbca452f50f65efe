//! Which channel of a recording a command takes.

use sabine::acoustics::Channel;

/// `0`, `1`, ... or `mean`.
///
/// # Errors
/// Anything else, in words for the user.
pub fn channel(text: &str) -> Result<Channel, String> {
    match text {
        "mean" => Ok(Channel::Mean),
        index => index
            .parse()
            .map(Channel::Index)
            .map_err(|_| "neither a channel, counted from 0, nor `mean`".to_owned()),
    }
}

/// How the user chooses, to be said where a file has several channels.
pub const HINT: &str = "(--channel 0, --channel mean)";
