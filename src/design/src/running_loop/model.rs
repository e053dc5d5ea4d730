//! The loop that runs, enclosed: plant, observer, integral part and command, as the controller
//! computes them, in the units of the state feedback's certificate.
//!
//! With `x~ = [x; u_prev; Z]` and the error `e` of the observer, a mode whose sensors in `h` are lost
//! (`Pi` has ones there, and `H Pi = 0`) obeys
//!
//! ```text
//! x~(k+1) = (A~ + B~ K~) x~ - X e + E~ w + (B~ K H + J ((I - Pi) + Pi C H)) v
//! e(k+1)  = (A - A H C) e + E w - A H v            X = (B~ K + J Pi C) (I - H C)
//! z(k)    = (H~ + D K~) x~ - D K (I - H C) e + D K H v
//! ```
//!
//! where `e = x - prior`, `J` is how a reading enters the integral part and `v` all that a kept sensor
//! adds to its output, `F w` included. An observer with an injection `K_o` is written with
//! `e = (I - H C) (x - prior) - injection` instead, which makes `X = B~ K`.

use crate::augmented::{AugmentedMode, augment, design_disturbance, readings};
use crate::certificate::{Enclosure, scaled_plant};
use crate::state_feedback::scaled_gain;
use crate::{StateFeedback, Units};
use ftc_control::Matrix;
use ftc_control::parameters::{Observer, ObserverKind};
use ftc_plant::SwitchedPlant;
use ftc_record::dense;
use nalgebra::DMatrix;

/// What all modes and all sets of lost sensors share.
pub(crate) struct Models<'a> {
    plant: &'a SwitchedPlant,
    control: &'a StateFeedback,
    augmented: Vec<AugmentedMode>,
    /// `J` (d x p).
    readings: Enclosure,
}

/// The loop of one mode.
pub(crate) struct Loop {
    /// State matrix (N x N).
    pub a: Enclosure,
    /// From the disturbance (N x s).
    pub disturbance: Enclosure,
    /// From what a sensor adds (N x p).
    pub sensors: Enclosure,
    /// To the performance signal.
    pub performance: Enclosure,
    /// From the disturbance to the performance signal at once.
    pub direct: Enclosure,
    /// To the true tracked outputs (r x N).
    pub tracked: Enclosure,
    /// From what is added to the command (N x m).
    pub input: Enclosure,
    /// To the command (m x N), and from the sensors to the command at once (m x p).
    pub command: (Enclosure, Enclosure),
}

/// The parts of one mode's equations.
struct Parts {
    a: Enclosure,
    c: Enclosure,
    e: Enclosure,
    f: Enclosure,
    /// `K` (m x n), the columns of `K~` that multiply the estimate.
    k: Enclosure,
    /// `K~` (m x d).
    gain: Enclosure,
    model: [Enclosure; 4],
}

impl<'a> Models<'a> {
    pub fn new(plant: &'a SwitchedPlant, control: &'a StateFeedback) -> Self {
        let (spec, units) = (&control.spec, &control.certificate.units);
        Self {
            plant,
            control,
            augmented: augment(plant, spec, units),
            readings: Enclosure::rounded(readings(plant, spec, units)),
        }
    }

    /// Whether a disturbance acts in any mode.
    pub fn disturbed(&self) -> bool {
        let given = (0..self.plant.modes.len()).map(|mode| design_disturbance(self.plant, mode));
        given
            .into_iter()
            .any(|(e, f)| e.amax() > 0.0 || f.amax() > 0.0)
    }

    pub fn units(&self) -> &Units {
        &self.control.certificate.units
    }

    /// The state feedback's loop of a mode, its state measured: floating point.
    pub fn measured(&self, mode: usize) -> [Enclosure; 4] {
        let parts = self.parts(mode);
        let [a, b, h, d] = &parts.model;
        let e = Enclosure::exact(self.augmented[mode].e.clone());
        let direct = Enclosure::zeros(h.shape().0, e.shape().1);
        [a + &(b * &parts.gain), e, h + &(d * &parts.gain), direct]
    }

