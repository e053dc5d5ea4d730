//! The plant of a design file: its own matrices, those of a MATLAB or NumPy file, or a named model.

use crate::assemble::{LARGEST_SIZE, at};
use crate::check::{self, ValueError};
use crate::notes::Notes;
use crate::schema::{self, DesignFile, PlantModel};
use crate::values::Matrix;
use crate::wording;
use ftc_plant::rows;
use ftc_plant::{Dimensions, Mode, OperatingPoint, SwitchedPlant};
use ftc_tables::matrices::Matrices;
use nalgebra::DMatrix;
use std::path::Path;

/// A plant in samples and without direct feedthrough.
pub(crate) struct Found {
    /// The plant; its last states hold past inputs where it had a direct feedthrough.
    pub(crate) plant: SwitchedPlant,
    /// How many do.
    pub(crate) held_inputs: usize,
    /// The modes as they stand in the file; none of a named model.
    given: Vec<Given>,
}

impl Found {
    /// This plant with other matrices, of the same sizes and treated in the same way.
    pub(crate) fn with_other_matrices(
        &self,
        file: &DesignFile,
        others: &Others,
    ) -> Result<SwitchedPlant, String> {
        let modes = others.modes;
        if modes.len() != self.given.len() {
            return Err(format!(
                "mode has {} entries: give one for each of the {} modes, empty where nothing differs",
                modes.len(),
                self.given.len()
            ));
        }
        let mut given = self.given.clone();
        for (index, (own, other)) in given.iter_mut().zip(modes).enumerate() {
            let source = Source::of(other, others.folder).map_err(|what| in_mode(index, &what))?;
            own.replace(&source).map_err(|what| in_mode(index, &what))?;
            if others.continuous != is_continuous(file) {
                complete(&source, own, others.continuous).map_err(|what| in_mode(index, &what))?;
            }
        }
        let plant = assembled(file, &given)?;
        if sized(&plant)? != sized(&assembled(file, &self.given)?)? {
            return Err(
                "the matrices have other sizes than those of the model: keep to them".into(),
            );
        }
        if !others.continuous && plant.looks_continuous() {
            others.notes.add(looks_continuous("scenario.plant."));
        }
        let found = sampled_and_extended(file, plant, given, others.continuous)?;
        if found.held_inputs != self.held_inputs {
            return Err(
                "D is that of the true plant alone: give the modes of the model one too".into(),
            );
        }
        Ok(found.plant)
    }
}

/// The matrices of a true plant, as the file gives them.
pub(crate) struct Others<'a> {
    pub(crate) modes: &'a [schema::Mode],
    /// Whether they describe `dx/dt`.
    pub(crate) continuous: bool,
    pub(crate) folder: &'a Path,
    pub(crate) notes: &'a Notes,
}

/// Whether the modes of a file describe `dx/dt`.
pub(crate) fn is_continuous(file: &DesignFile) -> bool {
    file.continuous == Some(true)
}

/// Refuses a mode that leaves to the model what the model says about the other kind of time.
fn complete(source: &Source, own: &Given, continuous: bool) -> Result<(), String> {
    let disturbed = own.mode.e.ncols() > 0;
    for (name, needed) in [("A", true), ("B", true), ("E", disturbed)] {
        if needed && source.optional(name)?.is_none() {
            return Err(format!(
                "{name} is missing: with continuous = {continuous} it cannot be taken from the model, whose matrices are \
                 not: add it"
            ));
        }
    }
    Ok(())
}

/// What is said of a stable continuous-time model that is taken for a discrete one.
fn looks_continuous(table: &str) -> String {
    format!(
        "{table}{}every eigenvalue of A has a negative real part, as in a stable continuous-time model, but A and B are \
         taken as discrete, x(k+1) = A x(k) + B u(k): set {table}continuous = true if they describe dx/dt",
        if table.is_empty() { "" } else { "mode: " }
    )
}

/// One mode as it stands in the file.
#[derive(Clone)]
struct Given {
    mode: Mode,
    /// `D` (p x m), if it is not zero.
    feedthrough: Option<DMatrix<f64>>,
}

/// Reads the plant; other files are sought in `folder`.
///
/// # Errors
/// One sentence that names the key and what to do.
pub(crate) fn read(file: &DesignFile, folder: &Path, notes: &Notes) -> Result<Found, String> {
    at("sample_time", check::positive(file.sample_time))?;
    let modes = match (&file.plant, file.modes.is_empty()) {
        (Some(model), true) => return named(model, file),
        (Some(_), false) => {
            return Err(
                "[plant] and [[mode]] exclude each other: a named model brings its own modes"
                    .into(),
            );
        }
        (None, true) => {
            return Err(
                "mode is missing: add at least one [[mode]], or a [plant] with a model".into(),
            );
        }
        (None, false) => given_modes(file, folder)?,
    };
    let plant = assembled(file, &modes)?;
    check_magnitudes(&plant, sized(&plant)?)?;
    if !is_continuous(file) && plant.looks_continuous() {
        notes.add(looks_continuous(""));
    }
    sampled_and_extended(file, plant, modes, is_continuous(file))
}

