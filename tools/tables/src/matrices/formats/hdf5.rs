//! MATLAB's 7.3 format: HDF5, with the dimensions of every array in reverse order.

use super::{DEEPEST, Found, check_shape, from_columns};
use crate::{EntryError, Error, MatrixError};
use hdf5_pure::{Dataset, File, Group};
use nalgebra::DMatrix;

/// Where MATLAB keeps what variables refer to; no variable bears such a name.
const INTERNAL: char = '#';

pub(super) fn read(bytes: Vec<u8>) -> Result<Found, Error> {
    if end_of_file(&bytes).is_some_and(|end| end > bytes.len() as u64) {
        return Err(MatrixError::CutShort.into());
    }
    let mut found = Found::new();
    File::from_bytes(bytes)
        .and_then(|file| add(&mut found, "", &file.root(), DEEPEST))
        .map_err(|error| Error::Unreadable {
            kind: " as a MATLAB 7.3 file",
            why: error.to_string(),
            advice: "save it again, plain arrays or a structure of them",
        })?;
    Ok(found)
}

fn add(
    found: &mut Found,
    prefix: &str,
    group: &Group,
    depth: usize,
) -> Result<(), hdf5_pure::Error> {
    for name in group.datasets()? {
        let matrix = group
            .dataset(&name)
            .map_err(|error| EntryError::Unreadable(error.to_string()))
            .and_then(|dataset| dense(&dataset));
        found.insert(format!("{prefix}{name}"), matrix);
    }
    for name in group.groups()? {
        if depth > 0 && !name.starts_with(INTERNAL) {
            let inner = group.group(&name)?;
            add(found, &format!("{prefix}{name}."), &inner, depth - 1)?;
        }
    }
    Ok(())
}

fn dense(dataset: &Dataset) -> Result<DMatrix<f64>, EntryError> {
    let not_real = |error: hdf5_pure::Error| EntryError::NotReal(Some(error.to_string()));
    let attributes = dataset.attrs().unwrap_or_default();
    if attributes.contains_key("MATLAB_empty") {
        return Ok(DMatrix::zeros(0, 0));
    }
    if attributes.contains_key("MATLAB_object_decode") {
        return Err(EntryError::Object);
    }
    let mut shape: Vec<usize> = dataset
        .shape()
        .map_err(not_real)?
        .into_iter()
        .map(|size| usize::try_from(size).unwrap_or(usize::MAX))
        .collect();
    shape.reverse();
    if shape.is_empty() {
        // A number by itself.
        shape = vec![1, 1];
    }
    check_shape(&shape)?;
    from_columns(&shape, &dataset.read_f64().map_err(not_real)?)
}

/// Where the file says that it ends: the address of HDF5's superblock, versions 0 to 3, with addresses of
/// eight bytes. The superblock stands at 0, 512, 1024 and so on.
fn end_of_file(bytes: &[u8]) -> Option<u64> {
    let places = core::iter::once(0).chain((9..).map(|power| 1 << power));
    let block = places
        .map_while(|place: usize| bytes.get(place..))
        .find(|block| block.starts_with(b"\x89HDF\r\n\x1a\n"))?;
    let (width, address) = match block.get(8)? {
        0 => (13, 40),
        1 => (13, 44),
        2 | 3 => (9, 28),
        _ => return None,
    };
    if *block.get(width)? != 8 {
        return None;
    }
    let address = block.get(address..address + 8)?.try_into().ok()?;
    Some(u64::from_le_bytes(address))
}
