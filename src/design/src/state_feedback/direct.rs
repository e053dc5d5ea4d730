//! The design by the interior-point method that uses the structure, and by Riccati equations where
//! even that would take minutes.

use super::synthesis::{AGREEMENT, Levels, Optimum, Problem, RELAXATIONS, TRANSFORMATIONS};
use super::transformation::{Part, Transformation};
use super::{REJECTION, StateFeedback, riccati, structured};
use crate::verdict::{DesignError, Uncertified};
use crate::{CertificateError, Lyapunov, parallel, work};

/// Augmented states of one mode, and of all together, up to which the general solver is asked where this
/// one leaves doubt: its work grows with the sixth power of the first.
const SMALL: [usize; 2] = [9, 24];

/// How many points of the central path are tried.
const CENTRED: usize = 5;

/// Relative increase of the level of a point of the central path, for rounding.
const PATH_RELAXATION: f64 = 1e-7;

/// Relative distance from the least level above which a point counts as strictly inside.
const INSIDE: f64 = 3e-6;

/// The least level of a group, and the way there.
pub(super) struct Found {
    pub optimum: Optimum,
    /// Levels that were passed, the largest first, with gains and Lyapunov matrices.
    centred: Vec<(f64, Vec<Part>)>,
    /// Whether other coordinates might show less.
    doubtful: bool,
}

/// Gains that a group may take.
struct Choice<'a> {
    /// What they give up of its level, relatively.
    relaxation: f64,
    /// Where they are there already; else those of largest margin.
    ready: Option<&'a [Part]>,
}

impl Found {
    /// From the least relaxation to the largest.
    fn choices(&self) -> Vec<Choice<'_>> {
        let path = self.centred.iter().rev().take(CENTRED);
        let path = path.map(|(level, parts)| Choice {
            relaxation: (level / self.optimum.level - 1.0).max(0.0) + PATH_RELAXATION,
            ready: Some(parts),
        });
        let margins = RELAXATIONS.map(|relaxation| Choice {
            relaxation,
            ready: None,
        });
        let mut choices: Vec<Choice> = path.chain(margins).collect();
        choices.sort_by(|a, b| a.relaxation.total_cmp(&b.relaxation));
        choices
    }
}

/// The mode (from 0) whose inequality could not be proved, where it is one mode's.
fn unproved_mode(error: &DesignError) -> Option<usize> {
    match error {
        DesignError::Uncertified(Uncertified {
            reason: CertificateError::Unproved(name),
            ..
        }) if name.mode == name.successor => Some(name.mode - 1),
        _ => None,
    }
}

