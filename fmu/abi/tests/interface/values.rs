//! Getting and setting: types, ranges, pointers, and what a bad call leaves behind.
//!
//! promise: missing-mode

use crate::host::*;
use fmu_abi::types::Status;
use std::ptr::{null, null_mut};

fn started() -> Instance {
    Instance::started(&Resources::new(0.1), 0.0)
}

#[test]
fn inputs_and_parameters_read_back() {
    let it = started();
    for (reference, value) in [
        (INPUT[0], -0.0),
        (INPUT[1], 1e300),
        (REFERENCE, 3.0),
        (GAIN, 0.5),
    ] {
        assert_eq!(it.set(reference, value), Status::Ok);
        assert_eq!(it.real(reference).to_bits(), value.to_bits());
    }
    for value in [i32::MIN, -1, 0, i32::MAX] {
        assert_eq!(it.set_mode(value), Status::Ok);
        let mut back = 7;
        assert_eq!(
            unsafe { fmi2GetInteger(it.c, &MODE, 1, &mut back) },
            Status::Ok
        );
        assert_eq!(back, value);
    }
}

#[test]
fn any_number_but_zero_is_true() {
    let it = Instance::new(&Resources::new(0.1));
    for value in [2, -1, i32::MIN] {
        assert_eq!(
            unsafe { fmi2SetBoolean(it.c, &START_AT_ONE, 1, &value) },
            Status::Ok
        );
    }
    it.start(0.0);
    let mut back = 7;
    assert_eq!(
        unsafe { fmi2GetBoolean(it.c, &START_AT_ONE, 1, &mut back) },
        Status::Ok
    );
    assert_eq!(back, 1);
    assert_eq!(it.real(LATE[0]), 1.0);
}

#[test]
fn a_wrong_type_or_reference_is_named() {
    let it = started();
    let mut real = 0.0;
    for (reference, expected) in [
        (MODE, "mode is of type Integer, not Real"),
        (ODD, "odd is of type Boolean, not Real"),
        (13, "value reference 13"),
        (u32::MAX, "value reference 4294967295"),
    ] {
        assert_eq!(
            unsafe { fmi2GetReal(it.c, &reference, 1, &mut real) },
            Status::Error
        );
        assert_eq!(
            it.last_message(),
            format!("fmi2GetReal: {}", tail(&it, expected))
        );
        assert_eq!(it.set(reference, 1.0), Status::Error);
        assert!(
            it.last_message().contains(expected),
            "{}",
            it.last_message()
        );
    }
    let mut integer = 0;
    assert_eq!(
        unsafe { fmi2GetInteger(it.c, &REFERENCE, 1, &mut integer) },
        Status::Error
    );
    assert_eq!(
        unsafe { fmi2GetBoolean(it.c, &REFERENCE, 1, &mut integer) },
        Status::Error
    );
    assert_eq!(unsafe { fmi2SetBoolean(it.c, &MODE, 1, &1) }, Status::Error);
    assert_eq!(
        unsafe { fmi2SetInteger(it.c, &REFERENCE, 1, &1) },
        Status::Error
    );
}

/// The message after the function's name, once it is seen to hold what is expected.
fn tail(it: &Instance, expected: &str) -> String {
    let message = it.last_message();
    assert!(message.contains(expected), "{message}");
    message.split_once(": ").unwrap().1.to_string()
}

#[test]
fn outputs_and_fixed_parameters_cannot_be_set() {
    let it = Instance::new(&Resources::new(0.1));
    assert_eq!(it.set(LATE[1], 1.0), Status::Error);
    assert!(it.last_message().contains("late[2] is an output"));
    assert_eq!(
        unsafe { fmi2SetInteger(it.c, &TICKS, 1, &1) },
        Status::Error
    );
    assert_eq!(unsafe { fmi2SetBoolean(it.c, &ODD, 1, &1) }, Status::Error);
    it.start(0.0);
    assert_eq!(
        unsafe { fmi2SetBoolean(it.c, &START_AT_ONE, 1, &1) },
        Status::Error
    );
    assert!(it.last_message().contains("start_at_one is fixed"));
}