    fn parts(&self, mode: usize) -> Parts {
        let (units, spec) = (self.units(), &self.control.spec);
        let own = &self.plant.modes[mode];
        let (x, y) = (&units.states, &units.outputs);
        let (e, f) = design_disturbance(self.plant, mode);
        let w = vec![units.disturbance; e.ncols()];
        let gain = scaled_gain(&self.control.modes[mode], units, spec);
        let model = &self.augmented[mode];
        let of = |matrix: &DMatrix<f64>| Enclosure::rounded(matrix.clone());
        Parts {
            a: scaled_plant(&own.a, x, x),
            c: scaled_plant(&own.c, y, x),
            e: scaled_plant(&e, x, &w),
            f: scaled_plant(&f, y, &w),
            k: Enclosure::rounded(gain.columns(0, x.len()).into_owned()),
            gain: Enclosure::rounded(gain),
            model: [of(&model.a), of(&model.b), of(&model.h), of(&model.d)],
        }
    }

    /// The loop of a mode with an observer in correction form without the sensors in `lost`.
    pub fn corrected(&self, mode: usize, gain: &Matrix, lost: &[usize]) -> Loop {
        let parts = self.parts(mode);
        let units = self.units();
        let h = scaled_plant(&dense(gain), &units.states, &units.outputs);
        let (n, p) = h.shape();
        let identity = |size| Enclosure::exact(DMatrix::identity(size, size));
        let chosen = |wanted: bool| {
            let one = |k: usize| f64::from(u8::from(lost.contains(&k) == wanted));
            Enclosure::exact(DMatrix::from_fn(
                p,
                p,
                |r, c| if r == c { one(r) } else { 0.0 },
            ))
        };
        let (silent, kept) = (chosen(true), chosen(false));
        let b = &parts.model[1];
        let remains = &identity(n) - &(&h * &parts.c);
        let command = &parts.k * &remains;
        let guessed = &(&self.readings * &silent) * &(&parts.c * &remains);
        let seen = &kept + &(&silent * &(&parts.c * &h));
        let moved = &parts.a * &h;
        let error = Error {
            a: &parts.a - &(&moved * &parts.c),
            disturbance: parts.e.clone(),
            sensors: moved.negative(),
            // Z moves by J y, with y = C x - C e where the sensor is lost, so the sign is J's own.
            into_control: (&(b * &command) + &guessed).negative(),
            sensors_into_control: &(b * &(&parts.k * &h)) + &(&self.readings * &seen),
            command,
            correction: &parts.k * &h,
        };
        self.assemble(&parts, error)
    }

    /// The healthy loop of a mode that lasts.
    pub fn healthy(&self, mode: usize, observer: &Observer) -> Loop {
        let own = &observer.decoupling[mode][mode];
        match observer.kind {
            ObserverKind::Kalman => self.corrected(mode, own, &[]),
            ObserverKind::Uio | ObserverKind::Luenberger => {
                self.injected(mode, mode, &observer.gains[mode], own)
            }
        }
    }

    /// Every loop that may be met under arbitrary switching, with the modes before and after; of what a
    /// sensor adds, only while the mode lasts.
    pub fn pairs(&self, observer: &Observer) -> Vec<(usize, usize, Loop)> {
        let modes = self.plant.modes.len();
        if observer.kind == ObserverKind::Kalman {
            return (0..modes)
                .map(|i| (i, i, self.healthy(i, observer)))
                .collect();
        }
        let of = |(i, j): (usize, usize)| {
            let gain = &observer.gains[i];
            (i, j, self.injected(i, j, gain, &observer.decoupling[i][j]))
        };
        crate::lyapunov::all_pairs(modes)
            .into_iter()
            .map(of)
            .collect()
    }

