//! The program `ftc-fmu`; see the library beside it.

use std::process::ExitCode;

fn main() -> ExitCode {
    if standard_output::was_closed() {
        eprintln!(
            "error: standard output is closed: send it to a file, or to /dev/null if nobody reads it"
        );
        return ExitCode::from(2);
    }
    ExitCode::from(ftc_fmu::main(std::env::args_os().collect(), None, None))
}

/// Whether standard output was closed (`>&-`) when the program started. Rust opens /dev/null in its
/// place before `main`, and what is printed would be lost without a word; so it is looked at earlier.
#[cfg(target_os = "linux")]
mod standard_output {
    use std::sync::atomic::{AtomicBool, Ordering};

    static CLOSED: AtomicBool = AtomicBool::new(false);

    #[used]
    #[unsafe(link_section = ".init_array")]
    static BEFORE_MAIN: extern "C" fn() = look;

    extern "C" fn look() {
        // SAFETY: asks for a flag of a descriptor, whether it is open or not.
        let flags = unsafe { libc::fcntl(libc::STDOUT_FILENO, libc::F_GETFD) };
        CLOSED.store(flags == -1, Ordering::Relaxed);
    }

    pub fn was_closed() -> bool {
        CLOSED.load(Ordering::Relaxed)
    }
}

#[cfg(not(target_os = "linux"))]
mod standard_output {
    pub fn was_closed() -> bool {
        false
    }
}