/// The modes as one plant, as it stands in the file.
fn assembled(file: &DesignFile, modes: &[Given]) -> Result<SwitchedPlant, String> {
    let plant = SwitchedPlant::new(
        file.sample_time,
        modes.iter().map(|given| given.mode.clone()).collect(),
    );
    sized(&plant).map(|_| plant)
}

/// In samples, and without direct feedthrough.
fn sampled_and_extended(
    file: &DesignFile,
    mut plant: SwitchedPlant,
    given: Vec<Given>,
    continuous: bool,
) -> Result<Found, String> {
    if continuous {
        sample(&mut plant)?;
    }
    extend(plant, given, file.controller.latency.unwrap_or(0))
}

/// A named model, which is sampled and has no feedthrough.
fn named(model: &PlantModel, file: &DesignFile) -> Result<Found, String> {
    if file.continuous.is_some() {
        return Err(
            "continuous belongs to [[mode]]: leave it out beside [plant], which is sampled anyway"
                .into(),
        );
    }
    let plant = linearised(model, file.sample_time)?;
    check_magnitudes(&plant, sized(&plant)?)?;
    Ok(Found {
        plant,
        held_inputs: 0,
        given: Vec::new(),
    })
}

/// Samples every mode of a continuous plant.
fn sample(plant: &mut SwitchedPlant) -> Result<(), String> {
    let step = plant.sample_time;
    for (index, mode) in plant.modes.iter_mut().enumerate() {
        *mode = mode.sampled(step);
        let sound = |matrix: &DMatrix<f64>| matrix.iter().all(|&v| check::number(v).is_ok());
        if !(sound(&mode.a) && sound(&mode.b) && sound(&mode.e)) {
            return Err(format!(
                "mode {}: A grows beyond all bounds within sample_time = {step} s: \
                 give a shorter sample_time, or check the units of A",
                index + 1
            ));
        }
    }
    Ok(())
}

/// Makes states of inputs that act on outputs directly.
fn extend(mut plant: SwitchedPlant, given: Vec<Given>, latency: i64) -> Result<Found, String> {
    let Some(first) = given.iter().position(|mode| mode.feedthrough.is_some()) else {
        return Ok(Found {
            plant,
            held_inputs: 0,
            given,
        });
    };
    if latency == 0 {
        return Err(format!(
            "mode {}: D is not zero, so with controller.latency = 0 a command would act on the very reading that it is \
             computed from: set controller.latency = 1, or leave D out if it may be neglected",
            first + 1
        ));
    }
    let Dimensions {
        inputs, outputs, ..
    } = plant.dimensions();
    for (index, (mode, given)) in plant.modes.iter_mut().zip(&given).enumerate() {
        let none = DMatrix::zeros(outputs, inputs);
        let feedthrough = given.feedthrough.as_ref().unwrap_or(&none);
        if feedthrough.shape() != (outputs, inputs) {
            return Err(format!(
                "mode {}: D is {} x {}, but with C and B it has to be {outputs} x {inputs}",
                index + 1,
                feedthrough.nrows(),
                feedthrough.ncols()
            ));
        }
        *mode = mode.with_feedthrough(feedthrough);
    }
    check_magnitudes(&plant, plant.dimensions())?;
    Ok(Found {
        plant,
        held_inputs: inputs,
        given,
    })
}

fn given_modes(file: &DesignFile, folder: &Path) -> Result<Vec<Given>, String> {
    if file.modes.len() > LARGEST_SIZE {
        return Err(format!(
            "mode: there are {} modes: give at most {LARGEST_SIZE}",
            file.modes.len()
        ));
    }
    let sources: Result<Vec<Source>, String> = file
        .modes
        .iter()
        .enumerate()
        .map(|(index, mode)| Source::of(mode, folder).map_err(|what| in_mode(index, &what)))
        .collect();
    let sources = sources?;
    let width = |source: &Source| {
        let of = |name| source.optional(name).ok().flatten();
        of("E").or_else(|| of("F")).map(|matrix| matrix.ncols())
    };
    let disturbances = sources.iter().find_map(width).unwrap_or(0);
    sources
        .iter()
        .enumerate()
        .map(|(index, source)| {
            mode(source, index + 1, disturbances).map_err(|what| in_mode(index, &what))
        })
        .collect()
}

fn in_mode(index: usize, what: &str) -> String {
    format!("mode {}: {what}", index + 1)
}

