//! Memory that runs out is an answer: the binary's allocator.
//!
//! Safe Rust cannot hear that an allocation failed: collections abort the process, and an
//! allocator must not unwind. So this allocator does not let one fail while there is something
//! in reserve, and counts every time it had to reach for it. Whoever made something that lives
//! on, an instance or a saved state, looks at the count before he hands it out
//! ([`short_of_memory`]); if memory was short he drops what he made, which gives the reserve
//! back, and refuses the call.
//!
//! There are two reserves: [`SMALL`] bytes that are part of the binary, enough for the messages
//! of refused calls; and a [`Reserve`] of the size that a larger piece of work may need at most,
//! asked of the system before that work begins. A reserve serves every thread: under shortage a
//! call may be refused because another thread ran short at the same time.
//!
//! Left to abort: work that asks for more than its reserve after the system has refused, and
//! what the C library allocates for itself when a thread enters the library for the first time
//! to handle a panic.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::UnsafeCell;
use std::ptr::{NonNull, null_mut};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Bytes of the reserve that is part of the binary.
pub const SMALL: usize = 1 << 16;

/// The alignment of every reserve.
const ALIGN: usize = 64;

/// The allocator of an FMU's binary, declared by [`crate::export_fmu`].
#[derive(Debug)]
pub struct Memory;

/// How often a reserve was reached for.
static SHORTAGES: AtomicUsize = AtomicUsize::new(0);
/// Pieces of reserves in use.
static SERVED: AtomicUsize = AtomicUsize::new(0);
/// How many threads measure what they make, and the bytes asked for while one does, wrapping.
static MEASURING: AtomicUsize = AtomicUsize::new(0);
static REQUESTED: AtomicUsize = AtomicUsize::new(0);

static BLOCKS: Mutex<Blocks> = Mutex::new(Blocks { first: null_mut() });
static BASE: Base = Base(UnsafeCell::new(Room { _bytes: [0; SMALL] }));

/// A number that grows whenever memory is short; see [`short_of_memory`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark(usize);

/// The present count of shortages.
pub fn mark() -> Mark {
    Mark(SHORTAGES.load(Ordering::Acquire))
}

/// Whether memory ran short since `mark`.
pub fn short_of_memory(mark: Mark) -> bool {
    self::mark() != mark
}

/// The bytes that `make` asks for, and what it makes; other threads' requests may be among them.
pub fn size_of_made<T>(make: impl FnOnce() -> T) -> (usize, T) {
    struct Measuring;
    impl Drop for Measuring {
        fn drop(&mut self) {
            MEASURING.fetch_sub(1, Ordering::Relaxed);
        }
    }
    MEASURING.fetch_add(1, Ordering::Relaxed);
    let _measuring = Measuring;
    let before = REQUESTED.load(Ordering::Relaxed);
    let made = make();
    (REQUESTED.load(Ordering::Relaxed).wrapping_sub(before), made)
}

/// Memory reserved for a piece of work, as long as this lives.
#[derive(Debug)]
pub struct Reserve(NonNull<Block>);

/// A stretch of memory from which pieces are served one after the other.
#[derive(Debug)]
struct Block {
    next: *mut Block,
    /// The first byte not served, and the end.
    free: usize,
    end: usize,
    start: usize,
    /// Pieces in use.
    live: usize,
    /// The work is over: given back with the last piece.
    orphan: bool,
    layout: Layout,
}

/// All blocks, the one in the binary last.
struct Blocks {
    first: *mut Block,
}

// SAFETY: reached under the mutex only.
unsafe impl Send for Blocks {}

#[repr(align(64))]
struct Room {
    _bytes: [u8; SMALL],
}

struct Base(UnsafeCell<Room>);

// SAFETY: pieces are given out under the mutex, each once.
unsafe impl Sync for Base {}

impl Reserve {
    /// Reserves `bytes`; `None` if the system has not that much.
    pub fn take(bytes: usize) -> Option<Self> {
        let size = bytes.checked_add(size_of::<Block>())?;
        let layout = Layout::from_size_align(size, ALIGN).ok()?;
        // SAFETY: the size is not 0.
        let block = NonNull::new(unsafe { System.alloc(layout) })?.cast::<Block>();
        let start = block.as_ptr() as usize;
        let mut blocks = lock();
        // SAFETY: fresh memory, large and aligned enough for a block.
        unsafe {
            block.write(Block {
                next: blocks.first,
                free: start + size_of::<Block>(),
                end: start + size,
                start,
                live: 0,
                orphan: false,
                layout,
            });
        }
        blocks.first = block.as_ptr();
        Some(Self(block))
    }
}

impl Drop for Reserve {
    fn drop(&mut self) {
        let mut blocks = lock();
        // SAFETY: the block lives until it is released, and is touched under the mutex.
        unsafe {
            (*self.0.as_ptr()).orphan = true;
            blocks.release(self.0.as_ptr());
        }
    }
}

