//! Nothing is allocated between fmi2ExitInitializationMode and fmi2Terminate.
//!
//! promise: no-allocation

use fmu_host::model::example;
use fmu_host::types::Status;
use fmu_host::{Instance, Model, assert_nothing_is_allocated};
use ftc_controller_fmu as _;

#[test]
fn nothing_is_allocated_on_line() {
    let model = Model::controller(&example());
    assert_nothing_is_allocated(fmu_host::linked!(), &model, |_| (), |_| ());
}

#[test]
fn nothing_is_allocated_where_the_mode_comes_late() {
    let model = Model::controller(&example());
    let unknown = |it: &Instance| assert_eq!(it.set_integer(it.span("mode"), 0), Status::Ok);
    assert_nothing_is_allocated(fmu_host::linked!(), &model, unknown, |_| ());
}
