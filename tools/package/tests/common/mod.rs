//! What the tests of this package share.

use ftc_control::parameters::EstimatorMethod;
use ftc_design::Design;
use ftc_design::assembly::{Request, assemble};
use std::path::Path;

fn request(example: &str) -> Request {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../examples")
        .join(example);
    design_file::read(&path).unwrap().request
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
