//! The choice of vector instructions at run time.

use crate::lanes::{Lanes, Portable};

/// Instructions that this machine has.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Instructions {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
}

/// A computation that any instructions serve.
pub(crate) trait Work {
    type Output;

    /// Must be inlined, or it is compiled for the least machine.
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

impl Instructions {
    /// Everything that this machine has, the best last.
    pub fn all() -> Vec<Self> {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = pulp::x86::V3::try_new() {
            return vec![Self::Portable, Self::Avx2(avx2)];
        }
        vec![Self::Portable]
    }

    /// The best that this machine has.
    pub fn best() -> Self {
        Self::all().pop().unwrap_or(Self::Portable)
    }

    #[inline]
    pub fn run<W: Work>(self, work: W) -> W::Output {
        match self {
            Self::Portable => work.run(Portable),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(avx2) => avx2.vectorize(Compiled { avx2, work }),
        }
    }
}

/// Work that is compiled for AVX2.
#[cfg(target_arch = "x86_64")]
struct Compiled<W> {
    avx2: pulp::x86::V3,
    work: W,
}

#[cfg(target_arch = "x86_64")]
impl<W: Work> pulp::NullaryFnOnce for Compiled<W> {
    type Output = W::Output;

    #[inline(always)]
    fn call(self) -> W::Output {
        self.work.run(self.avx2)
    }
}
