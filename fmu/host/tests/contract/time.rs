//! Communication steps of any length, from any start time: the same numbers at common times.
//!
//! promise: counted-time

use crate::Pair;
use fmu_host::Coupling::{self, GaussSeidel, Jacobi};
use fmu_host::model::{example, native};
use fmu_host::types::Status;

/// `Te` of the example.
const TE: f64 = 1.0;
const TICKS: usize = 420;
const STARTS: [f64; 4] = [0.0, -17.3, -1e9, 1e9];

/// The bits at every tick of a loop that steps by `parts` within each sample and exchanges
/// signals at its beginning only.
fn bits(
    pair: &Pair,
    start: f64,
    coupling: Coupling,
    parts: impl Fn(usize) -> Vec<f64>,
) -> Vec<Vec<u64>> {
    let mut closed = pair.close(start);
    let tick = |k: usize| {
        let begin = start + k as f64 * TE;
        for (at, part) in parts(k).into_iter().enumerate() {
            closed.step_to(begin + part * TE, coupling, at == 0);
        }
        closed.bits()
    };
    (0..TICKS).map(tick).collect()
}

/// Every sample in one step.
fn whole(_: usize) -> Vec<f64> {
    vec![1.0]
}

#[test]
fn the_loop_is_the_native_loop_bit_for_bit() {
    let pair = Pair::load();
    let mut closed = pair.close(0.0);
    for (k, (y, u)) in native(&example(), 1600).into_iter().enumerate() {
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&closed.plant.get("y")), bits(&y), "tick {k}");
        closed.step_to((k + 1) as f64, GaussSeidel, true);
        assert_eq!(bits(&closed.controller.get("u")), bits(&u), "tick {k}");
    }
}

#[test]
fn steps_within_a_sample_change_nothing() {
    let pair = Pair::load();
    for coupling in [GaussSeidel, Jacobi] {
        let regular = bits(&pair, 0.0, coupling, whole);
        let sevenths = |_| (1..=7).map(|part| f64::from(part) / 7.0).collect();
        assert_eq!(
            bits(&pair, 0.0, coupling, sevenths),
            regular,
            "{coupling:?}"
        );
        let irregular = |k: usize| vec![0.1 + 0.8 * ((k * k) % 7) as f64 / 7.0, 0.95, 1.0];
        assert_eq!(
            bits(&pair, 0.0, coupling, irregular),
            regular,
            "{coupling:?}"
        );
    }
}

#[test]
fn the_start_time_changes_nothing() {
    let pair = Pair::load();
    let regular = bits(&pair, 0.0, GaussSeidel, whole);
    for start in STARTS {
        assert_eq!(bits(&pair, start, GaussSeidel, whole), regular, "{start}");
        let halves = |_| vec![0.5, 1.0];
        assert_eq!(bits(&pair, start, GaussSeidel, halves), regular, "{start}");
    }
}

/// A step of 3.5 samples holds the inputs of its beginning, as short ones without exchange do.
#[test]
fn a_long_step_is_as_many_short_ones() {
    let pair = Pair::load();
    for start in STARTS {
        let (mut long, mut short) = (pair.close(start), pair.close(start));
        for k in 0..120 {
            let begin = start + 3.5 * TE * f64::from(k);
            long.step_to(begin + 3.5 * TE, Jacobi, true);
            for part in 1..=7 {
                let end = begin + 0.5 * TE * f64::from(part);
                short.step_to(end, Jacobi, part == 1);
            }
            assert_eq!(long.bits(), short.bits(), "{start}, step {k}");
        }
    }
}

/// With the controller first, the plant gets what the controller says at the end of its step.
#[test]
fn a_long_step_of_one_instance_is_as_many_short_ones() {
    let pair = Pair::load();
    let (mut long, short) = (pair.close(1e9), pair.close(1e9));
    for k in 0..120 {
        let begin = 1e9 + 3.5 * TE * f64::from(k);
        long.step_to(begin + 3.5 * TE, GaussSeidel, true);
        short.sense();
        for part in 0..7 {
            let from = begin + 0.5 * TE * f64::from(part);
            assert_eq!(short.controller.step(from, 0.5 * TE), Status::Ok);
        }
        short.act();
        for part in 0..7 {
            let from = begin + 0.5 * TE * f64::from(part);
            assert_eq!(short.plant.step(from, 0.5 * TE), Status::Ok);
        }
        assert_eq!(long.bits(), short.bits(), "step {k}");
    }
}

/// A master that steps both in parallel with a design that allows for no delay: one warning, soon.
///
/// promise: wrong-delay
#[test]
fn a_wrong_coupling_is_told_once() {
    let pair = Pair::load();
    for coupling in [GaussSeidel, Jacobi] {
        let mut closed = pair.close(0.0);
        let mut first = None;
        for k in 0..1200_u32 {
            closed.step_to(f64::from(k + 1), coupling, true);
            let told = warnings(&closed.controller);
            if !told.is_empty() && first.is_none() {
                first = Some(k);
            }
        }
        let told = warnings(&closed.controller);
        match coupling {
            GaussSeidel => assert_eq!(told, Vec::<String>::new()),
            Jacobi => {
                assert_eq!(told.len(), 1, "{told:?}");
                assert!(told[0].contains("one sample more of delay"), "{told:?}");
                assert!(first.unwrap() < 200, "{first:?}");
            }
        }
    }
}

fn warnings(it: &fmu_host::Instance) -> Vec<String> {
    let messages = it.messages.lock().unwrap();
    let warned = messages
        .iter()
        .filter(|(status, ..)| *status == Status::Warning);
    warned.map(|(_, _, text)| text.clone()).collect()
}