fn lock() -> MutexGuard<'static, Blocks> {
    BLOCKS.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Blocks {
    /// A piece of a block that has room, or null.
    fn serve(&mut self, layout: Layout) -> *mut u8 {
        let mut at = self.first;
        while !at.is_null() {
            // SAFETY: blocks in the list live, and are touched under the mutex.
            let block = unsafe { &mut *at };
            let from = block.free.next_multiple_of(layout.align());
            if let Some(end) = from.checked_add(layout.size())
                && end <= block.end
            {
                (block.free, block.live) = (end, block.live + 1);
                return at.cast::<u8>().wrapping_add(from - at as usize);
            }
            at = block.next;
        }
        base().serve(layout)
    }

    /// Takes a piece back; says whether it was one.
    fn take_back(&mut self, piece: *mut u8) -> bool {
        let address = piece as usize;
        let mut at = self.first;
        while !at.is_null() {
            // SAFETY: as above.
            let block = unsafe { &mut *at };
            if (block.start..block.end).contains(&address) {
                block.live -= 1;
                if block.live == 0 {
                    block.free = block.start + size_of::<Block>();
                    // SAFETY: as above.
                    unsafe { self.release(at) };
                }
                return true;
            }
            at = block.next;
        }
        base().take_back(address)
    }

    /// Gives a block back to the system if its work is over and no piece is in use.
    ///
    /// # Safety
    /// The block is in the list.
    unsafe fn release(&mut self, block: *mut Block) {
        // SAFETY: by contract; blocks are touched under the mutex.
        unsafe {
            if !(*block).orphan || (*block).live > 0 {
                return;
            }
            let mut link = &raw mut self.first;
            while *link != block {
                link = &raw mut (**link).next;
            }
            *link = (*block).next;
            let layout = (*block).layout;
            System.dealloc(block.cast(), layout);
        }
    }
}

/// The reserve in the binary.
struct Small {
    used: AtomicUsize,
    live: AtomicUsize,
}

static SMALL_USE: Small = Small {
    used: AtomicUsize::new(0),
    live: AtomicUsize::new(0),
};

fn base() -> &'static Small {
    &SMALL_USE
}

// Called under the mutex only: plain reads and writes are enough.
impl Small {
    fn serve(&self, layout: Layout) -> *mut u8 {
        let start = BASE.0.get().cast::<u8>();
        let used = self.used.load(Ordering::Relaxed);
        let from = (start as usize + used).next_multiple_of(layout.align()) - start as usize;
        match from.checked_add(layout.size()) {
            Some(end) if end <= SMALL => {
                self.used.store(end, Ordering::Relaxed);
                self.live.fetch_add(1, Ordering::Relaxed);
                start.wrapping_add(from)
            }
            _ => null_mut(),
        }
    }

    fn take_back(&self, address: usize) -> bool {
        let start = BASE.0.get() as usize;
        let own = (start..start + SMALL).contains(&address);
        if own && self.live.fetch_sub(1, Ordering::Relaxed) == 1 {
            self.used.store(0, Ordering::Relaxed);
        }
        own
    }
}

/// What the system refused, out of a reserve; null if that is used up too.
#[cold]
fn serve(layout: Layout) -> *mut u8 {
    let piece = lock().serve(layout);
    SHORTAGES.fetch_add(1, Ordering::Release);
    if !piece.is_null() {
        SERVED.fetch_add(1, Ordering::Release);
    }
    piece
}

/// Whether the memory came out of a reserve, and then it is back.
fn taken_back(pointer: *mut u8) -> bool {
    if SERVED.load(Ordering::Acquire) == 0 {
        return false;
    }
    let back = lock().take_back(pointer);
    if back {
        SERVED.fetch_sub(1, Ordering::Release);
    }
    back
}

fn note(bytes: usize) {
    // A locked addition at every allocation takes longer than finding the memory.
    if MEASURING.load(Ordering::Relaxed) != 0 {
        REQUESTED.fetch_add(bytes, Ordering::Relaxed);
    }
    #[cfg(feature = "counting")]
    counting::count();
}

// SAFETY: memory comes from the system's allocator, or from a reserve, each piece of which is
// given out once, aligned and within bounds, and told from the system's by its address.
unsafe impl GlobalAlloc for Memory {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        note(layout.size());
        // SAFETY: as the caller promises.
        let pointer = unsafe { System.alloc(layout) };
        if pointer.is_null() {
            serve(layout)
        } else {
            pointer
        }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        note(layout.size());
        // SAFETY: as the caller promises.
        let pointer = unsafe { System.alloc_zeroed(layout) };
        if !pointer.is_null() {
            return pointer;
        }
        let piece = serve(layout);
        if !piece.is_null() {
            // SAFETY: a piece has the size that was asked for.
            unsafe { piece.write_bytes(0, layout.size()) };
        }
        piece
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        #[cfg(feature = "counting")]
        counting::count();
        if !taken_back(pointer) {
            // SAFETY: as the caller promises, and it is the system's.
            unsafe { System.dealloc(pointer, layout) }
        }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        let Ok(wanted) = Layout::from_size_align(size, layout.align()) else {
            return null_mut();
        };
        if SERVED.load(Ordering::Acquire) == 0 {
            note(size);
            // SAFETY: as the caller promises, and it is the system's.
            let moved = unsafe { System.realloc(pointer, layout, size) };
            if !moved.is_null() {
                return moved;
            }
        }
        // SAFETY: the size is not 0, as the caller promises.
        let moved = unsafe { self.alloc(wanted) };
        if !moved.is_null() {
            // SAFETY: both hold that many bytes, and do not overlap.
            unsafe {
                moved.copy_from_nonoverlapping(pointer, layout.size().min(size));
                self.dealloc(pointer, layout);
            }
        }
        moved
    }
}

#[cfg(feature = "counting")]
mod counting {
    use std::cell::Cell;

    thread_local! {
        static CALLS: Cell<usize> = const { Cell::new(0) };
    }

    pub(super) fn count() {
        CALLS.set(CALLS.get() + 1);
    }

    /// How often this thread allocates or frees memory in `of`.
    pub fn allocations(of: impl FnOnce()) -> usize {
        let before = CALLS.get();
        of();
        CALLS.get() - before
    }
}

#[cfg(feature = "counting")]
pub use counting::allocations;
