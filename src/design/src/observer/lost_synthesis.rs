//! Gains for lost sensors, and the Lyapunov matrices that prove them.
//!
//! One function `e' P e` for every mode and every set of lost sensors exists, with the gains free, iff
//! `N' (beta^2 P - A_i' P A_i) N > 0` for every mode and every maximal served set, where the columns of
//! `N` span what the kept sensors do not see. Only `P` is unknown. The gains are then Kalman
//! filters, each moved towards the projection in `P` by as little as lets the function shrink.

use super::ObserverDesign;
use super::existence::PerUnit;
use super::kalman::Filtered;
use super::lost::{self, LostCertificate, changes, due_dwell, sets};
use crate::augmented::scaled;
use crate::blocks::{BlockKind, BlockName};
use crate::certificate::{Enclosure, LyapunovMatrix, largest_ratio};
use crate::lmi::{Inequality, Problem};
use crate::parallel;
use crate::riccati;
use ftc_control::parameters::{LostSet, ObserverKind};
use ftc_plant::{SwitchedPlant, spectral_radius};
use ftc_record::{dense, plain};
use nalgebra::DMatrix;

/// A margin below this is no margin: the solver's own accuracy.
const SMALLEST_MARGIN: f64 = 1e-8;

/// Decay rates that are tried for one function, as shares of what the asked rate leaves to 1.
const SHARES: [f64; 5] = [1.0, 0.5, 0.2, 0.05, 0.01];

/// Halvings in the search for the least move towards the projection.
const HALVINGS: usize = 40;

/// What must shrink.
pub(super) enum Demand<'a> {
    /// A matrix whose gain is fixed.
    Fixed(DMatrix<f64>),
    /// `A` of a filter whose gain is free, without these sensors.
    Free(&'a Filtered, &'a [usize]),
}

/// One `P` for which `e' P e` shrinks by `decay^2` under every demand; `None` where there is none.
pub(super) fn common_function(demands: &[Demand], decay: f64) -> Option<DMatrix<f64>> {
    let n = match demands.first()? {
        Demand::Fixed(error) => error.nrows(),
        Demand::Free(filter, _) => filter.a.nrows(),
    };
    let mut problem = Problem::new();
    let unknown = problem.symmetric(n);
    let name = || BlockName::new(BlockKind::ObserverDecay, 0, 0);
    let mut demand = |matrix| problem.require(Inequality::new(name(), vec![vec![Some(matrix)]]));
    demand(unknown.expression());
    for wanted in demands {
        let (a, basis) = match wanted {
            Demand::Fixed(error) => (error, DMatrix::identity(n, n)),
            Demand::Free(filter, lost) => (&filter.a, unmeasured(&filter.kept(lost).0)),
        };
        if basis.ncols() == 0 {
            continue;
        }
        let (before, after) = (decay * &basis, a * &basis);
        demand(
            &before.transpose() * unknown.expression() * &before
                - &after.transpose() * unknown.expression() * &after,
        );
    }
    problem.require_trace(&[unknown.expression()], n as f64);
    let margin = problem.margin().ok()?;
    (margin.margin > SMALLEST_MARGIN).then(|| riccati::symmetric(unknown.value(&margin.scalars)))
}

/// An orthonormal basis of what the rows of `c` do not see.
fn unmeasured(c: &DMatrix<f64>) -> DMatrix<f64> {
    let n = c.ncols();
    if c.nrows() == 0 || c.amax() == 0.0 {
        return DMatrix::identity(n, n);
    }
    // Eigenvectors of C'C: an SVD of a wide matrix would leave the null space out.
    let rows = c.row_iter().map(|row| row.norm()).fold(0.0, f64::max);
    let eigen = (c.tr_mul(c) / (rows * rows)).symmetric_eigen();
    let hidden: Vec<usize> = (0..n).filter(|&k| eigen.eigenvalues[k] < 1e-14).collect();
    eigen.eigenvectors.select_columns(&hidden)
}

/// The norm of a matrix in that of `P = root root'`.
fn size_in(root: &DMatrix<f64>, inverse: &DMatrix<f64>, matrix: &DMatrix<f64>) -> f64 {
    (root.transpose() * matrix * inverse.transpose())
        .singular_values()
        .max()
}

