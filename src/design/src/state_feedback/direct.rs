//! The design by the interior-point method that uses the structure, and by Riccati equations where
//! even that would take minutes.

use super::frame::{Frame, Part};
use super::synthesis::{AGREEMENT, Levels, Optimum, REFRAMINGS, Road, SACRIFICES};
use super::{REJECTION, StateFeedback, riccati, structured};
use crate::Lyapunov;

/// Floating-point operations beyond which a `dwell` design is left to Riccati equations.
const LARGEST_WORK: f64 = 6e11;

/// Iterations of all solutions of one problem.
const ITERATIONS: f64 = 45.0;

/// Augmented states of all modes up to which the general solver is asked where this one leaves doubt.
const SMALL: usize = 24;

/// How many points of the central path are tried.
const CENTRED: usize = 5;

/// What a point of the central path gives up of its own level, for rounding.
const PATH_SACRIFICE: f64 = 1e-7;

/// A level this far, relatively, above the least one is well inside.
const INSIDE: f64 = 3e-6;

/// The least level of a group, and the way there.
pub(super) struct Found {
    pub optimum: Optimum,
    /// Levels that were passed, the largest first, with gains and Lyapunov matrices.
    centred: Vec<(f64, Vec<Part>)>,
    /// Whether other coordinates might show less.
    doubtful: bool,
}

