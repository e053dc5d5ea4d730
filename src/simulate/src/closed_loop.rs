//! The closed loop, controller first and then plant: what two coupled FMUs compute.

use super::metrics::{Merit, MeritSum};
use super::plant::{External, PlantSimulator, PlantState};
use ftc_control::{Compensate, Controller, ControllerState};
use ftc_record::Signal;
use serde::Serialize;

/// What closes the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[expect(
    clippy::exhaustive_enums,
    reason = "a new loop must be drawn and reported: the compiler says where"
)]
pub enum Variant {
    /// The design as it is: faults estimated and compensated.
    Ftc,
    /// The same gains without fault compensation, told the mode.
    NoFtc,
    /// The same gains, told the true fault and the mode: what a perfect estimate of it would give. One that also
    /// takes up disturbance or noise may do better.
    ToldTheFault,
    /// The additive FTC of the paper's section III: gains of Theorem 1, no attenuation.
    Additive,
    /// Model predictive control without fault estimation.
    Predictive,
}

impl Variant {
    /// The ways to run one controller, in the order they are reported.
    pub const ALL: [Self; 3] = [Self::Ftc, Self::NoFtc, Self::ToldTheFault];

    /// Its name in files.
    pub fn key(self) -> &'static str {
        match self {
            Self::Ftc => "ftc",
            Self::NoFtc => "no_ftc",
            Self::ToldTheFault => "told_the_fault",
            Self::Additive => "additive",
            Self::Predictive => "mpc",
        }
    }

    /// Whether a controller that would find the mode from the readings is told it, as what it is compared with.
    const fn is_told_the_mode(self) -> bool {
        matches!(self, Self::NoFtc | Self::ToldTheFault)
    }
}

/// What closes the loop: from the plant's outputs to a command.
pub trait Regulator {
    /// One tick.
    fn tick(&mut self, seen: &PlantState);
    /// Told which input (m) acts over the coming sample.
    fn advance(&mut self, _seen: &PlantState, _acting: &[f64]) {}
    /// The command (m).
    fn command(&self) -> &[f64];
    /// What else it has to say.
    fn report(&self) -> Report<'_>;
}

/// A regulator's inner signals after a tick.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Report<'a> {
    /// State estimate (n).
    pub estimate: &'a [f64],
    /// Fault estimate (p).
    pub fault: &'a [f64],
    /// Residual (p).
    pub residual: &'a [f64],
    /// Declared faults (p).
    pub flagged: &'a [bool],
    /// The mode (0-based) found from the readings, where it is not told.
    pub mode: Option<usize>,
}

impl<'a> Report<'a> {
    /// Of a regulator that is told the mode.
    pub fn new(
        estimate: &'a [f64],
        fault: &'a [f64],
        residual: &'a [f64],
        flagged: &'a [bool],
    ) -> Self {
        Self {
            estimate,
            fault,
            residual,
            flagged,
            mode: None,
        }
    }
}

/// Every signal of one sample.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Record {
    /// Tick.
    pub tick: u64,
    /// Active mode (0-based).
    pub mode: usize,
    /// Reference (r).
    pub reference: Vec<f64>,
    /// Disturbance (s).
    pub disturbance: Vec<f64>,
    /// Noise (p).
    pub noise: Vec<f64>,
    /// True fault (p).
    pub fault: Vec<f64>,
    /// Measured output (p).
    pub y: Vec<f64>,
    /// True output (p).
    pub y_true: Vec<f64>,
    /// Plant state (n).
    pub x: Vec<f64>,
    /// Command (m).
    pub u: Vec<f64>,
    /// State estimate (n).
    pub x_hat: Vec<f64>,
    /// Fault estimate (p).
    pub f_hat: Vec<f64>,
    /// Residual (p).
    pub residual: Vec<f64>,
    /// Declared faults (p).
    pub flagged: Vec<bool>,
    /// The mode (0-based) found from the readings, where it is not told.
    pub mode_hat: Option<usize>,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Trajectory {
    /// How the controller was run.
    pub variant: Variant,
    /// One record per sample.
    pub records: Vec<Record>,
    /// The first tick, if any, that the plant's equations could not be integrated through; what
    /// follows it means nothing.
    pub stalled: Option<u64>,
}

/// Figures of merit of one tracked output.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Merits {
    /// What the sensor says.
    pub measured: Merit,
    /// What the plant does.
    pub true_output: Merit,
}

/// The tolerant controller in one of its variants.
struct Tolerant<'a> {
    controller: &'a Controller,
    state: ControllerState,
    variant: Variant,
}

impl<'a> Tolerant<'a> {
    /// At rest in the mode in which the plant begins.
    fn new(plant: &PlantSimulator, controller: &'a Controller, variant: Variant) -> Self {
        Self {
            controller,
            state: controller.initial_state(plant.initial_state().mode),
            variant,
        }
    }

    /// Whether its command acts one tick later.
    fn is_delayed(&self) -> bool {
        self.controller.parameters().feedback.latency > 0
    }
}

