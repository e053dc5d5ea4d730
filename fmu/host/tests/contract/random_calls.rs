//! Random sequences of calls with random arguments: what the fuzzer does, the same in every run.
//!
//! promise: hostile-calls

use crate::Pair;
use arbitrary::{Arbitrary, Unstructured};
use fmu_host::random_calls::{Call, fresh, play};

/// Bytes without end (splitmix64).
fn bytes(seed: u64) -> impl Iterator<Item = u8> {
    let mix = move |k: u64| {
        let mut z = (seed << 32 | k).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)).to_le_bytes()
    };
    (0..).flat_map(mix)
}

#[test]
fn no_sequence_of_calls_does_harm() {
    let pair = Pair::load();
    for which in [0, 1] {
        let it = pair.fresh(which);
        let untouched = it.bytes();
        for seed in 0..1500 {
            let bytes: Vec<u8> = bytes(seed).take(600).collect();
            let mut source = Unstructured::new(&bytes);
            let mut calls = vec![Call::Begin];
            while !source.is_empty() {
                calls.push(Call::arbitrary(&mut source).unwrap());
            }
            play(&it, &calls);
            fresh(&it);
            assert_eq!(it.bytes(), untouched, "seed {seed}");
        }
    }
}