/// Where the matrices of one mode come from.
struct Source<'a> {
    given: &'a schema::Mode,
    /// The file's name and what is in it.
    file: Option<(&'a str, Matrices)>,
}

impl<'a> Source<'a> {
    fn of(given: &'a schema::Mode, folder: &Path) -> Result<Self, String> {
        let file = given.file.as_deref();
        if file.is_none() && given.structure.is_some() {
            return Err("struct names a structure in a file: give file as well".into());
        }
        let read = |name: &'a str| {
            let found = Matrices::read(&folder.join(name))
                .map_err(|what| format!("file = \"{name}\" {what}"))?;
            Ok::<_, String>((name, found))
        };
        Ok(Self {
            given,
            file: file.map(read).transpose()?,
        })
    }

    /// What the design file says of a matrix.
    fn said(&self, name: &str) -> Option<&Matrix> {
        let mode = self.given;
        match name {
            "A" => mode.a.as_ref(),
            "B" => mode.b.as_ref(),
            "C" => mode.c.as_ref(),
            "D" => mode.d.as_ref(),
            "E" => mode.e.as_ref(),
            _ => mode.f.as_ref(),
        }
    }

    /// A matrix that there has to be.
    fn required(&self, name: &str) -> Result<DMatrix<f64>, String> {
        match (self.optional(name)?, &self.file) {
            (Some(matrix), _) => Ok(matrix),
            (None, None) => Err(format!(
                "{name} is missing: add it, or a file that holds it"
            )),
            (None, Some((file, found))) => {
                let names: Vec<&str> = found.names().collect();
                Err(format!(
                    "{name} is missing: file = \"{file}\" has no variable {}: say which of its variables it is, \
                     {name} = \"...\", out of {}",
                    self.path(name),
                    names.join(", ")
                ))
            }
        }
    }

    /// A matrix that may be absent.
    fn optional(&self, name: &str) -> Result<Option<DMatrix<f64>>, String> {
        match (self.said(name), &self.file) {
            (Some(Matrix::Rows(rows)), _) => matrix(name, rows).map(Some),
            (Some(Matrix::Name(variable)), None) => Err(format!(
                "{name} = \"{}\" names a variable, but there is no file: add file = \"...\", or give {name} as a list of rows",
                crate::sentence::shorten(variable)
            )),
            (Some(Matrix::Name(variable)), Some((file, found))) => {
                let path = self.path(variable);
                let variable = if found.holds(&path) { &path } else { variable };
                read_matrix(file, found, variable).map(Some)
            }
            (None, Some((file, found))) => {
                let Some(path) = self.usual(name, found) else {
                    return Ok(None);
                };
                let matrix = read_matrix(file, found, &path)?;
                // MATLAB writes [] for what a model does not have.
                let absent = matrix.is_empty() && !matches!(name, "A" | "B" | "C");
                Ok((!absent).then_some(matrix))
            }
            (None, None) => Ok(None),
        }
    }

    fn path(&self, variable: &str) -> String {
        match &self.given.structure {
            Some(structure) => format!("{structure}.{variable}"),
            None => variable.to_string(),
        }
    }

    /// Where a matrix stands that the design file does not mention: under its own letter, large or
    /// small, in the structure that is named, at the top, or in the only structure with `A`, `B`, `C`.
    fn usual(&self, name: &str, found: &Matrices) -> Option<String> {
        let spelt = [name.to_string(), name.to_lowercase()];
        let direct = spelt
            .iter()
            .map(|name| self.path(name))
            .find(|path| found.holds(path));
        if direct.is_some() || self.given.structure.is_some() {
            return direct;
        }
        let models: Vec<&str> = found
            .names()
            .filter_map(|path| path.strip_suffix(".A").or(path.strip_suffix(".a")))
            .collect();
        let [model] = models[..] else { return None };
        spelt
            .iter()
            .map(|name| format!("{model}.{name}"))
            .find(|path| found.holds(path))
    }
}

/// The matrix of that name in the file, finite.
fn read_matrix(file: &str, found: &Matrices, name: &str) -> Result<DMatrix<f64>, String> {
    let matrix = found
        .matrix(name)
        .map_err(|what| format!("file = \"{file}\" {what}"))?;
    sound(&format!("file = \"{file}\": {name}"), matrix)
}

