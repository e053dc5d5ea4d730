//! The sizes of a plant, and the check that every matrix has them.

use super::SwitchedPlant;

/// Numbers of states `n`, inputs `m`, outputs `p` and disturbances `s`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dimensions {
    /// `n`
    pub states: usize,
    /// `m`
    pub inputs: usize,
    /// `p`
    pub outputs: usize,
    /// `s`
    pub disturbances: usize,
}

impl Dimensions {
    /// Says in one sentence which matrix of which mode has a wrong size or a non-finite entry.
    pub fn check(plant: &SwitchedPlant) -> Result<Self, String> {
        if plant.modes.is_empty() {
            return Err("the plant has no [[mode]]: give at least one".into());
        }
        if !(plant.sample_time.is_finite() && plant.sample_time > 0.0) {
            return Err(format!(
                "sample_time is {}: give a positive number of seconds",
                plant.sample_time
            ));
        }
        let dims = plant.dimensions();
        let Self {
            states: n,
            inputs: m,
            outputs: p,
            disturbances: s,
        } = dims;
        for (what, size) in [
            ("states (rows of A)", n),
            ("inputs (columns of B)", m),
            ("outputs (rows of C)", p),
        ] {
            if size == 0 {
                return Err(format!("mode 1 has no {what}: give at least one"));
            }
        }
        for (index, mode) in plant.modes.iter().enumerate() {
            let number = index + 1;
            let matrices = [
                ("A", &mode.a, (n, n)),
                ("B", &mode.b, (n, m)),
                ("C", &mode.c, (p, n)),
                ("E", &mode.e, (n, s)),
                ("F", &mode.f, (p, s)),
            ];
            for (name, matrix, (rows, columns)) in matrices {
                if matrix.shape() != (rows, columns) {
                    let reason = match index {
                        0 => format!("with A of {n} x {n} it has to be"),
                        _ => "mode 1 makes it".into(),
                    };
                    return Err(format!(
                        "mode {number}: {name} is {} x {}, but {reason} {rows} x {columns}",
                        matrix.nrows(),
                        matrix.ncols()
                    ));
                }
                if let Some(at) = matrix.iter().position(|value| !value.is_finite()) {
                    return Err(format!(
                        "mode {number}: {name} has a value that is not finite at row {}, column {}",
                        at % rows + 1,
                        at / rows + 1
                    ));
                }
            }
            let point = &mode.operating_point;
            for (name, vector, size) in [("x", &point.x, n), ("u", &point.u, m), ("y", &point.y, p)]
            {
                if vector.len() != size {
                    return Err(format!(
                        "mode {number}: operating_point.{name} has {} entries, but the plant needs {size}",
                        vector.len()
                    ));
                }
                if vector.iter().any(|value| !value.is_finite()) {
                    return Err(format!(
                        "mode {number}: operating_point.{name} is not finite"
                    ));
                }
            }
        }
        Ok(dims)
    }
}
