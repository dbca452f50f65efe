//! How well a fit fits, in one sentence.

/// Deviation of T30 that is heard: one just-noticeable difference (ISO 3382-1, annex A).
const HEARD: f64 = 0.05;

/// What was fitted, and to what.
pub struct Aim {
    /// The quantity: `T30`.
    pub quantity: &'static str,
    /// What it should meet: `the response`.
    pub of: &'static str,
}

/// An octave: its centre in Hz, what is wanted and what is reached in seconds, and whether the fit has converged.
pub struct Octave {
    pub hz: f64,
    pub wanted_s: Option<f64>,
    pub reached_s: Option<f64>,
    pub converged: bool,
}

/// For instance "Fitted T30 within 2.1 % of the response in octaves 125 Hz to 4 kHz; 8 kHz is 11 % long."
pub fn in_one_sentence(aim: &Aim, octaves: &[Octave]) -> String {
    let Aim { quantity, of } = aim;
    let off = |o: &Octave| Some(o.reached_s? / o.wanted_s? - 1.0).filter(|_| o.converged);
    let met: Vec<bool> = octaves.iter().map(|o| off(o).is_some_and(|off| off.abs() <= HEARD)).collect();
    let worst = octaves.iter().zip(&met).filter(|(_, met)| **met).filter_map(|(o, _)| off(o));
    let worst = worst.fold(0.0f64, |worst, off| worst.max(off.abs()));
    let mut parts = vec![if met.contains(&true) {
        format!("Fitted {quantity} within {:.1} % of {of} in {}", 100.0 * worst, in_octaves(octaves, &met))
    } else {
        format!("Fitted {quantity} is in no octave within {:.0} % of {of}", 100.0 * HEARD)
    }];
    for octave in octaves.iter().zip(&met).filter(|(_, met)| !**met).map(|(octave, _)| octave) {
        let name = hertz(octave.hz);
        parts.push(match off(octave) {
            _ if !octave.converged => format!("{name} has not converged"),
            Some(off) => {
                format!("{name} is {:.0} % {}", 100.0 * off.abs(), if off > 0.0 { "long" } else { "short" })
            }
            None if octave.wanted_s.is_none() => format!("{name} cannot be read from {of}"),
            None => format!("{name} cannot be read from the simulation"),
        });
    }
    parts.join("; ") + "."
}

/// The octaves that count, runs of them joined: "octaves 125 Hz, 500 Hz to 4 kHz".
fn in_octaves(octaves: &[Octave], counts: &[bool]) -> String {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for i in (0..octaves.len()).filter(|&i| counts[i]) {
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == i => *last = i,
            _ => runs.push((i, i)),
        }
    }
    let several = runs.len() > 1 || runs.iter().any(|(first, last)| first != last);
    let run = |(first, last): &(usize, usize)| {
        let (from, to) = (hertz(octaves[*first].hz), hertz(octaves[*last].hz));
        match last - first {
            0 => from,
            1 => format!("{from} and {to}"),
            _ => format!("{from} to {to}"),
        }
    };
    let runs: Vec<String> = runs.iter().map(run).collect();
    format!("{} {}", if several { "octaves" } else { "the octave" }, runs.join(", "))
}

fn hertz(hz: f64) -> String {
    if hz >= 1000.0 { format!("{} kHz", hz / 1000.0) } else { format!("{hz} Hz") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sentence(reached_s: [Option<f64>; 4], converged: [bool; 4]) -> String {
        let octaves: Vec<Octave> = (0..4)
            .map(|i| Octave {
                hz: [1000.0, 2000.0, 4000.0, 8000.0][i],
                wanted_s: Some(1.0),
                reached_s: reached_s[i],
                converged: converged[i],
            })
            .collect();
        in_one_sentence(&Aim { quantity: "T30", of: "the response" }, &octaves)
    }

    #[test]
    fn it_says_what_is_met_and_by_how_much_the_rest_is_missed() {
        assert_eq!(
            sentence([Some(1.01), Some(0.979), Some(1.0), Some(1.11)], [true; 4]),
            "Fitted T30 within 2.1 % of the response in octaves 1 kHz to 4 kHz; 8 kHz is 11 % long."
        );
        assert_eq!(
            sentence([Some(1.01), Some(0.8), None, Some(1.0)], [true; 4]),
            "Fitted T30 within 1.0 % of the response in octaves 1 kHz, 8 kHz; 2 kHz is 20 % short; \
             4 kHz cannot be read from the simulation."
        );
    }

    #[test]
    fn an_octave_that_has_not_converged_is_not_met_by_chance() {
        assert_eq!(
            sentence([Some(1.0), Some(1.0), Some(1.3), Some(1.0)], [false, true, true, false]),
            "Fitted T30 within 0.0 % of the response in the octave 2 kHz; 1 kHz has not converged; \
             4 kHz is 30 % long; 8 kHz has not converged."
        );
        assert!(sentence([Some(1.3); 4], [true; 4]).starts_with("Fitted T30 is in no octave within 5 % of"));
    }
}
