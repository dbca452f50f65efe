//! A gain that moves in a straight line from one value to the next.

/// The gain is `target` after `left` samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ramp {
    target: f32,
    step: f32,
    left: usize,
}

impl Ramp {
    pub fn at(gain: f32) -> Self {
        Self { target: gain, step: 0.0, left: 0 }
    }

    /// The gain `n` samples from now.
    pub fn gain(&self, n: usize) -> f32 {
        self.target - self.step * self.left.saturating_sub(n + 1) as f32
    }

    pub fn advance(&mut self, samples: usize) {
        self.left = self.left.saturating_sub(samples);
    }

    /// Moves to another gain within this many samples, from where the gain is now.
    pub fn aim(&mut self, target: f32, samples: usize) {
        if target != self.target {
            let now = self.target - self.step * self.left as f32;
            *self = Self { target, step: (target - now) / samples as f32, left: samples };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Ramp;

    #[test]
    fn a_ramp_is_straight_and_starts_where_the_last_one_was() {
        let mut ramp = Ramp::at(1.0);
        assert_eq!(ramp.gain(5), 1.0);
        ramp.aim(0.0, 4);
        assert_eq!([0, 1, 2, 3, 4].map(|n| ramp.gain(n)), [0.75, 0.5, 0.25, 0.0, 0.0]);
        ramp.advance(2);
        assert_eq!(ramp.gain(0), 0.25);
        ramp.aim(1.0, 2);
        assert_eq!([0, 1, 2].map(|n| ramp.gain(n)), [0.75, 1.0, 1.0]);
    }
}