/// The gain nearest the Kalman filter's on the way to the projection in `P` whose error shrinks by
/// `decay` in the norm of `P`; `None` where not even the projection's does.
pub(super) fn blended(
    filter: &Filtered,
    lost: &[usize],
    kalman: &DMatrix<f64>,
    function: &DMatrix<f64>,
    decay: f64,
) -> Option<DMatrix<f64>> {
    // A margin for rounding errors in the proof.
    let decay = decay * (1.0 - 1e-7);
    let root = function.clone().cholesky()?.unpack();
    let inverse = root.clone().try_inverse()?;
    let projection = filter.projection(lost, &(inverse.transpose() * &inverse));
    let mixed = |share: f64| (1.0 - share) * kalman + share * &projection;
    let shrinks = |share: f64| size_in(&root, &inverse, &filter.error(&mixed(share))) < decay;
    if shrinks(0.0) {
        return Some(kalman.clone());
    }
    if !shrinks(1.0) {
        return None;
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if shrinks(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(mixed(high))
}

/// The filters of all modes and their Kalman gains for every set that has them.
struct Candidates<'a> {
    filters: &'a [Filtered],
    /// Sets and the gain of each mode (per-unit).
    served: Vec<(Vec<usize>, Vec<DMatrix<f64>>)>,
    /// The healthy filter's error in each mode, where it belongs to the family.
    healthy: Option<Vec<DMatrix<f64>>>,
}

/// Adds gains and proofs for lost sensors to a finished observer; `ratio` is that of the noises. What
/// cannot be proved is not served.
pub(super) fn add(
    plant: &SwitchedPlant,
    mut design: ObserverDesign,
    filters: &[Filtered],
    ratio: f64,
) -> ObserverDesign {
    let sensors = plant.dimensions().outputs;
    let kalman = |set: &Vec<usize>| {
        let gains = filters.iter().map(|filter| {
            let gain = filter.gain(set, ratio)?;
            (spectral_radius(&filter.error(&gain)) < 1.0 - 1e-9).then_some(gain)
        });
        gains
            .collect::<Option<Vec<_>>>()
            .map(|gains| (set.clone(), gains))
    };
    let served = parallel::each(&sets(sensors), kalman);
    let healthy = (design.observer.kind == ObserverKind::Kalman).then(|| {
        let units = per_unit(&design);
        let numbered = filters.iter().enumerate();
        numbered
            .map(|(i, filter)| filter.error(&units.h(&dense(&design.observer.decoupling[i][i]))))
            .collect()
    });
    let candidates = Candidates {
        filters,
        served: served.into_iter().flatten().collect(),
        healthy,
    };
    if candidates.served.is_empty() {
        return design;
    }
    let asked = design.spec.decay;
    let attempts: [&dyn Fn() -> Option<Found>; 3] = [
        &|| candidates.for_all(asked),
        &|| candidates.for_each_set(asked),
        &|| candidates.for_each_mode(),
    ];
    for attempt in attempts {
        if let Some(proved) = attempt().and_then(|found| found.proved(plant, &design)) {
            design = proved;
            break;
        }
    }
    design
}

fn per_unit(design: &ObserverDesign) -> PerUnit<'_> {
    PerUnit {
        states: &design.certificate.states,
        outputs: &design.certificate.outputs,
    }
}

/// Gains (per-unit) and matrices that have not been proved yet.
struct Found {
    sets: Vec<(Vec<usize>, Vec<DMatrix<f64>>)>,
    lists: Vec<Vec<DMatrix<f64>>>,
    decay: f64,
}

