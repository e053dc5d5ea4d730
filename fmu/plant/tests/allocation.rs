//! Nothing is allocated between fmi2ExitInitializationMode and fmi2Terminate.
//!
//! promise: no-allocation

use fmu_host::model::example;
use fmu_host::types::Status;
use fmu_host::{Instance, Model, assert_nothing_is_allocated};
use ftc_plant_fmu as _;

fn set_mode(it: &Instance, number: i32) {
    assert_eq!(it.set_integer(it.span("mode_ext"), number), Status::Ok);
}

#[test]
fn nothing_is_allocated_on_line() {
    let model = Model::plant(&example());
    assert_nothing_is_allocated(fmu_host::linked!(), &model, |_| (), |_| ());
}

#[test]
fn nothing_is_allocated_where_the_mode_comes_late() {
    let model = Model::plant(&example());
    let unknown = |it: &Instance| {
        let scenario = it.span("scenario_enabled");
        assert_eq!(it.set_boolean(scenario, false), Status::Ok);
        set_mode(it, 0);
    };
    assert_nothing_is_allocated(fmu_host::linked!(), &model, unknown, |it| set_mode(it, 2));
}