#[test]
fn nothing_is_set_from_a_call_with_one_bad_entry() {
    let it = started();
    let before = it.bits();
    for bad in [LATE[0], MODE, 99] {
        let references = [INPUT[0], GAIN, bad];
        let status = unsafe { fmi2SetReal(it.c, references.as_ptr(), 3, [5.0; 3].as_ptr()) };
        assert_eq!(status, Status::Error);
        assert_eq!(it.bits(), before);
        let mut out = [-1.0; 3];
        let references = [LATE[0], INPUT[0], if bad == LATE[0] { 99 } else { bad }];
        let status = unsafe { fmi2GetReal(it.c, references.as_ptr(), 3, out.as_mut_ptr()) };
        assert_eq!((status, out), (Status::Error, [-1.0; 3]));
    }
}

#[test]
fn null_pointers_and_absurd_counts_are_refused() {
    let it = started();
    let before = it.bits();
    let mut real = 0.0;
    let reference = INPUT[0];
    unsafe {
        assert_eq!(fmi2GetReal(it.c, null(), 1, &mut real), Status::Error);
        assert!(it.last_message().contains("vr is a null pointer"));
        assert_eq!(fmi2GetReal(it.c, &reference, 1, null_mut()), Status::Error);
        assert!(it.last_message().contains("value is a null pointer"));
        assert_eq!(fmi2SetReal(it.c, null(), 1, &real), Status::Error);
        assert_eq!(fmi2SetReal(it.c, &reference, 1, null()), Status::Error);
        for count in [usize::MAX, usize::MAX / 2, 1 << 40, u32::MAX as usize] {
            assert_eq!(
                fmi2GetReal(it.c, &reference, count, &mut real),
                Status::Error
            );
            assert_eq!(fmi2SetReal(it.c, &reference, count, &real), Status::Error);
            assert_eq!(
                fmi2GetString(it.c, &reference, count, null_mut()),
                Status::Error
            );
            let names = null();
            assert_eq!(fmi2SetDebugLogging(it.c, 1, count, names), Status::Error);
        }
        // A count of 0 asks for nothing, whatever the pointers.
        assert_eq!(fmi2GetReal(it.c, null(), 0, null_mut()), Status::Ok);
        assert_eq!(fmi2SetInteger(it.c, null(), 0, null()), Status::Ok);
        assert_eq!(fmi2GetFMUstate(it.c, null_mut()), Status::Error);
        assert_eq!(fmi2GetRealStatus(it.c, 2, null_mut()), Status::Error);
        assert_eq!(fmi2GetBooleanStatus(it.c, 3, null_mut()), Status::Error);
    }
    assert_eq!(it.bits(), before);
}

#[test]
fn outputs_stay_those_of_the_last_communication_point() {
    let it = started();
    it.set(INPUT[0], 3.0);
    it.step(0.0, 0.1);
    let outputs = || {
        [EARLY, LATE]
            .concat()
            .into_iter()
            .map(|r| it.real(r))
            .collect::<Vec<_>>()
    };
    let before = outputs();
    it.set(INPUT[0], 100.0);
    it.set(GAIN, 7.0);
    assert_eq!(outputs(), before);
}

#[test]
fn a_tunable_parameter_acts_from_the_next_tick() {
    let it = started();
    it.set(INPUT[0], 1.0);
    it.step(0.0, 0.05);
    it.set(GAIN, 10.0);
    it.step(0.05, 0.05);
    assert_eq!(it.real(LATE[0]), 1.0);
    it.step(0.1, 0.1);
    assert_eq!(it.real(LATE[0]), 11.0);
}

