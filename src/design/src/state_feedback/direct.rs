//! The design by the interior-point method that uses the structure, and by Riccati equations where
//! even that would take minutes.

use super::frame::{Frame, Part};
use super::synthesis::{Levels, Optimum, Road, SACRIFICES};
use super::{REJECTION, StateFeedback, riccati, structured};
use crate::Lyapunov;

/// Floating-point operations beyond which a `dwell` design is left to Riccati equations.
const LARGEST_WORK: f64 = 6e11;

/// Iterations of all solutions of one problem.
const ITERATIONS: f64 = 45.0;

impl Road<'_> {
    /// The design from the coordinates of regulators; `None` where any part of it falls short.
    pub(super) fn direct(&self) -> Option<StateFeedback> {
        let groups = self.groups();
        if self.spec.lyapunov == Lyapunov::Dwell && self.work() > LARGEST_WORK {
            if let Some(design) = self.by_riccati() {
                return Some(design);
            }
        }
        let least = groups.iter().map(|group| {
            let regulated = Frame::of_regulated(&self.models, group, self.spec.decay)?;
            self.direct_level(&regulated.with_signals(&self.models, group), group)
        });
        let least = least.collect::<Option<Vec<_>>>()?;
        SACRIFICES.iter().find_map(|&sacrifice| {
            let mut levels = Levels::new(self);
            let mut parts = Vec::new();
            for (group, least) in groups.iter().zip(&least) {
                let level = levels.set(group, least, sacrifice);
                parts.extend(self.direct_centre(group, &least.frame, level)?);
            }
            self.certified(parts, Some(levels)).ok()
        })
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

    /// The least level of a group, sought in these coordinates.
    pub(super) fn direct_level(&self, frame: &Frame, group: &[usize]) -> Option<Optimum> {
        let models = &self.models;
        let floor = frame.view_level(REJECTION.powi(2));
        let view = frame.view(models);
        let found = structured::least_level(&view, self.spec, group, floor, &self.run).ok()?;
        let level = frame.restore_level(found.level);
        Some(Optimum {
            level,
            bound: frame.restore_level(found.bound),
            frame: Frame::of_attenuated(models, &frame.restore(found.parts), level)?,
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

    /// Floating-point operations of a `dwell` design by the interior-point method.
    fn work(&self) -> f64 {
        let (size, inputs) = self.models[0].b.shape();
        let (symmetric, full) = ((size * (size + 1) / 2) as f64, (size * inputs) as f64);
        let factors = (symmetric.powi(3) + full.powi(3)) / 3.0;
        let coupling = full * symmetric * (full + symmetric);
        ITERATIONS * self.models.len() as f64 * (factors + coupling)
    }
}
