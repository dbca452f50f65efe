//! Random numbers that depend on what they are for, and on nothing else.

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

/// What random numbers are for: each purpose has its own, so that one effect more does not change the others' draws.
#[derive(Clone, Copy)]
pub(crate) enum Purpose {
    Room = 1,
    Places,
    Jitter,
    Signs,
    Floor,
    Gain,
    Level,
    Latency,
    Tail,
    Scattered,
    Particles,
    Background,
    Chirp,
    Effect,
    Panel,
    Axes,
    Order,
}

/// Random numbers of a seed for one purpose, and one of many things that need them.
pub(crate) fn stream(seed: u64, purpose: Purpose, index: usize) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(key(seed, purpose, index))
}

/// Hash of a seed, a purpose and an index.
pub(crate) fn key(seed: u64, purpose: Purpose, index: usize) -> u64 {
    mix(mix(seed ^ (purpose as u64) << 56).wrapping_add(index as u64))
}

/// The finaliser of SplitMix64: every bit of the result depends on every bit of the argument.
pub(crate) fn mix(value: u64) -> u64 {
    let z = value.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// A number of at least 0 and below 1 from the upper bits of a hash.
pub(crate) fn unit(hash: u64) -> f64 {
    (hash >> 11) as f64 / (1u64 << 53) as f64
}