impl Road<'_> {
    /// The design from the coordinates of regulators; `None` where any part of it falls short.
    pub(super) fn direct(&self) -> Option<StateFeedback> {
        let groups = self.groups();
        if self.spec.lyapunov == Lyapunov::Dwell
            && self.work() > LARGEST_WORK
            && let Some(design) = self.by_riccati()
        {
            return Some(design);
        }
        let least = groups.iter().map(|group| {
            let regulated = Frame::of_regulated(&self.models, group, self.spec.decay)?;
            self.settled_level(&regulated.with_signals(&self.models, group), group)
        });
        let mut least = least.collect::<Option<Vec<_>>>()?;
        let [smallest, small, others @ ..] = SACRIFICES;
        if let Some(design) = self.with_margin(&groups, &least, smallest) {
            return Some(design);
        }
        // Once more, in the coordinates that the first answer suggests.
        for (group, found) in groups.iter().zip(&mut least) {
            let again = self.direct_level(&found.optimum.frame, group);
            if let Some(again) = again.filter(|again| again.optimum.level < found.optimum.level) {
                *found = again;
            }
        }
        let on_path =
            |most: f64| (0..CENTRED).find_map(|back| self.on_path(&groups, &least, back, most));
        self.with_margin(&groups, &least, smallest)
            .or_else(|| on_path(small))
            .or_else(|| self.with_margin(&groups, &least, small))
            .or_else(|| on_path(f64::INFINITY))
            .or_else(|| {
                let mut larger = others.iter();
                larger.find_map(|more| self.with_margin(&groups, &least, *more))
            })
    }

    /// Gains of largest margin at the least levels but for a `sacrifice`, certified.
    fn with_margin(
        &self,
        groups: &[Vec<usize>],
        least: &[Found],
        sacrifice: f64,
    ) -> Option<StateFeedback> {
        let mut levels = Levels::new(self);
        let mut parts = Vec::new();
        for (group, found) in groups.iter().zip(least) {
            let level = levels.set(group, &found.optimum, sacrifice);
            parts.extend(self.direct_centre(group, &found.optimum.frame, level)?);
        }
        self.certified(parts, Some(levels)).ok()
    }

    /// Gains from the central path, `back` points before its end, certified; none where any group would
    /// give up more than `most` of its level.
    fn on_path(
        &self,
        groups: &[Vec<usize>],
        least: &[Found],
        back: usize,
        most: f64,
    ) -> Option<StateFeedback> {
        let mut levels = Levels::new(self);
        let mut parts = Vec::new();
        for (group, found) in groups.iter().zip(least) {
            let at = found.centred.len().checked_sub(1 + back)?;
            let (level, passed) = &found.centred[at];
            let sacrifice = (level / found.optimum.level - 1.0).max(0.0) + PATH_SACRIFICE;
            if sacrifice > most {
                return None;
            }
            levels.set(group, &found.optimum, sacrifice);
            parts.extend(passed.iter().cloned());
        }
        self.certified(parts, Some(levels)).ok()
    }

    /// Gains of largest margin at a level.
    pub(super) fn direct_centre(
        &self,
        group: &[usize],
        frame: &Frame,
        level: f64,
    ) -> Option<Vec<Part>> {
        let (view, level) = (frame.view(&self.models), frame.view_level(level));
        let found = structured::centred(&view, self.spec, group, level, &self.run).ok()?;
        Some(frame.restore(found))
    }

    /// The least level of a group, sought from these coordinates and again from those it suggests while
    /// the answer leaves doubt and improves.
    pub(super) fn settled_level(&self, frame: &Frame, group: &[usize]) -> Option<Found> {
        let mut found = self.direct_level(frame, group)?;
        for _ in 0..REFRAMINGS {
            if !found.doubtful {
                break;
            }
            let again = self.direct_level(&found.optimum.frame, group);
            let settled = found.optimum.level * (1.0 - AGREEMENT);
            match again {
                Some(again) if again.optimum.level < settled => found = again,
                _ => break,
            }
        }
        Some(found)
    }

    /// The least level of a group, sought in these coordinates.
    pub(super) fn direct_level(&self, frame: &Frame, group: &[usize]) -> Option<Found> {
        let models = &self.models;
        let floor = frame.view_level(REJECTION.powi(2));
        let view = frame.view(models);
        let path = structured::least_level(&view, self.spec, group, floor, &self.run).ok()?;
        let (level, bound) = (
            frame.restore_level(path.level),
            frame.restore_level(path.bound),
        );
        let optimal = level < (1.0 + AGREEMENT) * bound.max(REJECTION.powi(2));
        let centred: Vec<_> = path
            .centred
            .into_iter()
            .map(|(level, parts)| (frame.restore_level(level), frame.restore(parts)))
            .collect();
        // The last point that is still well inside gives better coordinates than the end itself.
        let inside = centred
            .iter()
            .rfind(|(passed, _)| *passed > level * (1.0 + INSIDE));
        let parts = inside.map_or_else(|| frame.restore(path.parts), |(_, parts)| parts.clone());
        Some(Found {
            optimum: Optimum {
                level,
                bound,
                frame: Frame::of_attenuated(models, &parts, level)?,
            },
            centred,
            doubtful: path.at_reach || !optimal,
        })
    }

    /// Gains of every mode by Riccati equations: certified, though not the optimum.
    fn by_riccati(&self) -> Option<StateFeedback> {
        let mut levels = Levels::new(self);
        let mut parts = Vec::new();
        for (mode, model) in self.models.iter().enumerate() {
            let group = [mode];
            let frame = Frame::of_regulated(&self.models, &group, self.spec.decay)?;
            let frame = frame.with_signals(&self.models, &group);
            let view = frame.view(std::slice::from_ref(model));
            let found = riccati::game(&view[0], mode, self.spec.decay)?;
            let least = Optimum {
                level: frame.restore_level(found.level),
                bound: frame.restore_level(found.bound),
                frame,
            };
            levels.set(&group, &least, 0.0);
            parts.extend(least.frame.restore(vec![found.part]));
        }
        self.certified(parts, Some(levels)).ok()
    }

    /// Whether the general solver would answer in seconds.
    pub(super) fn is_small(&self) -> bool {
        self.models[0].a.nrows() * self.models.len() <= SMALL
    }

    /// Floating-point operations of a `dwell` design by the interior-point method.
    fn work(&self) -> f64 {
        let (size, inputs) = self.models[0].b.shape();
        let (symmetric, full) = ((size * (size + 1) / 2) as f64, (size * inputs) as f64);
        let factors = (symmetric.powi(3) + full.powi(3)) / 3.0;
        let coupling = full * symmetric * (full + symmetric);
        ITERATIONS * self.models.len() as f64 * (factors + coupling)
    }
}