impl Regulator for Tolerant<'_> {
    fn tick(&mut self, seen: &PlantState) {
        let compensate = match self.variant {
            Variant::NoFtc => Compensate::Nothing,
            Variant::ToldTheFault => Compensate::Known(&seen.fault),
            _ => Compensate::Estimate,
        };
        let sample = self
            .controller
            .sample(seen.tick, seen.told, &seen.y, &seen.reference)
            .and_then(|sample| sample.compensating(compensate))
            .expect("plant and controller have the same sizes");
        let sample = match self.variant.is_told_the_mode() {
            true => sample.telling_the_mode(),
            false => sample,
        };
        self.controller.tick(&mut self.state, &sample);
    }

    fn command(&self) -> &[f64] {
        &self.state.command
    }

    fn report(&self) -> Report<'_> {
        let estimator = &self.state.estimator;
        Report {
            estimate: &self.state.observer.estimate,
            fault: &estimator.fault,
            residual: &estimator.residual,
            flagged: &estimator.flagged,
            mode: match self.variant.is_told_the_mode() {
                true => None,
                false => self.controller.found_mode(&self.state),
            },
        }
    }
}

/// Runs the scenario once with the tolerant controller. With latency 1 the command computed at a
/// tick acts from the next tick on, as it does when a master steps both FMUs in parallel.
pub fn run(plant: &PlantSimulator, controller: &Controller, variant: Variant) -> Trajectory {
    let mut regulator = Tolerant::new(plant, controller, variant);
    let delayed = regulator.is_delayed();
    run_with(plant, &mut regulator, variant, delayed)
}

/// One sample of a running loop.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Seen<'a> {
    /// The plant, observed at this tick.
    pub plant: &'a PlantState,
    /// The command computed at this tick (m).
    pub command: &'a [f64],
    /// The regulator's inner signals.
    pub report: Report<'a>,
}

impl Seen<'_> {
    /// The squares of the true tracking errors in nominal values, added up; `tracked` are rows of the
    /// outputs (p).
    pub fn square_error(&self, tracked: &[usize], outputs: &[Signal]) -> f64 {
        let rows = tracked.iter().zip(&self.plant.reference);
        rows.map(|(&row, reference)| {
            let error = (self.plant.y_true[row] - reference) / outputs[row].nominal;
            error * error
        })
        .sum()
    }
}

/// As [`run`], but shows each sample to `visit` and keeps none. Returns the first tick, if any, that
/// the plant's equations could not be integrated through.
pub fn visit(
    plant: &PlantSimulator,
    controller: &Controller,
    variant: Variant,
    visit: &mut dyn FnMut(&Seen<'_>),
) -> Option<u64> {
    let mut regulator = Tolerant::new(plant, controller, variant);
    let delayed = regulator.is_delayed();
    drive(plant, &mut regulator, delayed, &mut |state, regulator| {
        visit(&Seen {
            plant: state,
            command: regulator.command(),
            report: regulator.report(),
        });
    })
}

/// Runs the scenario once with any regulator; `delayed` commands act one tick later.
pub fn run_with(
    plant: &PlantSimulator,
    regulator: &mut dyn Regulator,
    variant: Variant,
    delayed: bool,
) -> Trajectory {
    let mut records = Vec::with_capacity(plant.scenario().steps as usize);
    let stalled = drive(plant, regulator, delayed, &mut |state, regulator| {
        records.push(record(state, regulator));
    });
    Trajectory {
        variant,
        records,
        stalled,
    }
}

/// Closes the loop for the length of the scenario, and shows each sample after the regulator's tick.
fn drive(
    plant: &PlantSimulator,
    regulator: &mut dyn Regulator,
    delayed: bool,
    show: &mut dyn FnMut(&PlantState, &dyn Regulator),
) -> Option<u64> {
    let mut closed = Loop::new(plant, Box::new(regulator), delayed);
    for _ in 0..plant.scenario().steps {
        closed.tick();
        show(&closed.state, &*closed.regulator);
        closed.advance();
    }
    closed.stalled
}

impl<R: Regulator + ?Sized> Regulator for &mut R {
    fn tick(&mut self, seen: &PlantState) {
        (**self).tick(seen);
    }

    fn advance(&mut self, seen: &PlantState, acting: &[f64]) {
        (**self).advance(seen, acting);
    }

    fn command(&self) -> &[f64] {
        (**self).command()
    }

    fn report(&self) -> Report<'_> {
        (**self).report()
    }
}

/// A loop that is closed sample by sample, so that several can be run side by side: [`tick`](Self::tick),
/// [`record`](Self::record), [`advance`](Self::advance).
pub struct Loop<'a> {
    plant: &'a PlantSimulator,
    regulator: Box<dyn Regulator + 'a>,
    delayed: bool,
    state: PlantState,
    acting: Vec<f64>,
    fault: Vec<f64>,
    disturbance: Vec<f64>,
    stalled: Option<u64>,
}

impl<'a> Loop<'a> {
    /// A loop at rest; `delayed` commands act one tick later.
    pub fn new(
        plant: &'a PlantSimulator,
        regulator: Box<dyn Regulator + 'a>,
        delayed: bool,
    ) -> Self {
        let state = plant.initial_state();
        Self {
            plant,
            delayed,
            acting: regulator.command().to_vec(),
            regulator,
            fault: vec![0.0; state.y.len()],
            disturbance: vec![0.0; state.disturbance.len()],
            state,
            stalled: None,
        }
    }

