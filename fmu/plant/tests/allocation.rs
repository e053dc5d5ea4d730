//! Nothing is allocated between fmi2ExitInitializationMode and fmi2Terminate.

use fmu_host::model::example;
use fmu_host::types::Status;
use fmu_host::{Counting, Instance, Model, allocations, exercise};
use ftc_plant as _;

#[global_allocator]
static COUNTING: Counting = Counting;

#[test]
fn nothing_is_allocated_on_line() {
    let model = Model::plant(&example());
    let functions = fmu_host::linked!();
    let it = Instance::new(functions, &model).unwrap();
    it.silence();
    it.initialize(0.0, |_| ());
    let mut run = exercise(&it, 900);
    assert_eq!(allocations(&mut run), 0);
    // SAFETY: the instance lives.
    let end = || assert_eq!(unsafe { (functions.terminate)(it.c) }, Status::Ok);
    assert_eq!(allocations(end), 0);
    assert!(allocations(|| drop(it)) > 0, "the counter counts");
}
