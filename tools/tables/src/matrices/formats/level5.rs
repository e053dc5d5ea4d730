//! MATLAB's level 5 format, which `save` writes unless told otherwise, and `scipy.io.savemat`.

use super::{DEEPEST, Found, check_shape, from_columns};
use crate::{EntryError, Error};
use matrw::{MatVariable, MatlabType, load_matfile_from_u8};
use nalgebra::DMatrix;

/// How the text at the head of the file begins where MATLAB wrote it; SciPy leaves the comma out, and the
/// reader wants it. The text says who wrote the file and when, and nothing else.
const HEAD: &[u8] = b"MATLAB 5.0 MAT-file, ";

pub(super) fn read(bytes: &[u8]) -> Result<Found, Error> {
    let mut bytes = bytes.to_vec();
    if let Some(head) = bytes.get_mut(..HEAD.len()) {
        head.copy_from_slice(HEAD);
    }
    let file = load_matfile_from_u8(&bytes).map_err(|error| {
        let what = error.to_string();
        Error::Unreadable {
            kind: " as a MATLAB file",
            why: what.lines().next().unwrap_or_default().trim().to_string(),
            advice: "save it again, plain arrays or a structure of them",
        }
    })?;
    let mut found = Found::new();
    for (name, variable) in file.iter() {
        add(&mut found, name, variable, DEEPEST);
    }
    Ok(found)
}

fn add(found: &mut Found, name: &str, variable: &MatVariable, depth: usize) {
    match variable {
        MatVariable::NumericArray(_) => {
            found.insert(name.to_string(), dense(variable));
        }
        MatVariable::Structure(fields) if depth > 0 => {
            for field in fields.fieldnames() {
                if let Some(inner) = fields.get(&field) {
                    add(found, &format!("{name}.{field}"), inner, depth - 1);
                }
            }
        }
        _ => {
            found.insert(name.to_string(), Err(EntryError::NotReal(None)));
        }
    }
}

fn dense(variable: &MatVariable) -> Result<DMatrix<f64>, EntryError> {
    if variable.is_complex() == Some(true) {
        return Err(EntryError::Complex);
    }
    let shape = variable.dim();
    check_shape(&shape)?;
    from_columns(&shape, &entries(variable)?)
}

/// The entries column by column, whatever class MATLAB gave them.
fn entries(variable: &MatVariable) -> Result<Vec<f64>, EntryError> {
    fn all<T>(values: Option<Vec<T>>, number: impl Fn(T) -> f64) -> Option<Vec<f64>> {
        values.map(|values| values.into_iter().map(number).collect())
    }
    let values = match variable.numeric_type() {
        Some(MatlabType::F64(_)) => variable.to_vec_f64(),
        Some(MatlabType::F32(_)) => all(variable.to_vec_f32(), f64::from),
        Some(MatlabType::U8(_)) => all(variable.to_vec_u8(), f64::from),
        Some(MatlabType::I8(_)) => all(variable.to_vec_i8(), f64::from),
        Some(MatlabType::U16(_)) => all(variable.to_vec_u16(), f64::from),
        Some(MatlabType::I16(_)) => all(variable.to_vec_i16(), f64::from),
        Some(MatlabType::U32(_)) => all(variable.to_vec_u32(), f64::from),
        Some(MatlabType::I32(_)) => all(variable.to_vec_i32(), f64::from),
        Some(MatlabType::U64(_)) => all(variable.to_vec_u64(), |value| value as f64),
        Some(MatlabType::I64(_)) => all(variable.to_vec_i64(), |value| value as f64),
        Some(MatlabType::BOOL(_)) => {
            all(variable.to_vec_bool(), |value| f64::from(u8::from(value)))
        }
        _ => None,
    };
    values.ok_or(EntryError::Text)
}