impl Candidates<'_> {
    /// The largest sets: what holds for them can be reached for every smaller one.
    fn maximal(&self) -> impl Iterator<Item = &[usize]> {
        let larger = |set: &[usize], other: &[usize]| {
            other.len() > set.len() && set.iter().all(|sensor| other.contains(sensor))
        };
        let sets = self.served.iter().map(|(set, _)| set.as_slice());
        sets.filter(move |set| !self.served.iter().any(|(other, _)| larger(set, other)))
    }

    /// One function for all modes and sets.
    fn for_all(&self, asked: f64) -> Option<Found> {
        SHARES.iter().find_map(|share| {
            let decay = 1.0 - share * (1.0 - asked.min(0.9999));
            let healthy = self.healthy.iter().flatten().cloned().map(Demand::Fixed);
            let lost = self.maximal().flat_map(|set| {
                let of = |filter| Demand::Free(filter, set);
                self.filters.iter().map(of)
            });
            let demands: Vec<Demand> = healthy.chain(lost).collect();
            let function = common_function(&demands, decay)?;
            let blend = |(set, gains): &(Vec<usize>, Vec<DMatrix<f64>>)| {
                let modes = self.filters.iter().zip(gains);
                let blended =
                    modes.map(|(filter, gain)| blended(filter, set, gain, &function, decay));
                Some((set.clone(), blended.collect::<Option<Vec<_>>>()?))
            };
            Some(Found {
                sets: self.served.iter().map(blend).collect::<Option<_>>()?,
                lists: vec![vec![function]],
                decay,
            })
        })
    }

    /// One function for all modes of each set.
    fn for_each_set(&self, asked: f64) -> Option<Found> {
        SHARES.iter().find_map(|share| {
            let decay = 1.0 - share * (1.0 - asked.min(0.9999));
            let mut found = Found {
                sets: Vec::new(),
                lists: Vec::new(),
                decay,
            };
            if let Some(healthy) = &self.healthy {
                let demands: Vec<Demand> = healthy.iter().cloned().map(Demand::Fixed).collect();
                found.lists.push(vec![common_function(&demands, decay)?]);
            }
            let sets = parallel::every(&self.served, |(set, gains)| {
                let of = |filter| Demand::Free(filter, set);
                let demands: Vec<Demand> = self.filters.iter().map(of).collect();
                let function = common_function(&demands, decay)?;
                let modes = self.filters.iter().zip(gains);
                let blended =
                    modes.map(|(filter, gain)| blended(filter, set, gain, &function, decay));
                Some((set.clone(), blended.collect::<Option<Vec<_>>>()?, function))
            })?;
            for (set, gains, function) in sets {
                found.sets.push((set, gains));
                found.lists.push(vec![function]);
            }
            Some(found)
        })
    }

    /// One function for each mode of each set, from the Lyapunov equation: always there.
    fn for_each_mode(&self) -> Option<Found> {
        let of = |(_, gains): &(Vec<usize>, Vec<DMatrix<f64>>)| -> Vec<DMatrix<f64>> {
            let modes = self.filters.iter().zip(gains);
            modes.map(|(filter, gain)| filter.error(gain)).collect()
        };
        let errors: Vec<Vec<DMatrix<f64>>> = self
            .healthy
            .iter()
            .cloned()
            .chain(self.served.iter().map(of))
            .collect();
        let slowest = errors.iter().flatten().map(spectral_radius);
        let slowest = slowest.fold(0.0, f64::max);
        let n = self.filters[0].a.nrows();
        let decay = 1.0 - 0.3 * (1.0 - slowest);
        let function = |error: &DMatrix<f64>| {
            riccati::lyapunov(&(error / (decay * (1.0 - 1e-9))), &DMatrix::identity(n, n))
        };
        let list = |errors: &Vec<DMatrix<f64>>| errors.iter().map(function).collect();
        Some(Found {
            sets: self.served.clone(),
            lists: errors.iter().map(list).collect::<Option<_>>()?,
            decay,
        })
    }
}

impl Found {
    /// The observer with these gains in physical units, once everything about them is proved.
    fn proved(self, plant: &SwitchedPlant, design: &ObserverDesign) -> Option<ObserverDesign> {
        let units = &design.certificate;
        let outward: Vec<f64> = units.states.iter().map(|unit| 1.0 / unit).collect();
        let inward: Vec<f64> = units.outputs.iter().map(|unit| 1.0 / unit).collect();
        let physical = |gain: &DMatrix<f64>| plain(&scaled(gain, &outward, &inward));
        let set = |(sensors, gains): (Vec<usize>, Vec<DMatrix<f64>>)| {
            LostSet::new(sensors, gains.iter().map(physical).collect())
        };
        let mut found = design.clone();
        found.observer.lost = self.sets.into_iter().map(set).collect();
        let list = |list: Vec<DMatrix<f64>>| list.into_iter().map(LyapunovMatrix).collect();
        let mut certificate = LostCertificate {
            decay: self.decay,
            lyapunov: self.lists.into_iter().map(list).collect(),
            mu: 1.0,
        };
        let mu = growth(plant, &found, &certificate)?;
        let single = certificate.lyapunov.iter().flatten().count() == 1
            && found.observer.kind == ObserverKind::Kalman;
        for allowance in [1e-9, 1e-6, 1e-3] {
            certificate.mu = if single {
                1.0
            } else {
                mu.max(1.0) * (1.0 + allowance)
            };
            found.observer.minimum_dwell = due_dwell(&found, &certificate);
            found.lost = Some(certificate.clone());
            if lost::verify(plant, &found).is_ok() {
                return Some(found);
            }
        }
        None
    }
}

/// The largest growth of the error's function at a change.
fn growth(
    plant: &SwitchedPlant,
    design: &ObserverDesign,
    certificate: &LostCertificate,
) -> Option<f64> {
    let n = plant.modes[0].a.nrows();
    let identity = Enclosure::exact(DMatrix::identity(n, n));
    let exact = |matrix: &LyapunovMatrix| Enclosure::exact(matrix.0.clone());
    let lists = certificate.lyapunov.iter();
    let matrices: Vec<Vec<Enclosure>> =
        lists.map(|list| list.iter().map(exact).collect()).collect();
    let mut largest = 1.0_f64;
    for (map, before, after) in changes(plant, design, &matrices, &identity) {
        let map = map.midpoint();
        let moved = riccati::symmetric(map.transpose() * after.midpoint() * map);
        largest = largest.max(largest_ratio(&moved, before.midpoint())?);
    }
    Some(largest)
}
