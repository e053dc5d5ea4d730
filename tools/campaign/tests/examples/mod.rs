//! The examples' requests and designs.

use ftc_design::Design;
use ftc_design::assembly::{Request, assemble};
use std::path::Path;

/// The design of an example after `change` of what it asks for.
pub fn design(example: &str, change: impl Fn(&mut Request)) -> Design {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let mut request = design_file::read(&examples.join(example)).unwrap().request;
    change(&mut request);
    assemble(request).unwrap()
}