fn mode(source: &Source, number: usize, disturbances: usize) -> Result<Given, String> {
    let (a, b, c) = (
        source.required("A")?,
        source.required("B")?,
        source.required("C")?,
    );
    let (n, p) = (a.nrows(), c.nrows());
    let channel = |name: &str, height: usize| {
        let given = source.optional(name)?;
        Ok::<_, String>(given.unwrap_or_else(|| DMatrix::zeros(height, disturbances)))
    };
    let operating_point = match &source.given.operating_point {
        Some(point) => OperatingPoint {
            x: point.x.clone(),
            u: point.u.clone(),
            y: point.y.clone(),
        },
        None => OperatingPoint::zero(n, b.ncols(), p),
    };
    let feedthrough = source.optional("D")?;
    if source
        .given
        .name
        .as_deref()
        .is_some_and(|name| !check::printable(name))
    {
        return Err(
            "name has a character that is not printable: give the mode another name".into(),
        );
    }
    Ok(Given {
        mode: Mode::new(a, b, c)
            .named(
                source
                    .given
                    .name
                    .clone()
                    .unwrap_or(format!("mode {number}")),
            )
            .with_disturbance(channel("E", n)?, channel("F", p)?)
            .about(operating_point),
        feedthrough: feedthrough.filter(|d| d.iter().any(|&entry| entry != 0.0)),
    })
}

impl Given {
    /// Puts the matrices that `source` has in the place of these.
    fn replace(&mut self, source: &Source) -> Result<(), String> {
        let mode = &mut self.mode;
        for (name, matrix) in [
            ("A", &mut mode.a),
            ("B", &mut mode.b),
            ("C", &mut mode.c),
            ("E", &mut mode.e),
            ("F", &mut mode.f),
        ] {
            if let Some(other) = source.optional(name)? {
                *matrix = other;
            }
        }
        if let Some(other) = source.optional("D")? {
            self.feedthrough = Some(other);
        }
        if source.given.operating_point.is_some() {
            return Err("operating_point is that of the model: leave it out".into());
        }
        Ok(())
    }
}

fn matrix(name: &str, given: &[Vec<f64>]) -> Result<DMatrix<f64>, String> {
    let matrix = rows::from_rows(given)
        .map_err(|what| format!("{name}: {what}: make all rows equally long"))?;
    sound(name, matrix)
}

/// A matrix of finite numbers of allowed size.
fn sound(name: &str, matrix: DMatrix<f64>) -> Result<DMatrix<f64>, String> {
    let unsound = |&value: &f64| check::number(value).is_err();
    match matrix.iter().position(unsound) {
        Some(entry) => Err(format!(
            "{name}: the entry in row {}, column {} {}",
            entry % matrix.nrows() + 1,
            entry / matrix.nrows() + 1,
            ValueError::Number(matrix[entry])
        )),
        None => Ok(matrix),
    }
}

/// Refuses what no solver could finish.
fn check_magnitudes(plant: &SwitchedPlant, dims: Dimensions) -> Result<(), String> {
    let sizes = [
        ("states (rows of A)", dims.states),
        ("inputs (columns of B)", dims.inputs),
        ("outputs (rows of C)", dims.outputs),
        ("disturbances (columns of E and F)", dims.disturbances),
    ];
    if let Some((what, size)) = sizes.iter().find(|(_, size)| *size > LARGEST_SIZE) {
        return Err(format!(
            "mode 1: there are {size} {what}: reduce the model to at most {LARGEST_SIZE}"
        ));
    }
    for (index, mode) in plant.modes.iter().enumerate() {
        let point = &mode.operating_point;
        for (name, values) in [("x", &point.x), ("u", &point.u), ("y", &point.y)] {
            at(
                &format!("mode {}: operating_point.{name}", index + 1),
                check::each(values, check::number),
            )?;
        }
    }
    Ok(())
}

/// The modes of a named model: its linearisations.
fn linearised(model: &PlantModel, sample_time: f64) -> Result<SwitchedPlant, String> {
    let PlantModel::Rectifier(rectifier) = model;
    let values = [
        ("inductance", rectifier.inductance),
        ("resistance", rectifier.resistance),
        ("capacitance", rectifier.capacitance),
        ("phase_voltage", rectifier.phase_voltage),
        ("current_loop", rectifier.current_loop),
        ("dc_voltage", rectifier.dc_voltage),
    ];
    for (key, value) in values {
        at(&format!("plant.{key}"), check::positive(value))?;
    }
    at(
        "plant.loads",
        check::each(&rectifier.loads, check::positive),
    )?;
    if rectifier.loads.is_empty() || rectifier.loads.len() > LARGEST_SIZE {
        return Err(format!(
            "plant.loads has {} entries: give 1 to {LARGEST_SIZE}, one per mode",
            rectifier.loads.len()
        ));
    }
    let linearised = rectifier.linearise(sample_time);
    linearised.map_err(|error| wording::of_rectifier(&error))
}

/// The sizes of a plant, or which matrix of which mode does not fit.
fn sized(plant: &SwitchedPlant) -> Result<Dimensions, String> {
    Dimensions::check(plant).map_err(|error| wording::of_plant(&error))
}
