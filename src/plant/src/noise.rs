//! Gaussian measurement noise as a pure function of seed and tick.
//!
//! Because nothing is carried from tick to tick, a plant restored to an earlier time draws the
//! same noise again, and a saved plant state needs no generator inside.

use chacha20::ChaCha8Rng;
use chacha20::rand_core::{SeedableRng, TryRng};
use core::convert::Infallible;
use rand_distr::{Distribution, StandardNormal};
use row::Row;

/// Fills `out` with independent standard normal numbers belonging to `tick`.
pub fn standard_normal(seed: u64, tick: u64, out: &mut [f64]) {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(tick);
    for value in out {
        *value = StandardNormal.sample(&mut generator);
    }
}

/// Numbers that one block of the cipher is enough for.
const IN_A_BLOCK: usize = 8;

/// [`standard_normal`] for one seed, prepared: the same numbers to the bit for a quarter of the work.
///
/// The generator makes four blocks of the cipher at a time, of which a sample needs one; here one is made
/// for each of two ticks, side by side, since each step of the cipher waits for the one before it. The usual draw of the ziggurat is one product and one comparison; where a
/// number needs another one, all of the tick are drawn by [`standard_normal`].
#[derive(Clone, Debug)]
pub struct Noise {
    seed: u64,
    /// The cipher's constants and key, four words a row.
    rows: [[u32; 4]; 3],
    /// Width of each layer of the ziggurat, and zero beyond the last.
    widths: Box<[f64; 257]>,
}

impl Noise {
    /// Prepares the noise of a seed.
    pub fn new(seed: u64) -> Self {
        let key = ChaCha8Rng::seed_from_u64(seed).get_seed();
        let word = |at: usize| {
            key.as_chunks::<4>()
                .0
                .get(at)
                .map_or(0, |&bytes| u32::from_le_bytes(bytes))
        };
        let row = |first: usize| -> [u32; 4] { core::array::from_fn(|at| word(first + at)) };
        let width = |layer: usize| -> f64 {
            match layer {
                256 => 0.0,
                _ => {
                    let half: f64 = StandardNormal.sample(&mut Layer(Some(layer as u64)));
                    2.0 * half
                }
            }
        };
        Self {
            seed,
            rows: [CONSTANTS, row(0), row(4)],
            widths: Box::new(core::array::from_fn(width)),
        }
    }

    /// Fills the first of `out` with independent standard normal numbers belonging to `tick`, the second with
    /// those of the next.
    pub fn draw(&self, tick: u64, out: [&mut [f64]; 2]) {
        let ticks = [tick, tick.wrapping_add(1)];
        let blocks = self.blocks(ticks);
        for ((tick, bits), out) in ticks.into_iter().zip(blocks).zip(out) {
            if !self.draw_usual(bits, out) {
                standard_normal(self.seed, tick, out);
            }
        }
    }

    /// The numbers of a block, where one is enough and each is its first draw; says whether that is so.
    #[inline]
    fn draw_usual(&self, bits: [u64; IN_A_BLOCK], out: &mut [f64]) -> bool {
        if out.len() > IN_A_BLOCK {
            return false;
        }
        let mut usual = true;
        for (value, bits) in out.iter_mut().zip(bits) {
            let layer = (bits & 0xff) as usize;
            let &[width, inner] = match self.widths.get(layer..layer + 2) {
                Some([width, inner]) => &[*width, *inner],
                _ => &[0.0; 2],
            };
            // From the upper 52 bits a number in [2, 4), less 3.
            let share = f64::from_bits((bits >> 12) | (1024 << 52)) - 3.0;
            *value = share * width;
            usual &= value.abs() < inner;
        }
        usual
    }

