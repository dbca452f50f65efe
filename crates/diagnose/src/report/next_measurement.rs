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
            Self::MorePositionsAndSource => "Measure at more positions, with the source in another place.",
        })
    }
}

/// What would tell two effects of the catalogue apart.
///
/// ```
/// use sabine_diagnose::{NextMeasurement, discriminating_measurement};
/// assert_eq!(discriminating_measurement("sampling_clock", "sound_speed"), NextMeasurement::ClockOrThermometer);
/// assert_eq!(discriminating_measurement("coupled_volume", "background_noise"), discriminating_measurement("background_noise", "coupled_volume"));
/// ```
pub fn discriminating_measurement(a: &str, b: &str) -> NextMeasurement {
    let is = |x: &str, y: &str| (a == x && b == y) || (a == y && b == x);
    let has = |x: &str| a == x || b == x;
    if is("sound_speed", "sampling_clock") {
        return NextMeasurement::ClockOrThermometer;
    }
    if is("air_absorption", "surface_absorption") || is("air_absorption", "scattering") {
        return NextMeasurement::OtherHumidity;
    }
    if is("coupled_volume", "background_noise") {
        return NextMeasurement::LouderAndLonger;
    }
    // The first of these that is among the two.
    let by_effect = [
        ("coupled_volume", NextMeasurement::DoorsClosed),
        ("background_noise", NextMeasurement::LongerWithSilence),
        ("truncation", NextMeasurement::LongerWithSilence),
        ("source_directivity", NextMeasurement::TurnedSource),
        ("time_zero", NextMeasurement::Loopback),
        ("position_error", NextMeasurement::Distances),
        ("room_dimensions", NextMeasurement::Distances),
        ("sound_speed", NextMeasurement::Distances),
        ("channel_fault", NextMeasurement::ExchangedChannel),
        ("nonlinear_distortion", NextMeasurement::Quieter),
        ("angle_dependent_absorption", NextMeasurement::AlongWalls),
        ("open_patch", NextMeasurement::PatchClosed),
        ("extra_reflector", NextMeasurement::ObjectsRemoved),
        ("room_modes", NextMeasurement::OtherSourcePlace),
        ("scattering", NextMeasurement::MorePositions),
    ];
    let found = by_effect.iter().find(|(effect, _)| has(effect));
    found.map_or(NextMeasurement::MorePositionsAndSource, |(_, measurement)| *measurement)
}
