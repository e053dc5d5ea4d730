//! What the tests of this package share.

use ftc_control::parameters::EstimatorMethod;
use ftc_design::Design;
use ftc_design::assembly::{Request, assemble};
use std::path::Path;

fn request(example: &str) -> Request {
    read("../../examples", example)
}

fn read(folder: &str, name: &str) -> Request {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join(folder)
        .join(name);
    design_file::read(&path).unwrap().request
}

/// A design of `tests/designs` that is no example.
#[allow(dead_code)]
pub fn other_design(name: &str) -> Design {
    assemble(read("tests/designs", name)).unwrap()
}

/// An example, designed.
pub fn design(example: &str) -> Design {
    assemble(request(example)).unwrap()
}

/// The same with another fault estimator.
#[allow(dead_code)]
pub fn design_with(example: &str, method: EstimatorMethod) -> Design {
    let mut request = request(example);
    request.estimator.method = method;
    assemble(request).unwrap()
}
