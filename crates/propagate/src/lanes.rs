//! Arithmetic on eight or four numbers at once, by the widest instructions that the machine has.

/// Instructions for vectors. Doubles are never fused or approximated, so that each lane holds the bits that scalar code computes; singles may
/// differ in rounding from one implementation to another.
pub(crate) trait Lanes: Copy {
    /// Eight numbers in single precision.
    type Singles: Copy;
    /// Four numbers in double precision.
    type Doubles: Copy;
    /// The outcome of comparing doubles.
    type Mask: Copy;

    fn singles(self, value: f32) -> Self::Singles;
    /// Integers as numbers.
    fn of_bytes(self, values: &[u8; 8]) -> Self::Singles;
    fn to_array(self, a: Self::Singles) -> [f32; 8];
    /// a b + c, rounded once or twice.
    fn mul_add(self, a: Self::Singles, b: Self::Singles, c: Self::Singles) -> Self::Singles;
    /// The second where one is NaN.
    fn least(self, a: Self::Singles, b: Self::Singles) -> Self::Singles;
    /// The second where one is NaN.
    fn most(self, a: Self::Singles, b: Self::Singles) -> Self::Singles;
    /// The lanes where a <= b, as bits.
    fn at_most_bits(self, a: Self::Singles, b: Self::Singles) -> u32;

