//! The plant of a design file: its own matrices, those of a MATLAB or NumPy file, or a named model.

use crate::assemble::LARGEST_SIZE;
use crate::check::{self, NumberError};
use crate::complaint::{Complaint, Key, at};
use crate::notes::Notes;
use crate::schema::{self, DesignFile, PlantModel};
use crate::values::Matrix;
use crate::wording;
use ftc_design::ControlSpec;
use ftc_design::words::counted;
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
    ) -> Result<SwitchedPlant, Complaint> {
        let modes = others.modes;
        if modes.len() != self.given.len() {
            return Err(Complaint::of(
                "mode",
                format!(
                    "has {}, but the model has {}: give one for each, empty where nothing differs",
                    counted(modes.len(), "entry", "entries"),
                    counted(self.given.len(), "mode", "modes")
                ),
            ));
        }
        let mut given = self.given.clone();
        for (index, (own, other)) in given.iter_mut().zip(modes).enumerate() {
            let mut replace = || {
                let source = Source::of(other, others.folder)?;
                own.replace(&source)?;
                match others.continuous == is_continuous(file) {
                    true => Ok(()),
                    false => complete(&source, own, others.continuous),
                }
            };
            replace().map_err(in_mode(index))?;
        }
        let plant = assembled(file, &given)?;
        if !others.continuous && plant.looks_continuous() {
            others.notes.add(looks_continuous("scenario.plant."));
        }
        let found = sampled_and_extended(file, plant, given, others.continuous)?;
        if found.held_inputs != self.held_inputs {
            return Err(Complaint::of(
                "mode",
                "has a D, but the model has none: give the modes of the model one too",
            ));
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
fn complete(source: &Source, own: &Given, continuous: bool) -> Result<(), Complaint> {
    let disturbed = own.mode.e.ncols() > 0;
    for (name, needed) in [("A", true), ("B", true), ("E", disturbed)] {
        if needed && source.optional(name)?.is_none() {
            return Err(Complaint::of(
                name,
                format!(
                    "is missing: with continuous = {continuous} it cannot be taken from the model, whose matrices are \
                     not: add it"
                ),
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
/// What is wrong with which key, and what to do.
pub(crate) fn read(file: &DesignFile, folder: &Path, notes: &Notes) -> Result<Found, Complaint> {
    at("sample_time", check::positive(file.sample_time))?;
    let modes = match (&file.plant, file.modes.is_empty()) {
        (Some(model), true) => return named(model, file),
        (Some(_), false) => {
            return Err(Complaint::general(
                "[plant] and [[mode]] exclude each other: a named model brings its own modes, so leave one of them out",
            ));
        }
        (None, true) => {
            return Err(Complaint::of(
                "mode",
                "is missing: add at least one [[mode]], or a [plant] with a model",
            ));
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
fn assembled(file: &DesignFile, modes: &[Given]) -> Result<SwitchedPlant, Complaint> {
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
) -> Result<Found, Complaint> {
    if continuous {
        sample(&mut plant)?;
    }
    extend(
        plant,
        given,
        file.controller
            .latency
            .unwrap_or(ControlSpec::LATENCY as i64),
    )
}

/// A named model, which is sampled and has no feedthrough.
fn named(model: &PlantModel, file: &DesignFile) -> Result<Found, Complaint> {
    if file.continuous.is_some() {
        return Err(Complaint::of(
            "continuous",
            "belongs to [[mode]]: leave it out beside [plant], which is sampled anyway",
        ));
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
fn sample(plant: &mut SwitchedPlant) -> Result<(), Complaint> {
    let step = plant.sample_time;
    for (index, mode) in plant.modes.iter_mut().enumerate() {
        *mode = mode.sampled(step);
        let sound = |matrix: &DMatrix<f64>| matrix.iter().all(|&v| check::number(v).is_ok());
        if !(sound(&mode.a) && sound(&mode.b) && sound(&mode.e)) {
            return Err(Complaint::of(
                Key::mode(index).then("A"),
                format!(
                    "grows beyond all bounds within sample_time = {step} s: give a shorter sample_time, or check the \
                     units of A"
                ),
            ));
        }
    }
    Ok(())
}

/// Makes states of inputs that act on outputs directly.
fn extend(mut plant: SwitchedPlant, given: Vec<Given>, latency: i64) -> Result<Found, Complaint> {
    let Some(first) = given.iter().position(|mode| mode.feedthrough.is_some()) else {
        return Ok(Found {
            plant,
            held_inputs: 0,
            given,
        });
    };
    if latency == 0 {
        return Err(Complaint::of(
            Key::mode(first).then("D"),
            "is not zero, so with controller.latency = 0 a command would act on the very reading that it is computed \
             from: set controller.latency = 1, or leave D out if it may be neglected",
        ));
    }
    let Dimensions {
        inputs, outputs, ..
    } = plant.dimensions();
    for (index, (mode, given)) in plant.modes.iter_mut().zip(&given).enumerate() {
        let none = DMatrix::zeros(outputs, inputs);
        let feedthrough = given.feedthrough.as_ref().unwrap_or(&none);
        if feedthrough.shape() != (outputs, inputs) {
            return Err(Complaint::of(
                Key::mode(index).then("D"),
                format!(
                    "is {} x {}, but with C and B it has to be {outputs} x {inputs}: give it that size",
                    feedthrough.nrows(),
                    feedthrough.ncols()
                ),
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

fn given_modes(file: &DesignFile, folder: &Path) -> Result<Vec<Given>, Complaint> {
    if file.modes.len() > LARGEST_SIZE {
        return Err(Complaint::of(
            "mode",
            format!(
                ": there are {} modes: give at most {LARGEST_SIZE}",
                file.modes.len()
            ),
        ));
    }
    let sources: Result<Vec<Source>, Complaint> = file
        .modes
        .iter()
        .enumerate()
        .map(|(index, mode)| Source::of(mode, folder).map_err(in_mode(index)))
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
        .map(|(index, source)| mode(source, index + 1, disturbances).map_err(in_mode(index)))
        .collect()
}

/// Says of a complaint in which mode it is.
fn in_mode(index: usize) -> impl Fn(Complaint) -> Complaint {
    move |what| what.inside(Key::mode(index))
}

/// Where the matrices of one mode come from.
struct Source<'a> {
    given: &'a schema::Mode,
    /// The file's name and what is in it.
    file: Option<(&'a str, Matrices)>,
}

impl<'a> Source<'a> {
    fn of(given: &'a schema::Mode, folder: &Path) -> Result<Self, Complaint> {
        let file = given.file.as_deref();
        if file.is_none() && given.structure.is_some() {
            return Err(Complaint::of(
                "struct",
                "names a structure in a file: give file as well",
            ));
        }
        let read = |name: &'a str| {
            let found = Matrices::read(&folder.join(name))
                .map_err(|what| Complaint::of("file", format!("= \"{name}\" {what}")))?;
            Ok::<_, Complaint>((name, found))
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
    fn required(&self, name: &str) -> Result<DMatrix<f64>, Complaint> {
        match (self.optional(name)?, &self.file) {
            (Some(matrix), _) => Ok(matrix),
            (None, None) => Err(Complaint::of(
                name,
                "is missing: add it, or a file that holds it",
            )),
            (None, Some((file, found))) => {
                let names: Vec<&str> = found.names().collect();
                Err(Complaint::of(
                    name,
                    format!(
                        "is missing: file = \"{file}\" has no variable {}: say which of its variables it is, \
                         {name} = \"...\", out of {}",
                        self.path(name),
                        names.join(", ")
                    ),
                ))
            }
        }
    }

    /// A matrix that may be absent.
    fn optional(&self, name: &str) -> Result<Option<DMatrix<f64>>, Complaint> {
        match (self.said(name), &self.file) {
            (Some(Matrix::Rows(rows)), _) => matrix(name, rows).map(Some),
            (Some(Matrix::Name(variable)), None) => Err(Complaint::of(
                name,
                format!(
                    "= \"{}\" names a variable, but there is no file: add file = \"...\", or give {name} as a list of rows",
                    crate::sentence::shorten(variable)
                ),
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
fn read_matrix(file: &str, found: &Matrices, name: &str) -> Result<DMatrix<f64>, Complaint> {
    let matrix = found
        .matrix(name)
        .map_err(|what| Complaint::of("file", format!("= \"{file}\" {what}")))?;
    match unsound(&matrix) {
        Some(what) => Err(Complaint::of(
            "file",
            format!("= \"{file}\": {name}: {what}"),
        )),
        None => Ok(matrix),
    }
}

fn mode(source: &Source, number: usize, disturbances: usize) -> Result<Given, Complaint> {
    let (a, b, c) = (
        source.required("A")?,
        source.required("B")?,
        source.required("C")?,
    );
    let (n, p) = (a.nrows(), c.nrows());
    let channel = |name: &str, height: usize| {
        let given = source.optional(name)?;
        Ok::<_, Complaint>(given.unwrap_or_else(|| DMatrix::zeros(height, disturbances)))
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
        return Err(Complaint::of(
            "name",
            "has a character that is not printable: give the mode another name",
        ));
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
    fn replace(&mut self, source: &Source) -> Result<(), Complaint> {
        let mode = &mut self.mode;
        for (name, matrix) in [
            ("A", &mut mode.a),
            ("B", &mut mode.b),
            ("C", &mut mode.c),
            ("E", &mut mode.e),
            ("F", &mut mode.f),
        ] {
            if let Some(other) = source.optional(name)? {
                let [(rows, columns), model] = [other.shape(), matrix.shape()];
                if (rows, columns) != model {
                    return Err(Complaint::of(
                        name,
                        format!(
                            "is {rows} x {columns}, but that of the model is {} x {}: give it that size",
                            model.0, model.1
                        ),
                    ));
                }
                *matrix = other;
            }
        }
        if let Some(other) = source.optional("D")? {
            self.feedthrough = Some(other);
        }
        if source.given.operating_point.is_some() {
            return Err(Complaint::of(
                "operating_point",
                "is that of the model: leave it out",
            ));
        }
        Ok(())
    }
}

fn matrix(name: &str, given: &[Vec<f64>]) -> Result<DMatrix<f64>, Complaint> {
    let matrix = rows::from_rows(given)
        .map_err(|what| Complaint::of(name, format!(": {what}: make all rows equally long")))?;
    match unsound(&matrix) {
        Some(what) => Err(Complaint::of(name, format!(": {what}"))),
        None => Ok(matrix),
    }
}

/// The first entry that is infinite, no number or of impractical size, if there is one.
fn unsound(matrix: &DMatrix<f64>) -> Option<String> {
    let entry = matrix
        .iter()
        .position(|&value| check::number(value).is_err())?;
    Some(format!(
        "the entry in row {}, column {} {}",
        entry % matrix.nrows() + 1,
        entry / matrix.nrows() + 1,
        NumberError::NotFinite(matrix[entry])
    ))
}

/// Refuses what no solver could finish.
fn check_magnitudes(plant: &SwitchedPlant, dims: Dimensions) -> Result<(), Complaint> {
    let sizes = [
        ("states (rows of A)", dims.states),
        ("inputs (columns of B)", dims.inputs),
        ("outputs (rows of C)", dims.outputs),
        ("disturbances (columns of E and F)", dims.disturbances),
    ];
    if let Some((what, size)) = sizes.iter().find(|(_, size)| *size > LARGEST_SIZE) {
        return Err(Complaint::of(
            Key::mode(0),
            format!(": there are {size} {what}: reduce the model to at most {LARGEST_SIZE}"),
        ));
    }
    for (index, mode) in plant.modes.iter().enumerate() {
        let point = &mode.operating_point;
        for (name, values) in [("x", &point.x), ("u", &point.u), ("y", &point.y)] {
            at(
                Key::mode(index).then("operating_point").then(name),
                check::each(values, check::number),
            )?;
        }
    }
    Ok(())
}

/// The modes of a named model: its linearisations.
fn linearised(model: &PlantModel, sample_time: f64) -> Result<SwitchedPlant, Complaint> {
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
        at(Key::from("plant").then(key), check::positive(value))?;
    }
    at(
        "plant.loads",
        check::each(&rectifier.loads, check::positive),
    )?;
    if rectifier.loads.is_empty() || rectifier.loads.len() > LARGEST_SIZE {
        return Err(Complaint::of(
            "plant.loads",
            format!(
                "has {}: give 1 to {LARGEST_SIZE}, one per mode",
                counted(rectifier.loads.len(), "entry", "entries")
            ),
        ));
    }
    let linearised = rectifier.linearise(sample_time);
    linearised.map_err(|error| wording::of_rectifier(&error))
}

/// The sizes of a plant, or which matrix of which mode does not fit.
fn sized(plant: &SwitchedPlant) -> Result<Dimensions, Complaint> {
    Ok(Dimensions::check(plant)?)
}
