//! MATLAB's 7.3 format: HDF5, with the dimensions of every array in reverse order.

use super::{DEEPEST, Found, check_shape, from_columns};
use hdf5_pure::{Dataset, File, Group};
use nalgebra::DMatrix;

/// Where MATLAB keeps what variables refer to; no variable bears such a name.
const INTERNAL: char = '#';

pub(super) fn read(bytes: Vec<u8>) -> Result<Found, String> {
    let mut found = Found::new();
    File::from_bytes(bytes)
        .and_then(|file| add(&mut found, "", &file.root(), DEEPEST))
        .map_err(|error| {
            format!("cannot be read as a MATLAB 7.3 file ({error}): save it again, plain arrays or a structure of them")
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
            .map_err(|error| format!("cannot be read ({error}): save it again"))
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

fn dense(dataset: &Dataset) -> Result<DMatrix<f64>, String> {
    let blame = |error: hdf5_pure::Error| {
        format!(
            "is no real matrix ({error}): save it with full(...), as double, not in a cell or an object"
        )
    };
    let attributes = dataset.attrs().unwrap_or_default();
    if attributes.contains_key("MATLAB_empty") {
        return Ok(DMatrix::zeros(0, 0));
    }
    if attributes.contains_key("MATLAB_object_decode") {
        return Err("is an object or a text: save plain matrices".into());
    }
    let mut shape: Vec<usize> = dataset
        .shape()
        .map_err(blame)?
        .into_iter()
        .map(|size| usize::try_from(size).unwrap_or(usize::MAX))
        .collect();
    shape.reverse();
    check_shape(&shape)?;
    from_columns(&shape, &dataset.read_f64().map_err(blame)?)
}
