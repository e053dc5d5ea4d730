//! Nothing is allocated between fmi2ExitInitializationMode and fmi2Terminate.

use crate::host::*;
use fmu_abi::memory::allocations as calls;
use fmu_abi::types::Status;

#[test]
fn the_counter_counts() {
    let counted = calls(|| drop(std::hint::black_box(vec![1u8])));
    assert_eq!(counted, 2);
}

#[test]
fn steps_gets_and_sets_do_not_allocate() {
    let resources = Resources::new(0.1);
    let instance = Instance::started(&resources, 0.0);
    let mut reals = [0.0; REALS.len()];
    // That ticks run on old inputs is told once; the sentence takes memory.
    assert_eq!(instance.step(0.0, 0.35), Status::Ok);
    assert_eq!(instance.warnings().len(), 1);
    let counted = calls(|| {
        let mut time = 0.35;
        for k in 0..1000 {
            let length = [0.1, 0.35, 0.01, 1e-16][k % 4];
            let input = if k == 500 { f64::NAN } else { k as f64 };
            assert_eq!(instance.set(INPUT[0], input), Status::Ok);
            assert_eq!(instance.set(GAIN, 0.5), Status::Ok);
            assert_eq!(instance.set_mode(1 + k as i32 % 3), Status::Ok);
            assert_eq!(instance.step(time, length), Status::Ok);
            time += length;
            let n = REALS.len();
            let status = unsafe { fmi2GetReal(instance.c, REALS.as_ptr(), n, reals.as_mut_ptr()) };
            assert_eq!(status, Status::Ok);
            assert!(instance.ticks() >= 0);
        }
    });
    assert_eq!(counted, 0);
}

#[test]
fn directional_derivatives_do_not_allocate() {
    let resources = Resources::new(0.1);
    let instance = Instance::started(&resources, 0.0);
    let mut out = [0.0; 2];
    let counted = calls(|| {
        let (unknowns, knowns, changes) = (EARLY, INPUT, [2.0, 3.0]);
        let status = unsafe {
            fmi2GetDirectionalDerivative(
                instance.c,
                unknowns.as_ptr(),
                2,
                knowns.as_ptr(),
                2,
                changes.as_ptr(),
                out.as_mut_ptr(),
            )
        };
        assert_eq!(status, Status::Ok);
    });
    assert_eq!((counted, out), (0, [2.0, 3.0]));
}