    /// The first block of ChaCha with eight rounds of each of these streams, in words of 64 bits.
    #[inline]
    fn blocks(&self, streams: [u64; 2]) -> [[u64; IN_A_BLOCK]; 2] {
        // SAFETY: every processor that this is compiled for has these instructions.
        #[cfg_attr(
            not(target_arch = "x86_64"),
            expect(unused_unsafe, reason = "none are asked for")
        )]
        unsafe {
            self.rounds(streams)
        }
    }

    #[inline]
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "sse2"))]
    fn rounds(&self, streams: [u64; 2]) -> [[u64; IN_A_BLOCK]; 2] {
        let [constants, low, high] = self.rows;
        let (constants, low, high) = (Row::of(constants), Row::of(low), Row::of(high));
        let start = streams.map(|stream| {
            let counters = [0, 0, stream as u32, (stream >> 32) as u32];
            [constants, low, high, Row::of(counters)]
        });
        let mut states = start;
        for _ in 0..4 {
            for state in &mut states {
                let [a, b, c, d] = quarters(*state);
                let (b, c, d) = (b.turned::<0x39>(), c.turned::<0x4e>(), d.turned::<0x93>());
                let [a, b, c, d] = quarters([a, b, c, d]);
                let (b, c, d) = (b.turned::<0x93>(), c.turned::<0x4e>(), d.turned::<0x39>());
                *state = [a, b, c, d];
            }
        }
        let mut blocks = [[0; IN_A_BLOCK]; 2];
        for ((words, state), start) in blocks.iter_mut().zip(states).zip(start) {
            let rows = state.into_iter().zip(start);
            for (two, (row, start)) in words.as_chunks_mut::<2>().0.iter_mut().zip(rows) {
                *two = row.plus(start).words();
            }
        }
        blocks
    }
}

/// "expand 32-byte k"
const CONSTANTS: [u32; 4] = [0x6170_7865, 0x3320_646e, 0x7962_2d32, 0x6b20_6574];

/// The quarter round of every column.
#[inline]
#[cfg_attr(target_arch = "x86_64", target_feature(enable = "sse2"))]
fn quarters([mut a, mut b, mut c, mut d]: [Row; 4]) -> [Row; 4] {
    a = a.plus(b);
    d = d.mixed::<16, 16>(a);
    c = c.plus(d);
    b = b.mixed::<12, 20>(c);
    a = a.plus(b);
    d = d.mixed::<8, 24>(a);
    c = c.plus(d);
    b = b.mixed::<7, 25>(c);
    [a, b, c, d]
}

/// Four words of the cipher's state, worked on side by side.
#[cfg(target_arch = "x86_64")]
mod row {
    use core::arch::x86_64::{
        __m128i, _mm_add_epi32, _mm_cvtsi128_si64, _mm_or_si128, _mm_setr_epi32, _mm_shuffle_epi32,
        _mm_slli_epi32, _mm_srli_epi32, _mm_unpackhi_epi64, _mm_xor_si128,
    };

    #[derive(Clone, Copy)]
    pub(super) struct Row(__m128i);

    impl Row {
        #[inline]
        #[target_feature(enable = "sse2")]
        pub(super) fn of(words: [u32; 4]) -> Self {
            let [a, b, c, d] = words.map(u32::cast_signed);
            Self(_mm_setr_epi32(a, b, c, d))
        }

        #[inline]
        #[target_feature(enable = "sse2")]
        pub(super) fn words(self) -> [u64; 2] {
            let high = _mm_unpackhi_epi64(self.0, self.0);
            [
                _mm_cvtsi128_si64(self.0).cast_unsigned(),
                _mm_cvtsi128_si64(high).cast_unsigned(),
            ]
        }

        #[inline]
        #[target_feature(enable = "sse2")]
        pub(super) fn plus(self, other: Self) -> Self {
            Self(_mm_add_epi32(self.0, other.0))
        }

        /// `self ^ other`, rotated to the left by `LEFT`, which is to the right by `RIGHT`.
        #[inline]
        #[target_feature(enable = "sse2")]
        pub(super) fn mixed<const LEFT: i32, const RIGHT: i32>(self, other: Self) -> Self {
            let both = _mm_xor_si128(self.0, other.0);
            let (left, right) = (_mm_slli_epi32::<LEFT>(both), _mm_srli_epi32::<RIGHT>(both));
            Self(_mm_or_si128(left, right))
        }

        /// The words in another order: two bits of `ORDER` for each, from the lowest.
        #[inline]
        #[target_feature(enable = "sse2")]
        pub(super) fn turned<const ORDER: i32>(self) -> Self {
            Self(_mm_shuffle_epi32::<ORDER>(self.0))
        }
    }
}

/// The same, one after the other.
#[cfg(not(target_arch = "x86_64"))]
mod row {
    #[derive(Clone, Copy)]
    pub(super) struct Row([u32; 4]);

