//! A full run of one instance: everything an importer may do between initialization and the end.

use crate::{Functions, Instance, Model, allocations};
use fmu_abi::types::Status;
use model_description::{Causality, Kind, Role, Span, Variable};

/// The Reals of a causality, at most 64; the mode goes by its Integer.
fn reals(it: &Instance, causality: Causality) -> Vec<u32> {
    let fits = |v: &Variable| {
        v.causality == causality
            && matches!(v.kind, Kind::Real { .. })
            && !matches!(v.role, Role::ModeReal | Role::ExternalModeReal)
    };
    let found = it.table.iter().filter(|(_, v)| fits(v));
    found.map(|(reference, _)| reference).take(64).collect()
}

/// Prepares an initialized instance; the result makes `ticks` steps and leaves nothing undone:
/// inputs of all kinds (also no numbers), all outputs, steps within ticks, saved states,
/// derivatives, inquiries.
pub fn exercise(it: &Instance, ticks: u32) -> impl FnMut() + use<> {
    let (inputs, outputs) = (reals(it, Causality::Input), reals(it, Causality::Output));
    let measured = it.table.vector("y").first;
    let mode = it.table.vector("mode").first;
    let mode_is_input = inputs.contains(&measured);
    let tunable = it.table.vector("threshold");
    let mut values = vec![0.0; inputs.len()];
    let mut out = vec![0.0; outputs.len()];
    let orders = vec![1; outputs.len()];
    let mut saved = it.save();
    let functions = *it.functions();
    let c = it.c;
    move || {
        let mut time = 0.0;
        for k in 0..ticks {
            let wave = (f64::from(k) * 0.37).sin();
            for (value, &reference) in values.iter_mut().zip(&inputs) {
                let lost = mode_is_input && reference == measured && k % 50 == 7;
                *value = if lost { f64::NAN } else { 0.3 * wave };
            }
            for length in [1.0 / 7.0, 1e-16, 6.0 / 7.0 - 1e-16] {
                // SAFETY: every array has the length that is said.
                let statuses = unsafe {
                    [
                        (functions.set_real)(c, inputs.as_ptr(), inputs.len(), values.as_ptr()),
                        if mode_is_input {
                            let number = 1 + (k / 100 % 2) as i32;
                            (functions.set_integer)(c, &mode, 1, &number)
                        } else {
                            Status::Ok
                        },
                        match tunable {
                            Span { len: 0, .. } => Status::Ok,
                            Span { first, .. } => (functions.set_real)(c, &first, 1, &0.05),
                        },
                        (functions.get_fmu_state)(c, &mut saved),
                        (functions.do_step)(c, time, length, 1),
                        (functions.set_fmu_state)(c, saved),
                        (functions.do_step)(c, time, length, 1),
                        (functions.get_real)(c, outputs.as_ptr(), outputs.len(), out.as_mut_ptr()),
                        (functions.get_real_output_derivatives)(
                            c,
                            outputs.as_ptr(),
                            outputs.len(),
                            orders.as_ptr(),
                            out.as_mut_ptr(),
                        ),
                        (functions.get_directional_derivative)(
                            c,
                            outputs.as_ptr(),
                            outputs.len(),
                            inputs.as_ptr(),
                            inputs.len(),
                            values.as_ptr(),
                            out.as_mut_ptr(),
                        ),
                        (functions.get_real_status)(c, 2, &mut time),
                    ]
                };
                assert_eq!(statuses, [Status::Ok; 11], "tick {k}");
            }
        }
    }
}

/// Asserts that a full run allocates nothing from fmi2ExitInitializationMode to fmi2Terminate.
///
/// `before_exit` is called in initialization mode, `after_exit` when the run begins.
pub fn assert_nothing_is_allocated(
    functions: Functions,
    model: &Model,
    before_exit: impl FnOnce(&Instance),
    after_exit: impl FnOnce(&Instance),
) {
    let it = Instance::new(functions, model).expect("an instance");
    it.silence();
    it.initialize(0.0, before_exit);
    let mut run = exercise(&it, 900);
    let on_line = || {
        after_exit(&it);
        run();
        // SAFETY: the instance lives.
        assert_eq!(unsafe { (functions.terminate)(it.c) }, Status::Ok);
    };
    assert_eq!(allocations(on_line), 0);
    assert!(allocations(|| drop(it)) > 0, "the counter counts");
}
