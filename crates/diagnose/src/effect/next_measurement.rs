//! Measurements that tell causes apart.

use std::fmt;

/// What to measure, or to look up, next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum NextMeasurement {
    /// A click at both ends of the excitation shows the clock; a thermometer the speed of sound.
    ClockOrThermometer,
    /// Again in other air.
    OtherHumidity,
    /// Again, louder and longer.
    LouderAndLonger,
    /// Again with openings closed.
    DoorsClosed,
    /// A longer recording, and silence.
    LongerWithSilence,
    /// Again with the source turned.
    TurnedSource,
    /// The excitation itself beside the microphones.
    Loopback,
    /// Distances by other means than sound.
    Distances,
    /// From places to walls and floor, by other means than sound.
    DistancesToWalls,
    /// Again with channels exchanged.
    ExchangedChannel,
    /// Again, quieter.
    Quieter,
    /// Along the walls, with the source in another place.
    AlongWalls,
    /// Again with what may be open closed.
    PatchClosed,
    /// Again without what stands in the room.
    ObjectsRemoved,
    /// Again with the source in another place.
    OtherSourcePlace,
    /// More positions, some close to the walls.
    MorePositions,
    /// More positions, and the source in another place.
    MorePositionsAndSource,
    /// Anything else, in one sentence.
    Other(&'static str),
}

impl fmt::Display for NextMeasurement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ClockOrThermometer => {
                "Record a loopback click at the beginning and end of the sweep, or read a thermometer in the room."
            }
            Self::OtherHumidity => {
                "Measure again at another humidity (a morning and an evening), or read a hygrometer in the room."
            }
            Self::LouderAndLonger => {
                "Measure again 10 dB louder and with a longer sweep: noise stays where it is, a coupled volume rises with the source."
            }
            Self::DoorsClosed => "Measure again with the doors and openings of the room closed.",
            Self::LongerWithSilence => "Record a longer response, and some seconds of silence before it.",
            Self::TurnedSource => "Turn the loudspeaker by 90 degrees and measure again.",
            Self::Loopback => {
                "Record a loopback of the excitation beside the microphones: it shows the latency."
            }
            Self::Distances => {
                "Measure two distances with a laser: between the far walls, and from the loudspeaker to a microphone."
            }
            Self::DistancesToWalls => {
                "Measure with a laser how far the loudspeaker and one microphone are from two walls at right angles and from the floor."
            }
            Self::ExchangedChannel => {
                "Exchange the microphone's cable and channel with a neighbour's and measure again."
            }
            Self::Quieter => {
                "Turn the loudspeaker down by 10 dB and measure again: distortion falls faster than the sound."
            }
            Self::AlongWalls => {
                "Measure close to the walls and along them, where sound grazes, with the source in another place."
            }
            Self::PatchClosed => {
                "Close what may be open and measure again, or measure where other first reflections meet that wall."
            }
            Self::ObjectsRemoved => "Take out (or cover) what stands in the room and measure again.",
            Self::OtherSourcePlace => {
                "Measure with the source in another place: standing waves change with it, loudspeakers and walls do not."
            }
            Self::MorePositions => "Measure at more positions, some of them close to the walls.",
            Self::Other(text) => text,
            Self::MorePositionsAndSource => "Measure at more positions, with the source in another place.",
        })
    }
}