#[test]
fn initial_outputs_follow_initial_inputs() {
    let it = Instance::new(&Resources::new(0.1));
    it.set(REFERENCE, 4.0);
    unsafe {
        fmi2SetupExperiment(it.c, 0, 0.0, 0.0, 0, 0.0);
        fmi2EnterInitializationMode(it.c);
    }
    assert_eq!(
        it.real(LATE[0]),
        4.0,
        "an input set before initialization mode counts"
    );
    it.set(REFERENCE, 5.0);
    assert_eq!(it.real(LATE[0]), 5.0);
    assert_eq!(it.real(REFERENCE), 5.0, "some importers want inputs back");
    unsafe { fmi2SetBoolean(it.c, &START_AT_ONE, 1, &1) };
    assert_eq!(unsafe { fmi2ExitInitializationMode(it.c) }, Status::Ok);
    assert_eq!(it.real(LATE[0]), 6.0);
}

#[test]
fn the_mode_comes_as_an_integer_or_as_a_real() {
    let it = started();
    it.set(INPUT[0], 1.0);
    for (mode, twin, sum) in [(2, 0.0, 2.0), (0, 3.0, 5.0), (2, 2.0, 7.0), (3, 0.0, 10.0)] {
        it.set_mode(mode);
        it.set(MODE_REAL, twin);
        assert_eq!(
            it.step(sum_time(&it), 0.1),
            Status::Ok,
            "{}",
            it.last_message()
        );
        assert_eq!(it.real(LATE[0]), sum, "mode {mode}, mode_real {twin}");
    }
}

/// The present time of an instance with ticks of 0.1.
fn sum_time(it: &Instance) -> f64 {
    let mut time = f64::NAN;
    let kind = fmu_abi::types::LAST_SUCCESSFUL_TIME;
    assert_eq!(
        unsafe { fmi2GetRealStatus(it.c, kind, &mut time) },
        Status::Ok
    );
    time
}

#[test]
fn a_mode_and_its_twin_that_disagree_are_refused_by_both_names() {
    let it = started();
    it.set(INPUT[0], 1.0);
    for (mode, twin) in [(1, 2.0), (3, 1.0), (1, 1.5), (7, 1.0)] {
        let before = it.bits();
        it.set_mode(mode);
        it.set(MODE_REAL, twin);
        assert_eq!(it.step(0.0, 0.1), Status::Error);
        for words in [format!("mode is {mode}"), format!("mode_real is {twin}")] {
            assert!(it.last_message().contains(&words), "{}", it.last_message());
        }
        it.set(MODE_REAL, 0.0);
        it.set_mode(1);
        assert_eq!(it.bits(), before);
    }
    assert_eq!(it.step(0.0, 0.1), Status::Ok);
}

#[test]
fn a_mode_that_is_not_told_is_waited_for() {
    let it = Instance::new(&Resources::new(0.1));
    it.set_mode(0);
    it.set(REFERENCE, 4.0);
    it.set(INPUT[0], 1.0);
    it.start(0.0);
    for k in 0..7 {
        assert_eq!(
            it.step(f64::from(k) * 0.1, 0.1),
            Status::Ok,
            "{}",
            it.last_message()
        );
        assert_eq!((it.real(LATE[0]), it.ticks()), (4.0, 0));
    }
    // The eighth tick has begun when the mode is told.
    assert_eq!(it.step(0.7, 0.05), Status::Ok);
    let copy = Instance::new(&Resources::new(0.1));
    let (status, state) = copy.deserialize(&it.serialize(it.save()));
    assert_eq!(status, Status::Ok, "that it waits is part of a saved state");
    assert_eq!(unsafe { fmi2SetFMUstate(copy.c, state) }, Status::Ok);
    for it in [&it, &copy] {
        it.set_mode(2);
        assert_eq!(it.step(0.75, 0.05), Status::Ok);
        assert_eq!((it.real(LATE[0]), it.ticks()), (4.0, 0));
        assert_eq!(it.step(0.8, 0.1), Status::Ok);
        assert_eq!(
            (it.real(LATE[0]), it.ticks()),
            (6.0, 1),
            "begun anew, then one tick"
        );
        it.set_mode(0);
        assert_eq!(it.step(0.9, 0.1), Status::Error);
        assert!(
            it.last_message().contains("mode is 0"),
            "{}",
            it.last_message()
        );
        it.set_mode(3);
        assert_eq!(it.step(0.9, 0.1), Status::Ok);
    }
    assert_eq!(it.warnings().len(), 1, "{:?}", it.warnings());
    assert!(it.warnings()[0].contains("mode is 0, not told yet"));
}