impl Problem<'_> {
    /// The design from the coordinates of regulators; `None` where any part of it falls short.
    pub(super) fn direct(&self) -> Option<StateFeedback> {
        let groups = self.groups();
        if self.spec.lyapunov == Lyapunov::Dwell
            && self.is_left_to_riccati()
            && let Some(design) = self.by_riccati()
        {
            return Some(design);
        }
        let mut least = parallel::every(&groups, |group| {
            let regulated = Transformation::of_regulated(&self.models, group, self.spec.decay)?;
            self.settled_level(&regulated.with_signals(&self.models, group), group)
        })?;
        let smallest = RELAXATIONS[0];
        if let Some(design) = self.with_margin(&groups, &least, smallest) {
            return Some(design);
        }
        // Once more, in the coordinates that the first answer suggests.
        let pairs: Vec<(&Vec<usize>, &Found)> = groups.iter().zip(&least).collect();
        let again = parallel::each(&pairs, |(group, found)| {
            let again = self.direct_level(&found.optimum.transformation, group);
            again.filter(|again| again.optimum.level < found.optimum.level)
        });
        for (found, again) in least.iter_mut().zip(again) {
            if let Some(again) = again {
                *found = again;
            }
        }
        self.with_margin(&groups, &least, smallest)
            .or_else(|| self.with_little(&groups, &least))
    }

    /// Gains of largest margin at the least levels, each increased by the factor `1 + relaxation`, certified.
    fn with_margin(
        &self,
        groups: &[Vec<usize>],
        least: &[Found],
        relaxation: f64,
    ) -> Option<StateFeedback> {
        let mut levels = Levels::new(self);
        let problems: Vec<(&Vec<usize>, &Optimum, f64)> = groups
            .iter()
            .zip(least)
            .map(|(group, found)| {
                let level = levels.set(group, &found.optimum, relaxation);
                (group, &found.optimum, level)
            })
            .collect();
        let parts = parallel::every(&problems, |(group, optimum, level)| {
            self.direct_centre(group, &optimum.transformation, *level)
        })?;
        self.certified(parts.concat(), Some(levels)).ok()
    }

    /// Gains that give up as little of its level as each group can: from the central path or of largest
    /// margin, whichever comes next, until all are proved together.
    fn with_little(&self, groups: &[Vec<usize>], least: &[Found]) -> Option<StateFeedback> {
        let choices: Vec<Vec<Choice>> = least.iter().map(Found::choices).collect();
        let mut taken = vec![0; groups.len()];
        let mut parts: Vec<Option<Vec<Part>>> = vec![None; groups.len()];
        loop {
            let mut levels = Levels::new(self);
            for (at, (group, found)) in groups.iter().zip(least).enumerate() {
                while parts[at].is_none() {
                    let choice = choices[at].get(taken[at])?;
                    parts[at] = match choice.ready {
                        Some(ready) => Some(ready.to_vec()),
                        None => {
                            let level = found.optimum.level * (1.0 + choice.relaxation);
                            self.direct_centre(group, &found.optimum.transformation, level)
                        }
                    };
                    taken[at] += 1;
                }
                let relaxation = choices[at][taken[at] - 1].relaxation;
                levels.set(group, &found.optimum, relaxation);
            }
            let together = parts.iter().flatten().flatten().cloned().collect();
            let failed = match self.certified(together, Some(levels)) {
                Ok(design) => return Some(design),
                Err(error) => unproved_mode(&error),
            };
            for (group, parts) in groups.iter().zip(&mut parts) {
                if failed.is_none_or(|mode| group.contains(&mode)) {
                    *parts = None;
                }
            }
        }
    }

    /// Gains of largest margin at a level.
    pub(super) fn direct_centre(
        &self,
        group: &[usize],
        transformation: &Transformation,
        level: f64,
    ) -> Option<Vec<Part>> {
        let (view, level) = (
            transformation.view(&self.models),
            transformation.view_level(level),
        );
        let found = structured::centred(&view, self.spec, group, level, &self.run).ok()?;
        Some(transformation.restore(found))
    }

    /// The least level of a group, sought from these coordinates and again from those it suggests while
    /// the answer leaves doubt and improves.
    pub(super) fn settled_level(
        &self,
        transformation: &Transformation,
        group: &[usize],
    ) -> Option<Found> {
        let mut found = self.direct_level(transformation, group)?;
        for _ in 0..TRANSFORMATIONS {
            if !found.doubtful {
                break;
            }
            let again = self.direct_level(&found.optimum.transformation, group);
            let settled = found.optimum.level * (1.0 - AGREEMENT);
            match again {
                Some(again) if again.optimum.level < settled => found = again,
                _ => break,
            }
        }
        Some(found)
    }

    /// The least level of a group, sought in these coordinates.
    pub(super) fn direct_level(
        &self,
        transformation: &Transformation,
        group: &[usize],
    ) -> Option<Found> {
        let models = &self.models;
        let floor = transformation.view_level(REJECTION.powi(2));
        let view = transformation.view(models);
        let path = structured::least_level(&view, self.spec, group, floor, &self.run).ok()?;
        let (level, mut bound) = (
            transformation.restore_level(path.level),
            transformation.restore_level(path.bound),
        );
        let settles = |bound: f64| level < (1.0 + AGREEMENT) * bound.max(REJECTION.powi(2));
        if !settles(bound) {
            // The dual solution tells too little; each mode alone may tell more.
            let modes = group.iter().filter_map(|&mode| riccati::bound(&view[mode]));
            let alone = modes.fold(0.0, f64::max);
            bound = bound.max(transformation.restore_level(alone)).min(level);
        }
        let optimal = settles(bound);
        let centred: Vec<_> = path
            .centred
            .into_iter()
            .map(|(level, parts)| {
                (
                    transformation.restore_level(level),
                    transformation.restore(parts),
                )
            })
            .collect();
        // The last point that is still well inside gives better coordinates than the end itself.
        let inside = centred
            .iter()
            .rfind(|(passed, _)| *passed > level * (1.0 + INSIDE));
        let parts = inside.map_or_else(
            || transformation.restore(path.parts),
            |(_, parts)| parts.clone(),
        );
        Some(Found {
            optimum: Optimum {
                level,
                bound,
                transformation: Transformation::of_attenuated(models, &parts, level)?,
            },
            centred,
            doubtful: path.at_reach || !optimal,
        })
    }

    /// Gains of every mode by Riccati equations: certified, though not the optimum.
    fn by_riccati(&self) -> Option<StateFeedback> {
        let modes: Vec<usize> = (0..self.models.len()).collect();
        let found = parallel::every(&modes, |&mode| {
            let (model, group) = (&self.models[mode], [mode]);
            let transformation =
                Transformation::of_regulated(&self.models, &group, self.spec.decay)?;
            let transformation = transformation.with_signals(&self.models, &group);
            let view = transformation.view(std::slice::from_ref(model));
            let found = riccati::game(&view[0], mode, self.spec.decay)?;
            let least = Optimum {
                level: transformation.restore_level(found.level),
                bound: transformation.restore_level(found.bound),
                transformation,
            };
            let part = least.transformation.restore(vec![found.part]);
            Some((least, part))
        })?;
        let mut levels = Levels::new(self);
        let mut parts = Vec::new();
        for (mode, (least, part)) in found.into_iter().enumerate() {
            levels.set(&[mode], &least, 0.0);
            parts.extend(part);
        }
        self.certified(parts, Some(levels)).ok()
    }

    /// Whether the general solver would answer in seconds.
    pub(super) fn is_small(&self) -> bool {
        let size = self.models[0].a.nrows();
        let [one, all] = SMALL;
        size <= one && size * self.models.len() <= all
    }

    fn is_left_to_riccati(&self) -> bool {
        let (size, inputs) = self.models[0].b.shape();
        work::is_left_to_riccati(size, inputs, self.models.len())
    }
}