    /// A loop at rest with the tolerant controller.
    pub fn tolerant(
        plant: &'a PlantSimulator,
        controller: &'a Controller,
        variant: Variant,
    ) -> Self {
        let tolerant = Tolerant::new(plant, controller, variant);
        let delayed = tolerant.is_delayed();
        Self::new(plant, Box::new(tolerant), delayed)
    }

    /// Observes the plant and computes a command.
    pub fn tick(&mut self) {
        let external = External::new(&self.fault, &self.disturbance);
        self.plant.observe(&mut self.state, &external);
        self.regulator.tick(&self.state);
    }

    /// The sample, after its tick.
    pub fn record(&self) -> Record {
        record(&self.state, &*self.regulator)
    }

    /// Lets the command act until the next sample.
    pub fn advance(&mut self) {
        if !self.delayed {
            self.acting.copy_from_slice(self.regulator.command());
        }
        self.regulator.advance(&self.state, &self.acting);
        let tick = self.state.tick;
        if self.plant.advance(&mut self.state, &self.acting).is_err() {
            self.stalled = self.stalled.or(Some(tick));
        }
        self.acting.copy_from_slice(self.regulator.command());
    }

    /// The first tick, if any, that the plant's equations could not be integrated through.
    pub fn stalled(&self) -> Option<u64> {
        self.stalled
    }
}

fn record(plant: &PlantState, regulator: &dyn Regulator) -> Record {
    let report = regulator.report();
    Record {
        tick: plant.tick,
        mode: plant.mode,
        reference: plant.reference.clone(),
        disturbance: plant.disturbance.clone(),
        noise: plant.noise.clone(),
        fault: plant.fault.clone(),
        y: plant.y.clone(),
        y_true: plant.y_true.clone(),
        x: plant.x.clone(),
        u: regulator.command().to_vec(),
        x_hat: report.estimate.to_vec(),
        f_hat: report.fault.to_vec(),
        residual: report.residual.to_vec(),
        flagged: report.flagged.to_vec(),
        mode_hat: report.mode,
    }
}

/// Samples in which another mode was found from the readings than the plant was in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WrongModes {
    /// How many.
    pub samples: u64,
    /// Most in a row.
    pub longest: u64,
}

/// [`WrongModes`], gathered sample by sample.
#[derive(Clone, Copy, Debug, Default)]
pub struct ModeWatch {
    found: bool,
    wrong: WrongModes,
    row: u64,
}

impl ModeWatch {
    /// Looks at a sample.
    pub fn see(&mut self, record: &Record) {
        self.found |= record.mode_hat.is_some();
        let wrong = record.mode_hat.is_some_and(|mode| mode != record.mode);
        self.row = if wrong { self.row + 1 } else { 0 };
        self.wrong.samples += u64::from(wrong);
        self.wrong.longest = self.wrong.longest.max(self.row);
    }

    /// How often another mode was found than the plant was in; none where the mode was told.
    pub fn wrong_modes(&self) -> Option<WrongModes> {
        self.found.then_some(self.wrong)
    }
}

impl Trajectory {
    /// How often another mode was found than the plant was in; none where the mode was told.
    pub fn wrong_modes(&self) -> Option<WrongModes> {
        let mut watch = ModeWatch::default();
        self.records.iter().for_each(|record| watch.see(record));
        watch.wrong_modes()
    }

    /// Figures of merit of each tracked output (rows of `tracked`, 0-based), as far as the plant could
    /// be integrated.
    pub fn merits(&self, tracked: &[usize]) -> Vec<Merits> {
        let mut sums = MeritSums::new(tracked);
        let before_stall = |record: &&Record| self.stalled.is_none_or(|end| record.tick <= end);
        for record in self.records.iter().take_while(before_stall) {
            sums.add(record);
        }
        sums.merits()
    }
}

/// The figures of merit of a run, gathered sample by sample.
#[derive(Clone, Debug)]
pub struct MeritSums {
    tracked: Vec<usize>,
    /// Per tracked output, measured and true.
    sums: Vec<[MeritSum; 2]>,
}

impl MeritSums {
    /// Nothing yet, of these outputs (0-based).
    pub fn new(tracked: &[usize]) -> Self {
        Self {
            sums: vec![Default::default(); tracked.len()],
            tracked: tracked.to_vec(),
        }
    }

    /// Adds a sample.
    pub fn add(&mut self, record: &Record) {
        let outputs = self.tracked.iter().zip(&record.reference);
        for ([measured, true_output], (&row, &reference)) in self.sums.iter_mut().zip(outputs) {
            measured.add(record.y[row], reference);
            true_output.add(record.y_true[row], reference);
        }
    }

    /// The figures of each tracked output.
    pub fn merits(&self) -> Vec<Merits> {
        let of = |[measured, true_output]: &[MeritSum; 2]| Merits {
            measured: measured.merit(),
            true_output: true_output.merit(),
        };
        self.sums.iter().map(of).collect()
    }
}
