//! Independent parts of a design, worked on at the same time inside a pool of threads.

use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// The most threads that a pool for a design, or for a campaign of one, is asked to have.
pub const MOST_THREADS: usize = 1024;

/// What `find` makes of every item, in their order. Called inside a pool of threads (`rayon`), it works on
/// several at the same time; what comes back is the same to the bit.
pub(crate) fn each<T: Sync, R: Send>(items: &[T], find: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    if rayon::current_thread_index().is_some() {
        let found: Vec<Mutex<Option<R>>> = items.iter().map(|_| Mutex::new(None)).collect();
        at_the_same_time(items.len(), &|index| {
            let result = find(&items[index]);
            *found[index].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
        });
        let found = found.into_iter().map(Mutex::into_inner);
        return found
            .filter_map(|result| result.unwrap_or_else(PoisonError::into_inner))
            .collect();
    }
    items.iter().map(find).collect()
}

/// Does `work` for every index below `count`. Not generic: what `rayon` makes of it is compiled once.
fn at_the_same_time(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

/// As [`each`], but the first error in the order of the items where there is one. Outside a pool nothing is
/// worked on after it.
pub(crate) fn all<T: Sync, R: Send, E: Send>(
    items: &[T],
    find: impl Fn(&T) -> Result<R, E> + Sync + Send,
) -> Result<Vec<R>, E> {
    if rayon::current_thread_index().is_some() {
        return each(items, find).into_iter().collect();
    }
    items.iter().map(find).collect()
}

/// [`all`] for what may be missing.
pub(crate) fn every<T: Sync, R: Send>(
    items: &[T],
    find: impl Fn(&T) -> Option<R> + Sync + Send,
) -> Option<Vec<R>> {
    all(items, |item| find(item).ok_or(())).ok()
}