    fn doubles(self, value: f64) -> Self::Doubles;
    fn load(self, values: &[f64; 4]) -> Self::Doubles;
    /// Single precision, widened.
    fn widened(self, values: &[f32; 4]) -> Self::Doubles;
    fn store(self, a: Self::Doubles) -> [f64; 4];
    fn add(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles;
    fn sub(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles;
    fn mul(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles;
    fn div(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles;
    fn abs(self, a: Self::Doubles) -> Self::Doubles;
    /// a <= b; false where one is NaN.
    fn at_most(self, a: Self::Doubles, b: Self::Doubles) -> Self::Mask;
    /// a < b; false where one is NaN.
    fn below(self, a: Self::Doubles, b: Self::Doubles) -> Self::Mask;
    fn both(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    fn bits(self, a: Self::Mask) -> u32;
}

/// What every machine has: the compiler's choice, two or four lanes at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

impl Lanes for Portable {
    type Singles = wide::f32x8;
    type Doubles = wide::f64x4;
    type Mask = wide::f64x4;

    #[inline(always)]
    fn singles(self, value: f32) -> Self::Singles {
        wide::f32x8::splat(value)
    }

    #[inline(always)]
    fn of_bytes(self, values: &[u8; 8]) -> Self::Singles {
        wide::f32x8::new(values.map(f32::from))
    }

    #[inline(always)]
    fn to_array(self, a: Self::Singles) -> [f32; 8] {
        a.to_array()
    }

    #[inline(always)]
    fn mul_add(self, a: Self::Singles, b: Self::Singles, c: Self::Singles) -> Self::Singles {
        a * b + c
    }

    #[inline(always)]
    fn least(self, a: Self::Singles, b: Self::Singles) -> Self::Singles {
        a.fast_min(b)
    }

    #[inline(always)]
    fn most(self, a: Self::Singles, b: Self::Singles) -> Self::Singles {
        a.fast_max(b)
    }

    #[inline(always)]
    fn at_most_bits(self, a: Self::Singles, b: Self::Singles) -> u32 {
        a.simd_le(b).to_bitmask()
    }

    #[inline(always)]
    fn doubles(self, value: f64) -> Self::Doubles {
        wide::f64x4::splat(value)
    }

    #[inline(always)]
    fn load(self, values: &[f64; 4]) -> Self::Doubles {
        wide::f64x4::new(*values)
    }

    #[inline(always)]
    fn widened(self, values: &[f32; 4]) -> Self::Doubles {
        wide::f64x4::new(values.map(f64::from))
    }

    #[inline(always)]
    fn store(self, a: Self::Doubles) -> [f64; 4] {
        a.to_array()
    }

    #[inline(always)]
    fn add(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles {
        a + b
    }

    #[inline(always)]
    fn sub(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles {
        a - b
    }

    #[inline(always)]
    fn mul(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles {
        a * b
    }

    #[inline(always)]
    fn div(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles {
        a / b
    }

    #[inline(always)]
    fn abs(self, a: Self::Doubles) -> Self::Doubles {
        a.abs()
    }

    #[inline(always)]
    fn at_most(self, a: Self::Doubles, b: Self::Doubles) -> Self::Mask {
        a.simd_le(b)
    }

    #[inline(always)]
    fn below(self, a: Self::Doubles, b: Self::Doubles) -> Self::Mask {
        a.simd_lt(b)
    }

    #[inline(always)]
    fn both(self, a: Self::Mask, b: Self::Mask) -> Self::Mask {
        a & b
    }

    #[inline(always)]
    fn bits(self, a: Self::Mask) -> u32 {
        a.to_bitmask()
    }
}

/// AVX2: all lanes at a time. The token proves that the machine has it.
#[cfg(target_arch = "x86_64")]
impl Lanes for pulp::x86::V3 {
    type Singles = pulp::f32x8;
    type Doubles = pulp::f64x4;
    type Mask = pulp::f64x4;

    #[inline(always)]
    fn singles(self, value: f32) -> Self::Singles {
        self.splat_f32x8(value)
    }

    #[inline(always)]
    fn of_bytes(self, values: &[u8; 8]) -> Self::Singles {
        let bytes = self.sse2._mm_set_epi64x(0, i64::from_le_bytes(*values));
        pulp::cast(self.avx._mm256_cvtepi32_ps(self.avx2._mm256_cvtepu8_epi32(bytes)))
    }

    #[inline(always)]
    fn to_array(self, a: Self::Singles) -> [f32; 8] {
        pulp::cast(a)
    }

    #[inline(always)]
    fn mul_add(self, a: Self::Singles, b: Self::Singles, c: Self::Singles) -> Self::Singles {
        self.mul_add_f32x8(a, b, c)
    }

    #[inline(always)]
    fn least(self, a: Self::Singles, b: Self::Singles) -> Self::Singles {
        pulp::cast(self.avx._mm256_min_ps(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn most(self, a: Self::Singles, b: Self::Singles) -> Self::Singles {
        pulp::cast(self.avx._mm256_max_ps(pulp::cast(a), pulp::cast(b)))
    }

    #[inline(always)]
    fn at_most_bits(self, a: Self::Singles, b: Self::Singles) -> u32 {
        self.avx._mm256_movemask_ps(pulp::cast(self.cmp_le_f32x8(a, b))) as u32
    }

    #[inline(always)]
    fn doubles(self, value: f64) -> Self::Doubles {
        self.splat_f64x4(value)
    }

    #[inline(always)]
    fn load(self, values: &[f64; 4]) -> Self::Doubles {
        pulp::cast(*values)
    }

    #[inline(always)]
    fn widened(self, values: &[f32; 4]) -> Self::Doubles {
        self.convert_f32x4_to_f64x4(pulp::cast(*values))
    }

    #[inline(always)]
    fn store(self, a: Self::Doubles) -> [f64; 4] {
        pulp::cast(a)
    }

    #[inline(always)]
    fn add(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles {
        self.add_f64x4(a, b)
    }

    #[inline(always)]
    fn sub(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles {
        self.sub_f64x4(a, b)
    }

    #[inline(always)]
    fn mul(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles {
        self.mul_f64x4(a, b)
    }

    #[inline(always)]
    fn div(self, a: Self::Doubles, b: Self::Doubles) -> Self::Doubles {
        self.div_f64x4(a, b)
    }

    #[inline(always)]
    fn abs(self, a: Self::Doubles) -> Self::Doubles {
        self.abs_f64x4(a)
    }

    #[inline(always)]
    fn at_most(self, a: Self::Doubles, b: Self::Doubles) -> Self::Mask {
        pulp::cast(self.cmp_le_f64x4(a, b))
    }

    #[inline(always)]
    fn below(self, a: Self::Doubles, b: Self::Doubles) -> Self::Mask {
        pulp::cast(self.cmp_lt_f64x4(a, b))
    }

    #[inline(always)]
    fn both(self, a: Self::Mask, b: Self::Mask) -> Self::Mask {
        self.and_f64x4(a, b)
    }

    #[inline(always)]
    fn bits(self, a: Self::Mask) -> u32 {
        self.avx._mm256_movemask_pd(pulp::cast(a)) as u32
    }
}
