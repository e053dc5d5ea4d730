//! What the tests of this package share.

use ftc_design::Design;
use std::path::Path;

/// An example, designed.
pub fn design(example: &str) -> Design {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../examples")
        .join(example);
    let request = design_file::read(&path).unwrap().request;
    ftc_design::assembly::assemble(request).unwrap()
}
