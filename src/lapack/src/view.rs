//! Fortran arguments as nalgebra views.

use libc::{c_char, c_int};
use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, Dyn};

/// The letter a flag argument points to, in upper case.
///
/// # Safety
/// `flag` points to a readable byte.
pub(crate) unsafe fn letter(flag: *const c_char) -> u8 {
    unsafe { *flag.cast::<u8>() }.to_ascii_uppercase()
}

/// The value of a size argument; `None` when it is negative.
///
/// # Safety
/// `size` points to a readable integer.
pub(crate) unsafe fn size(size: *const c_int) -> Option<usize> {
    usize::try_from(unsafe { *size }).ok()
}

/// Elements spanned by `rows` x `columns` with leading dimension `lead`.
fn span(rows: usize, columns: usize, lead: usize) -> usize {
    if rows == 0 || columns == 0 {
        0
    } else {
        lead * (columns - 1) + rows
    }
}

/// Row and column strides; an empty matrix gets strides that nalgebra accepts without any data.
fn strides(rows: usize, columns: usize, lead: usize) -> (Dyn, Dyn) {
    match (rows, columns) {
        (0, _) => (Dyn(1), Dyn(0)),
        (_, 0) => (Dyn(0), Dyn(1)),
        _ => (Dyn(1), Dyn(lead)),
    }
}

/// A read-only view of a column-major matrix.
///
/// # Safety
/// `data` is valid for reads over the span of `rows` x `columns` with leading dimension
/// `lead >= max(1, rows)`, and nothing writes it during the view's lifetime.
pub(crate) unsafe fn matrix<'a>(
    data: *const f64,
    rows: usize,
    columns: usize,
    lead: usize,
) -> DMatrixView<'a, f64, Dyn, Dyn> {
    let length = span(rows, columns, lead);
    let slice = match length {
        0 => &[],
        _ => unsafe { std::slice::from_raw_parts(data, length) },
    };
    let (down, across) = strides(rows, columns, lead);
    DMatrixView::from_slice_with_strides_generic(slice, Dyn(rows), Dyn(columns), down, across)
}

/// A writable view of a column-major matrix.
///
/// # Safety
/// As [`matrix`], for reads and writes, and nothing else accesses it during the view's lifetime.
pub(crate) unsafe fn matrix_mut<'a>(
    data: *mut f64,
    rows: usize,
    columns: usize,
    lead: usize,
) -> DMatrixViewMut<'a, f64, Dyn, Dyn> {
    let length = span(rows, columns, lead);
    let slice = match length {
        0 => &mut [],
        _ => unsafe { std::slice::from_raw_parts_mut(data, length) },
    };
    let (down, across) = strides(rows, columns, lead);
    DMatrixViewMut::from_slice_with_strides_generic(slice, Dyn(rows), Dyn(columns), down, across)
}

/// Which triangle of a symmetric matrix is stored.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Triangle {
    Upper,
    Lower,
}

impl Triangle {
    /// The triangle a flag letter names.
    pub(crate) fn from_letter(letter: u8) -> Option<Self> {
        match letter {
            b'U' => Some(Self::Upper),
            b'L' => Some(Self::Lower),
            _ => None,
        }
    }

    /// Whether entry (row, column) is stored.
    pub(crate) fn holds(self, row: usize, column: usize) -> bool {
        match self {
            Self::Upper => row <= column,
            Self::Lower => row >= column,
        }
    }

    /// The full symmetric matrix of which one triangle is stored.
    pub(crate) fn symmetric(self, stored: &DMatrixView<f64, Dyn, Dyn>) -> DMatrix<f64> {
        DMatrix::from_fn(stored.nrows(), stored.ncols(), |r, c| {
            if self.holds(r, c) {
                stored[(r, c)]
            } else {
                stored[(c, r)]
            }
        })
    }
}
