//! Block matrices that must be positive definite.

use super::expression::Affine;
use crate::blocks::BlockName;

/// A symmetric block matrix, affine in the unknowns, that must be positive (semi)definite.
#[derive(Clone, Debug)]
pub struct Inequality {
    /// What it stands for.
    pub name: BlockName,
    /// Its blocks on and below the diagonal: row `i` holds blocks `0..=i`; `None` is zero.
    rows: Vec<Vec<Option<Affine>>>,
}

impl Inequality {
    /// Arranges blocks given row by row, up to and including the diagonal; the rest follows by
    /// symmetry.
    pub fn new(name: BlockName, rows: Vec<Vec<Option<Affine>>>) -> Self {
        debug_assert!(rows.iter().enumerate().all(|(i, row)| row.len() == i + 1));
        debug_assert!(
            rows.iter()
                .all(|row| row.last().is_some_and(Option::is_some))
        );
        Self { name, rows }
    }

    /// Number of rows of the whole matrix.
    pub fn size(&self) -> usize {
        self.offsets().last().copied().unwrap_or(0)
    }

    /// Where each block row starts, and the total at the end.
    fn offsets(&self) -> Vec<usize> {
        let mut offsets = vec![0];
        for row in &self.rows {
            let size = row
                .last()
                .and_then(Option::as_ref)
                .map_or(0, |d| d.shape().0);
            offsets.push(offsets[offsets.len() - 1] + size);
        }
        offsets
    }

    /// Calls `visit(block, row offset, column offset)` for each block that is not zero.
    pub(super) fn for_each_block(&self, mut visit: impl FnMut(&Affine, usize, usize)) {
        let offsets = self.offsets();
        for (i, row) in self.rows.iter().enumerate() {
            for (j, block) in row.iter().enumerate() {
                if let Some(block) = block {
                    debug_assert_eq!(
                        block.shape(),
                        (offsets[i + 1] - offsets[i], offsets[j + 1] - offsets[j])
                    );
                    visit(block, offsets[i], offsets[j]);
                }
            }
        }
    }
}