    /// The same with the disturbance; `None` where the form of the observer makes its way depend on
    /// more than two modes.
    pub fn switching(&self, observer: &Observer) -> Option<Vec<(usize, usize, Loop)>> {
        let silent = self.plant.modes.iter().all(|mode| mode.f.amax() == 0.0);
        (silent || observer.kind == ObserverKind::Kalman).then(|| self.pairs(observer))
    }

    /// The loop of a mode followed by `next`, with an injection; of what a sensor adds, only while the
    /// mode lasts.
    fn injected(&self, mode: usize, next: usize, injection: &Matrix, correction: &Matrix) -> Loop {
        let parts = self.parts(mode);
        let units = self.units();
        let (x, y) = (&units.states, &units.outputs);
        let h = scaled_plant(&dense(correction), x, y);
        let l = scaled_plant(&dense(injection), x, y);
        let c_next = scaled_plant(&self.plant.modes[next].c, y, x);
        let b = &parts.model[1];
        let projected = &parts.a - &(&h * &(&c_next * &parts.a));
        let a = &projected - &(&l * &parts.c);
        let error = Error {
            disturbance: &parts.e - &(&h * &(&c_next * &parts.e)),
            sensors: (&(&a * &h) + &l).negative(),
            a,
            into_control: (b * &parts.k).negative(),
            sensors_into_control: &(b * &(&parts.k * &h)) + &self.readings,
            command: parts.k.clone(),
            correction: &parts.k * &h,
        };
        self.assemble(&parts, error)
    }

    fn assemble(&self, parts: &Parts, error: Error) -> Loop {
        let [a, b, h, d] = &parts.model;
        let (size, n) = (a.shape().0, error.a.shape().0);
        let s = parts.e.shape().1;
        let tracked = &self.control.spec.tracked;
        let closed = a + &(b * &parts.gain);
        let zero = Enclosure::zeros(n, size);
        let sensors = Enclosure::blocks(&[vec![&error.sensors_into_control], vec![&error.sensors]]);
        let below = Enclosure::zeros(size - n, s);
        let disturbed =
            Enclosure::blocks(&[vec![&parts.e], vec![&below], vec![&error.disturbance]]);
        let command_error = error.command.negative();
        let performance = &(h + &(d * &parts.gain));
        let rows: Vec<Enclosure> = tracked.iter().map(|&row| parts.c.rows(row, 1)).collect();
        let seen = Enclosure::blocks(&rows.iter().map(|row| vec![row]).collect::<Vec<_>>());
        let zeros = Enclosure::zeros(tracked.len(), size);
        let idle = Enclosure::zeros(n, b.shape().1);
        Loop {
            input: Enclosure::blocks(&[vec![b], vec![&idle]]),
            a: Enclosure::blocks(&[vec![&closed, &error.into_control], vec![&zero, &error.a]]),
            disturbance: &disturbed + &(&sensors * &parts.f),
            performance: Enclosure::blocks(&[vec![performance, &(d * &command_error)]]),
            direct: &(d * &error.correction) * &parts.f,
            tracked: Enclosure::blocks(&[vec![&seen, &zeros]]),
            command: (
                Enclosure::blocks(&[vec![&parts.gain, &command_error]]),
                error.correction,
            ),
            sensors,
        }
    }
}

/// How the observer's error runs and acts.
struct Error {
    /// Its own dynamics (n x n).
    a: Enclosure,
    /// From the disturbance (n x s).
    disturbance: Enclosure,
    /// From the sensors (n x p).
    sensors: Enclosure,
    /// Into the augmented state (d x n).
    into_control: Enclosure,
    /// From the sensors into the augmented state (d x p).
    sensors_into_control: Enclosure,
    /// What of it the command takes away (m x n).
    command: Enclosure,
    /// From the sensors to the command (m x p).
    correction: Enclosure,
}
