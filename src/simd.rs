//! AVX2 where the processor has it: registers of 32 bytes, without `unsafe` of ours.
//!
//! `pulp` proves by a value of type `V3` that the instructions are there, and compiles what is inlined
//! into [`with_avx2`] for them.

use core::arch::x86_64::__m256i;

use pulp::x86::V3;

/// A register.
pub(crate) type Lanes = __m256i;

/// What can be done with registers; having one proves that the processor can.
#[derive(Clone, Copy)]
pub(crate) struct Avx2(V3);

/// Runs `work`, compiled for AVX2 as far as it is inlined; `None` on a processor without.
///
/// Which processor it is, is found out once per process; after that, asking is a load and a compare.
#[inline(always)]
pub(crate) fn with_avx2<R>(work: impl FnOnce(Avx2) -> R) -> Option<R> {
    let simd = V3::try_new()?;
    Some(simd.vectorize(
        #[inline(always)]
        || work(Avx2(simd)),
    ))
}

#[cfg_attr(not(feature = "ikeya"), allow(dead_code, reason = "UCP needs few of them"))]
impl Avx2 {
    /// 32 bytes from `at` on; zeros where the block has less.
    #[inline(always)]
    pub(crate) fn load<const N: usize>(self, block: &[u8; N], at: usize) -> Lanes {
        let bytes = block.get(at..).and_then(<[u8]>::first_chunk::<32>);
        pulp::cast(bytes.copied().unwrap_or_default())
    }

    /// Four words.
    #[inline(always)]
    pub(crate) fn words(self, words: [u64; 4]) -> Lanes {
        pulp::cast(words)
    }

    /// The same word in each of four lanes.
    #[inline(always)]
    pub(crate) fn each(self, word: u64) -> Lanes {
        self.words([word; 4])
    }

    /// 0xFF where a byte is `byte`, 0 elsewhere.
    #[inline(always)]
    pub(crate) fn is(self, lanes: Lanes, byte: u8) -> Lanes {
        self.0.avx2._mm256_cmpeq_epi8(lanes, self.bytes(byte))
    }

    /// 0xFF where a byte is in `least..=most`, 0 elsewhere.
    #[inline(always)]
    pub(crate) fn is_in(self, lanes: Lanes, least: u8, most: u8) -> Lanes {
        let above = self.0.avx2._mm256_sub_epi8(lanes, self.bytes(least));
        let capped = self.0.avx2._mm256_min_epu8(above, self.bytes(most - least));
        self.0.avx2._mm256_cmpeq_epi8(above, capped)
    }

    /// 0xFFFF where 16 bits are zero, 0 elsewhere.
    #[inline(always)]
    pub(crate) fn is_zero_u16(self, lanes: Lanes) -> Lanes {
        self.0.avx2._mm256_cmpeq_epi16(lanes, self.each(0))
    }

    /// All ones where 32 bits are the same in both, 0 elsewhere.
    #[inline(always)]
    pub(crate) fn is_equal_u32(self, a: Lanes, b: Lanes) -> Lanes {
        self.0.avx2._mm256_cmpeq_epi32(a, b)
    }

    #[inline(always)]
    pub(crate) fn and(self, a: Lanes, b: Lanes) -> Lanes {
        self.0.avx2._mm256_and_si256(a, b)
    }

    #[inline(always)]
    pub(crate) fn or(self, a: Lanes, b: Lanes) -> Lanes {
        self.0.avx2._mm256_or_si256(a, b)
    }

    #[inline(always)]
    pub(crate) fn xor(self, a: Lanes, b: Lanes) -> Lanes {
        self.0.avx2._mm256_xor_si256(a, b)
    }

    /// The low half of each word of `a`, and that of `b` as the high half.
    #[inline(always)]
    pub(crate) fn low_halves(self, a: Lanes, b: Lanes) -> Lanes {
        let b = self.0.avx2._mm256_slli_epi64::<32>(b);
        self.0.avx2._mm256_blend_epi32::<0b1010_1010>(a, b)
    }

    /// Shifts each of four words right.
    #[inline(always)]
    pub(crate) fn shr<const BITS: i32>(self, lanes: Lanes) -> Lanes {
        self.0.avx2._mm256_srli_epi64::<BITS>(lanes)
    }

    /// Shifts each of four words left by as many bits as the lane of `bits` says.
    #[inline(always)]
    pub(crate) fn shl_by(self, lanes: Lanes, bits: Lanes) -> Lanes {
        self.0.avx2._mm256_sllv_epi64(lanes, bits)
    }

    /// A bit for each of 64 bytes, the first one's lowest: set where all bits of the byte are.
    #[inline(always)]
    pub(crate) fn places(self, [first, second]: [Lanes; 2]) -> u64 {
        u64::from(self.mask(first)) | u64::from(self.mask(second)) << 32
    }

    /// A bit for each of 32 bytes.
    #[inline(always)]
    pub(crate) fn mask(self, lanes: Lanes) -> u32 {
        self.0.avx2._mm256_movemask_epi8(lanes).cast_unsigned()
    }

    #[inline(always)]
    fn bytes(self, byte: u8) -> Lanes {
        pulp::cast([byte; 32])
    }
}
