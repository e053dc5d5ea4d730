//! NumPy archives, as `numpy.savez` and `numpy.savez_compressed` write them.

use super::{Found, MOST_ENTRIES, check_shape, from_columns};
use crate::{EntryError, Error, MatrixError};
use nalgebra::DMatrix;
use npyz::{DType, NpyFile, Order, TypeChar};
use std::io::{Cursor, Read};
use zip::ZipArchive;

/// The most arrays of an archive.
const MOST_ARRAYS: usize = 10_000;

pub(super) fn read(bytes: Vec<u8>) -> Result<Found, Error> {
    let damaged = |error: zip::result::ZipError| Error::Unreadable {
        kind: " as a NumPy archive",
        why: error.to_string(),
        advice: "save it again with numpy.savez",
    };
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(damaged)?;
    if archive.len() > MOST_ARRAYS {
        return Err(MatrixError::TooManyArrays(archive.len()).into());
    }
    let mut found = Found::new();
    for at in 0..archive.len() {
        let entry = archive.by_index(at).map_err(damaged)?;
        let name = entry.name().map_err(damaged)?.to_string();
        if let Some(name) = name.strip_suffix(".npy") {
            // A header and as many numbers as a matrix may have, whatever the archive promises.
            let bounded = entry.take(16 * MOST_ENTRIES as u64);
            found.insert(name.to_string(), dense(bounded));
        }
    }
    Ok(found)
}

fn dense(reader: impl Read) -> Result<DMatrix<f64>, EntryError> {
    let damaged = |error: std::io::Error| EntryError::Unreadable(error.to_string());
    let file = NpyFile::new(reader).map_err(damaged)?;
    let shape: Vec<usize> = match file.shape() {
        [] => vec![1, 1],
        sizes => sizes
            .iter()
            .map(|&size| usize::try_from(size).unwrap_or(usize::MAX))
            .collect(),
    };
    check_shape(&shape)?;
    let rows_first = file.order() == Order::C;
    let entries = numbers(file)?;
    if rows_first {
        let transposed: Vec<usize> = shape.iter().rev().copied().collect();
        return from_columns(&transposed, &entries).map(|matrix| matrix.transpose());
    }
    from_columns(&shape, &entries)
}

/// The entries in the order of the file, whatever real type they have.
fn numbers<R: Read>(file: NpyFile<R>) -> Result<Vec<f64>, EntryError> {
    fn all<T: npyz::Deserialize, R: Read>(
        file: NpyFile<R>,
        number: impl Fn(T) -> f64,
    ) -> Result<Vec<f64>, EntryError> {
        let values: Vec<T> = file
            .into_vec()
            .map_err(|error| EntryError::Unreadable(error.to_string()))?;
        Ok(values.into_iter().map(number).collect())
    }
    let DType::Plain(kind) = file.dtype() else {
        return Err(EntryError::Fields);
    };
    match (kind.type_char(), kind.size_field()) {
        (TypeChar::Float, 8) => all(file, |value: f64| value),
        (TypeChar::Float, 4) => all(file, |value: f32| f64::from(value)),
        (TypeChar::Int, 8) => all(file, |value: i64| value as f64),
        (TypeChar::Int, 4) => all(file, |value: i32| f64::from(value)),
        (TypeChar::Int, 2) => all(file, |value: i16| f64::from(value)),
        (TypeChar::Int, 1) => all(file, |value: i8| f64::from(value)),
        (TypeChar::Uint, 8) => all(file, |value: u64| value as f64),
        (TypeChar::Uint, 4) => all(file, |value: u32| f64::from(value)),
        (TypeChar::Uint, 2) => all(file, |value: u16| f64::from(value)),
        (TypeChar::Uint, 1) => all(file, |value: u8| f64::from(value)),
        (TypeChar::Bool, _) => all(file, |value: bool| f64::from(u8::from(value))),
        _ => Err(EntryError::Type(kind.to_string())),
    }
}