    impl Row {
        #[inline(always)]
        pub(super) fn of(words: [u32; 4]) -> Self {
            Self(words)
        }

        #[inline(always)]
        pub(super) fn words(self) -> [u64; 2] {
            let [a, b, c, d] = self.0.map(u64::from);
            [b << 32 | a, d << 32 | c]
        }

        #[inline(always)]
        pub(super) fn plus(self, other: Self) -> Self {
            Self(core::array::from_fn(|k| self.0[k].wrapping_add(other.0[k])))
        }

        /// `self ^ other`, rotated to the left by `LEFT`, which is to the right by `RIGHT`.
        #[inline(always)]
        pub(super) fn mixed<const LEFT: i32, const RIGHT: i32>(self, other: Self) -> Self {
            const { assert!(LEFT + RIGHT == 32, "a rotation") };
            Self(core::array::from_fn(|k| {
                (self.0[k] ^ other.0[k]).rotate_left(LEFT as u32)
            }))
        }

        /// The words in another order: two bits of `ORDER` for each, from the lowest.
        #[inline(always)]
        pub(super) fn turned<const ORDER: i32>(self) -> Self {
            Self(core::array::from_fn(|k| {
                self.0[(ORDER >> (2 * k) & 3) as usize]
            }))
        }
    }
}

/// A source of bits that leads the ziggurat half way across one layer, and accepts it there.
struct Layer(Option<u64>);

impl TryRng for Layer {
    type Error = Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        self.try_next_u64().map(|bits| bits as u32)
    }

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        /// The upper 52 bits of 3.5, which makes a share of one half.
        const HALF: u64 = 0xc << 60;
        Ok(self.0.take().map_or(u64::MAX, |layer| HALF | layer))
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        bytes.fill(u8::MAX);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn prepared_noise_is_the_same_noise(seed: u64, tick: u64, count in 0usize..10) {
            let noise = Noise::new(seed);
            for tick in [tick, tick % 1000] {
                let [mut wanted, mut next_wanted, mut found, mut next] = [(); 4].map(|()| vec![0.0; count]);
                standard_normal(seed, tick, &mut wanted);
                standard_normal(seed, tick.wrapping_add(1), &mut next_wanted);
                noise.draw(tick, [&mut found, &mut next]);
                prop_assert_eq!((&wanted, &next_wanted), (&found, &next));
            }
        }
    }

    /// Through every layer of the ziggurat, and past its usual draw some hundred times.
    #[test]
    fn prepared_noise_is_the_same_noise_in_every_layer() {
        let noise = Noise::new(3);
        let (mut layers, mut unusual) = ([false; 256], 0);
        for tick in 0..4000 {
            let (mut wanted, mut found, mut next) = ([0.0; 8], [0.0; 8], [0.0; 8]);
            standard_normal(3, tick, &mut wanted);
            let [block, _] = noise.blocks([tick, 0]);
            unusual += usize::from(!noise.draw_usual(block, &mut found));
            noise.draw(tick, [&mut found, &mut next]);
            assert_eq!(wanted, found);
            standard_normal(3, tick + 1, &mut wanted);
            assert_eq!(wanted, next);
            for bits in block {
                layers[(bits & 0xff) as usize] = true;
            }
        }
        assert!(layers.iter().all(|&met| met) && unusual > 100, "{unusual}");
        assert!(noise.widths.windows(2).all(|pair| pair[0] > pair[1]));
    }

    #[test]
    fn same_tick_same_noise_other_tick_other_noise() {
        let draw = |tick| {
            let mut out = [0.0; 3];
            standard_normal(7, tick, &mut out);
            out
        };
        assert_eq!(draw(5), draw(5));
        assert_ne!(draw(5), draw(6));
    }

    #[test]
    fn mean_and_variance_are_those_of_a_standard_normal() {
        let mut values = Vec::new();
        for tick in 0..20_000 {
            let mut out = [0.0; 2];
            standard_normal(1, tick, &mut out);
            values.extend(out);
        }
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
        // Five standard errors of each estimate.
        assert!(mean.abs() < 5.0 / count.sqrt());
        assert!((variance - 1.0).abs() < 5.0 * (2.0 / count).sqrt());
    }
}