#[test]
fn tunable_parameters_keep_to_their_range() {
    let it = started();
    it.set(GAIN, 3.0);
    for bad in [-10.5, 1e300, f64::NAN, f64::INFINITY] {
        let references = [INPUT[0], GAIN];
        let values = [5.0, bad];
        let status = unsafe { fmi2SetReal(it.c, references.as_ptr(), 2, values.as_ptr()) };
        assert_eq!(status, Status::Error);
        let message = it.last_message();
        assert!(message.contains(&format!("gain is {bad}")), "{message}");
        assert!(message.contains("from -10 to 10"), "{message}");
        assert_eq!((it.real(INPUT[0]), it.real(GAIN)), (0.0, 3.0));
    }
    for good in [-10.0, 10.0] {
        assert_eq!(it.set(GAIN, good), Status::Ok);
    }
}

#[test]
fn an_impossible_input_is_named_and_the_instance_goes_on() {
    let it = started();
    it.set(INPUT[0], 1.0);
    it.step(0.0, 0.1);
    let outputs = || {
        [EARLY, LATE]
            .concat()
            .into_iter()
            .map(|r| it.real(r))
            .collect::<Vec<_>>()
    };
    let before = outputs();
    let bad: [(&str, &dyn Fn() -> Status); 6] = [
        ("ref is NaN", &|| it.set(REFERENCE, f64::NAN)),
        ("ref is inf", &|| it.set(REFERENCE, f64::INFINITY)),
        ("mode is 0", &|| it.set_mode(0)),
        ("mode is 4", &|| it.set_mode(4)),
        ("mode_real is 1.5", &|| it.set(MODE_REAL, 1.5)),
        ("mode_real is NaN", &|| it.set(MODE_REAL, f64::NAN)),
    ];
    for (expected, spoil) in bad {
        assert_eq!(spoil(), Status::Ok);
        assert_eq!(it.step(0.1, 0.35), Status::Error);
        assert!(
            it.last_message().contains(expected),
            "{}",
            it.last_message()
        );
        assert_eq!(outputs(), before);
        it.set(REFERENCE, 0.0);
        it.set(MODE_REAL, 0.0);
        it.set_mode(1);
    }
    // Repeating the step works, and so does going on after it: the ticks are made up for.
    let other = unsafe {
        let saved = it.save();
        assert_eq!(it.step(0.1, 0.35), Status::Ok);
        let repeated = it.bits();
        assert_eq!(fmi2SetFMUstate(it.c, saved), Status::Ok);
        repeated
    };
    assert_eq!(it.step(0.45, 0.05), Status::Ok);
    assert_eq!(it.ticks(), 5);
    assert_eq!(it.real(EARLY[0]), 5.0);
    assert_eq!(other[5], it.real(EARLY[0]).to_bits());
}

#[test]
fn an_input_that_is_not_ready_in_initialization_mode_may_come_later() {
    let it = Instance::new(&Resources::new(0.1));
    it.set_mode(5);
    it.set(REFERENCE, 4.0);
    it.start(0.0);
    assert_eq!(it.warnings().len(), 1);
    assert_eq!(it.real(LATE[0]), 4.0);
    assert_eq!(it.step(0.0, 0.1), Status::Error);
    assert!(it.last_message().contains("fmi2DoStep: mode is 5"));
    it.set_mode(2);
    it.set(REFERENCE, 5.0);
    it.set(INPUT[0], 1.0);
    assert_eq!(it.real(LATE[0]), 4.0, "nothing changes before the step");
    assert_eq!(it.step(0.0, 0.1), Status::Ok);
    assert_eq!(it.real(LATE[0]), 7.0, "initialized anew, then one tick");
    it.set(REFERENCE, 9.0);
    assert_eq!(it.step(0.1, 0.1), Status::Ok);
    assert_eq!(it.real(LATE[0]), 9.0, "that happens once");
}

