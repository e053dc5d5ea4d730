//! A controller and a plant, closed as a master does it.

use crate::{Functions, Instance, Model};
use fmu_abi::types::Status;
use model_description::Span;

/// Who steps first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coupling {
    /// The controller, whose new command the plant gets: no delay in the loop.
    GaussSeidel,
    /// Both from the same old signals: one communication step of delay.
    Jacobi,
}

/// Two instances and the signals between them.
pub struct Loop {
    /// The controller.
    pub controller: Instance,
    /// The plant.
    pub plant: Instance,
    start: f64,
    time: f64,
    from: [Span; 4],
    to: [Span; 4],
}

impl Loop {
    /// Instantiates and initializes both at time `start`, the plant first.
    pub fn new(functions: [Functions; 2], models: [&Model; 2], start: f64) -> Self {
        let make = |at: usize| Instance::new(functions[at], models[at]).expect("an instance");
        let (controller, plant) = (make(0), make(1));
        let names = ["y", "y_ref", "mode"];
        let from = [names[0], names[1], names[2], "u"];
        let spans = |first: &Instance, last: &Instance| {
            let [a, b, c, u] = from;
            [first.span(a), first.span(b), first.span(c), last.span(u)]
        };
        let mut closed = Self {
            from: spans(&plant, &controller),
            to: spans(&controller, &plant),
            controller,
            plant,
            start,
            time: start,
        };
        closed.begin();
        closed
    }

    /// Through initialization mode.
    pub fn begin(&mut self) {
        self.time = self.start;
        self.plant.initialize(self.start, |_| ());
        self.controller.enter(self.start);
        self.sense();
        self.controller_exits();
    }

    fn controller_exits(&self) {
        let exit = self.controller.functions().exit_initialization_mode;
        // SAFETY: the instance lives.
        let status = unsafe { exit(self.controller.c) };
        assert_eq!(status, Status::Ok, "{}", self.controller.last_message());
    }

    /// Present time.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The same loop, its clock set to `time`: after states were restored or steps made elsewhere.
    pub fn at(self, time: f64) -> Self {
        Self { time, ..self }
    }

    /// The plant's outputs to the controller.
    pub fn sense(&self) {
        let mut values = [0.0; 2];
        for at in [0, 1] {
            assert_eq!(self.plant.get_into(self.from[at], &mut values), Status::Ok);
            assert_eq!(self.controller.set(self.to[at], &values), Status::Ok);
        }
        let mode = self.plant.integer(self.from[2]);
        assert_eq!(self.controller.set_integer(self.to[2], mode), Status::Ok);
    }

    /// The controller's command to the plant.
    pub fn act(&self) {
        let mut values = [0.0; 2];
        assert_eq!(
            self.controller.get_into(self.from[3], &mut values),
            Status::Ok
        );
        assert_eq!(self.plant.set(self.to[3], &values), Status::Ok);
    }

    /// One communication step from the present time to `until`, with signals exchanged or held.
    pub fn step_to(&mut self, until: f64, coupling: Coupling, exchange: bool) {
        let length = until - self.time;
        if exchange {
            self.sense();
        }
        if exchange && coupling == Coupling::Jacobi {
            self.act();
        }
        let status = self.controller.step(self.time, length);
        assert_eq!(status, Status::Ok, "{}", self.controller.last_message());
        if exchange && coupling == Coupling::GaussSeidel {
            self.act();
        }
        let status = self.plant.step(self.time, length);
        assert_eq!(status, Status::Ok, "{}", self.plant.last_message());
        self.time = until;
    }

    /// Measurement and command, as bits.
    pub fn bits(&self) -> Vec<u64> {
        let (y, u) = (self.plant.get("y"), self.controller.get("u"));
        y.iter().chain(&u).map(|value| value.to_bits()).collect()
    }
}
