//! The program `ftc-fmu`; see the library beside it.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(ftc_fmu::main(std::env::args_os().collect(), None))
}