#[test]
fn a_bad_input_between_ticks_does_not_matter() {
    let it = started();
    it.step(0.0, 0.05);
    it.set(REFERENCE, f64::NAN);
    assert_eq!(it.step(0.05, 0.05), Status::Ok, "no tick begins");
    assert_eq!(it.step(0.1, 0.05), Status::Error);
}

#[test]
fn a_nan_measurement_reaches_the_slave() {
    let it = started();
    it.set(INPUT[0], f64::NAN);
    it.set(INPUT[1], 2.0);
    assert_eq!(it.step(0.0, 0.1), Status::Ok);
    assert_eq!((it.real(LATE[0]), it.real(LATE[1])), (0.0, 2.0));
}

#[test]
fn derivatives_of_held_signals() {
    let it = started();
    let (references, orders) = ([LATE[0], EARLY[1]], [1, 3]);
    let mut out = [-1.0; 2];
    let mut ask = |references: &[u32; 2], orders: &[i32; 2]| unsafe {
        fmi2GetRealOutputDerivatives(
            it.c,
            references.as_ptr(),
            2,
            orders.as_ptr(),
            out.as_mut_ptr(),
        )
    };
    assert_eq!(ask(&references, &[0, 1]), Status::Error);
    assert_eq!(ask(&[INPUT[0], LATE[0]], &orders), Status::Error);
    assert_eq!(ask(&references, &orders), Status::Ok);
    assert_eq!(out, [0.0; 2]);
    let set = unsafe { fmi2SetRealInputDerivatives(it.c, &INPUT[0], 1, &1, &0.5) };
    assert_eq!(set, Status::Error);
    assert!(it.last_message().contains("canInterpolateInputs"));
}

#[test]
fn directional_derivatives_agree_with_finite_differences() {
    let it = started();
    it.set_mode(3);
    it.set(GAIN, 0.5);
    let saved = it.save();
    let publish = |inputs: [f64; 2]| -> Vec<f64> {
        assert_eq!(unsafe { fmi2SetFMUstate(it.c, saved) }, Status::Ok);
        for (reference, input) in INPUT.into_iter().zip(inputs) {
            it.set(reference, input);
        }
        assert_eq!(it.step(0.0, 0.1), Status::Ok);
        LATE.into_iter()
            .map(|reference| it.real(reference))
            .collect()
    };
    let change = [1.0, -2.0];
    let base = publish([0.0; 2]);
    let moved = publish(change);
    unsafe { fmi2SetFMUstate(it.c, saved) };
    let ask = |unknowns: [u32; 2], knowns: [u32; 2]| {
        let mut out = [f64::NAN; 2];
        let status = unsafe {
            let (u, k, dv) = (unknowns.as_ptr(), knowns.as_ptr(), change.as_ptr());
            fmi2GetDirectionalDerivative(it.c, u, 2, k, 2, dv, out.as_mut_ptr())
        };
        (status, out)
    };
    let expected = [moved[0] - base[0], moved[1] - base[1]];
    assert_eq!(ask(LATE, INPUT), (Status::Ok, expected));
    assert_eq!(ask(LATE, EARLY).0, Status::Error, "an output is no known");
    assert_eq!(ask(INPUT, INPUT).0, Status::Error, "an input is no unknown");
    assert_eq!(
        ask([TICKS, LATE[0]], INPUT).0,
        Status::Error,
        "an Integer has no derivative"
    );
}
