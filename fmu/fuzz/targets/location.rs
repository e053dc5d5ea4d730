//! Any text as the location of the resources.
//!
//! promise: hostile-calls

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|location: &str| {
    let _ = fmu_abi::resource::folder(location);
});
