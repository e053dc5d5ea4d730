//! MATLAB's 7.3 format: HDF5, with the dimensions of every array in reverse order.

use super::{DEEPEST, Found, check_shape, from_columns};
use hdf5_pure::{Dataset, File, Group};
use nalgebra::DMatrix;

/// Where MATLAB keeps what variables refer to; no variable bears such a name.
const INTERNAL: char = '#';

pub(super) fn read(bytes: Vec<u8>) -> Result<Found, String> {
    if end_of_file(&bytes).is_some_and(|end| end > bytes.len() as u64) {
        return Err(
            "is cut short, a MATLAB 7.3 file without its end: copy or save it again".into(),
        );
    }
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
