//! Panics of other people's readers on damaged files, kept from standard error.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// Whether what panics on this thread is expected to.
    static EXPECTED: Cell<bool> = const { Cell::new(false) };
}

/// What `body` returns; none where it panics, and then nothing is printed. Panics of other threads are
/// reported as before.
pub(crate) fn caught<T>(body: impl FnOnce() -> T) -> Option<T> {
    static HOOKED: Once = Once::new();
    HOOKED.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |panic| {
            if !EXPECTED.get() {
                before(panic);
            }
        }));
    });
    let outer = EXPECTED.replace(true);
    let done = catch_unwind(AssertUnwindSafe(body));
    EXPECTED.set(outer);
    done.ok()
}
