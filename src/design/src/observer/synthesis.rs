//! From a plant to a certified observer.

use super::detectable::check_detectable;
use super::existence::{PerUnit, decoupling};
use super::kalman::Filtered;
use super::lost_synthesis::{self, Demand, blended, common_function};
use super::proof::observer_growth;
use super::{ObserverCertificate, ObserverDesign};
use crate::RequestError;
use crate::augmented::scaled;
use crate::blocks::{BlockKind, BlockName};
use crate::certificate::LyapunovMatrix;
use crate::lmi::{Affine, Inequality, Problem, Variable};
use crate::units::{other_scaling, power_of_two};
use crate::verdict::{DesignError, SolverFailure, infeasible};
use crate::{Advice, DwellTime, Lyapunov, ObserverChoice, ObserverSpec};
use ftc_control::Matrix;
use ftc_control::parameters::{Observer, ObserverKind};
use ftc_plant::scaling::Scaling;
use ftc_plant::{Dimensions, SwitchedPlant, spectral_radius};
use ftc_record::plain;
use nalgebra::DMatrix;

/// A margin below this is no margin: the solver's own accuracy.
const SMALLEST_MARGIN: f64 = 1e-9;

/// Designs the observer that is asked for and proves it.
///
/// # Errors
/// An ill-formed request, a condition of existence that fails (which, and for which mode), a
/// conflict between inequalities (named, with advice that was tried), a failure of the solver, or
/// a result that cannot be certified.
pub fn synthesise(
    plant: &SwitchedPlant,
    spec: &ObserverSpec,
    scaling: &Scaling,
) -> Result<ObserverDesign, DesignError> {
    Dimensions::check(plant)?;
    spec.check()?;
    let first = chosen(plant, spec, scaling);
    first.or_else(|error| chosen(plant, spec, &other_scaling(plant, scaling)).or(Err(error)))
}

/// The observer of the kind that is asked for, in one scaling.
fn chosen(
    plant: &SwitchedPlant,
    spec: &ObserverSpec,
    scaling: &Scaling,
) -> Result<ObserverDesign, DesignError> {
    match spec.kind {
        ObserverChoice::Uio => unknown_input(plant, spec, scaling),
        ObserverChoice::Luenberger => luenberger(plant, spec, scaling, None),
        ObserverChoice::Kalman => match kalman(plant, spec, &units(scaling), USUAL_RATIO) {
            Some(observer) => Ok(observer),
            None => luenberger(plant, spec, scaling, None),
        },
        ObserverChoice::Auto => match reason_against(plant) {
            Some(reason) => luenberger(plant, spec, scaling, Some(reason)),
            None => unknown_input(plant, spec, scaling)
                .or_else(|error| luenberger(plant, spec, scaling, Some(error.to_string()))),
        },
    }
}

/// Why decoupling would be pointless or harmful, from the channels of the disturbance alone.
fn reason_against(plant: &SwitchedPlant) -> Option<String> {
    let on_state = plant.modes.iter().any(|mode| mode.e.amax() > 0.0);
    let on_output = plant.modes.iter().any(|mode| mode.f.amax() > 0.0);
    match (on_state, on_output) {
        (false, _) => Some("no disturbance acts on the state, so there is nothing to decouple".into()),
        (true, true) => Some(
            "the disturbance also acts on the outputs (F), and decoupling would pass it on to the estimate"
                .into(),
        ),
        (true, false) => None,
    }
}

fn unknown_input(
    plant: &SwitchedPlant,
    spec: &ObserverSpec,
    scaling: &Scaling,
) -> Result<ObserverDesign, DesignError> {
    let units = units(scaling);
    check_shown(plant, spec, &units.per_unit())?;
    let h = decoupling(plant, &units.per_unit())?;
    if h.iter().flatten().all(|h| h.amax() == 0.0) {
        return Err(RequestError::NoDisturbance.into());
    }
    let mixed = plant.modes.iter().any(|mode| mode.f.amax() > 0.0);
    let note = mixed.then(|| {
        "the disturbance also acts on the outputs (F): that part reaches the estimate".to_owned()
    });
    design(plant, spec, &units, ObserverKind::Uio, note, h)
}

fn luenberger(
    plant: &SwitchedPlant,
    spec: &ObserverSpec,
    scaling: &Scaling,
    note: Option<String>,
) -> Result<ObserverDesign, DesignError> {
    let dims = plant.dimensions();
    let zero = DMatrix::zeros(dims.states, dims.outputs);
    let modes = plant.modes.len();
    let h = vec![vec![zero; modes]; modes];
    design(
        plant,
        spec,
        &units(scaling),
        ObserverKind::Luenberger,
        note,
        h,
    )
}

/// Powers of two near the nominal values.
struct OwnedUnits {
    states: Vec<f64>,
    outputs: Vec<f64>,
}

impl OwnedUnits {
    fn per_unit(&self) -> PerUnit<'_> {
        PerUnit {
            states: &self.states,
            outputs: &self.outputs,
        }
    }
}

impl OwnedUnits {
    /// A gain (n x p) of these units in physical units.
    fn physical(&self, gain: &DMatrix<f64>) -> DMatrix<f64> {
        let outward: Vec<f64> = self.states.iter().map(|unit| 1.0 / unit).collect();
        let inward: Vec<f64> = self.outputs.iter().map(|unit| 1.0 / unit).collect();
        scaled(gain, &outward, &inward)
    }
}

fn units(scaling: &Scaling) -> OwnedUnits {
    let round = |values: &[f64]| values.iter().map(|&v| power_of_two(v)).collect();
    OwnedUnits {
        states: round(&scaling.states),
        outputs: round(&scaling.outputs),
    }
}

/// The error dynamics in per-unit: `T_ij A_i` for every pair, `C_i` for every mode.
struct ErrorModel {
    projected: Vec<Vec<DMatrix<f64>>>,
    outputs: Vec<DMatrix<f64>>,
    /// Whether any `H` is not zero.
    decoupled: bool,
}

impl ErrorModel {
    fn new(plant: &SwitchedPlant, units: &PerUnit, h: &[Vec<DMatrix<f64>>]) -> Self {
        let outputs: Vec<DMatrix<f64>> = plant.modes.iter().map(|mode| units.c(mode)).collect();
        let projected = plant.modes.iter().zip(h).map(|(mode, row)| {
            let a = units.a(mode);
            let pairs = row.iter().zip(&outputs);
            pairs.map(|(h, c)| &a - units.h(h) * (c * &a)).collect()
        });
        Self {
            projected: projected.collect(),
            decoupled: h.iter().flatten().any(|h| h.amax() > 0.0),
            outputs,
        }
    }

    /// `(C_i, T_ij A_i)` must let the error decay as asked.
    fn check_detectable(&self, spec: &ObserverSpec) -> Result<(), DesignError> {
        for (i, j) in spec.lyapunov.observer_pairs(self.outputs.len()) {
            let found = check_detectable(&self.projected[i][j], &self.outputs[i], spec.decay);
            found.map_err(|magnitude| RequestError::Undetectable {
                mode: i + 1,
                decay: spec.decay,
                magnitude,
                decoupled: self.decoupled,
            })?;
        }
        Ok(())
    }
}

/// What the outputs do not show without decoupling, they do not show with it.
fn check_shown(
    plant: &SwitchedPlant,
    spec: &ObserverSpec,
    units: &PerUnit,
) -> Result<(), RequestError> {
    for (index, mode) in plant.modes.iter().enumerate() {
        let found = check_detectable(&units.a(mode), &units.c(mode), spec.decay);
        found.map_err(|magnitude| RequestError::Undetectable {
            mode: index + 1,
            decay: spec.decay,
            magnitude,
            decoupled: false,
        })?;
    }
    Ok(())
}

/// The unknowns `P`, `N`, `W` of one mode.
struct ModeUnknowns {
    lyapunov: Variable,
    slack: Variable,
    injection: Variable,
}

/// `[beta^2 P_i (N_i T_ij A_i - W_i C_i)'; . N_i + N_i' - P_j]` for the pairs of a group of modes,
/// normalised by the traces of `N`.
fn error_decay(
    model: &ErrorModel,
    spec: &ObserverSpec,
    group: &[usize],
) -> (Problem, Vec<ModeUnknowns>) {
    let (p, n) = model.outputs[0].shape();
    let mut problem = Problem::new();
    let mut unknowns: Vec<ModeUnknowns> = Vec::new();
    for _ in group {
        let own = match (spec.lyapunov, unknowns.first()) {
            (Lyapunov::Common, Some(first)) => first.lyapunov,
            _ => problem.symmetric(n),
        };
        let slack = match spec.lyapunov {
            Lyapunov::Switched => problem.full(n, n),
            Lyapunov::Common | Lyapunov::Dwell => own,
        };
        unknowns.push(ModeUnknowns {
            lyapunov: own,
            slack,
            injection: problem.full(n, p),
        });
    }
    for (a, b) in spec.lyapunov.observer_pairs(group.len()) {
        let (i, j) = (group[a], group[b]);
        let unknown = &unknowns[a];
        let slack = unknown.slack.expression();
        let next = unknowns[b].lyapunov.expression();
        let diagonal = match spec.lyapunov {
            Lyapunov::Switched => slack.clone() + slack.transpose() - next,
            Lyapunov::Common | Lyapunov::Dwell => next,
        };
        let error =
            slack * &model.projected[i][j] - unknown.injection.expression() * &model.outputs[i];
        let own = spec.decay.powi(2) * unknown.lyapunov.expression();
        problem.require(Inequality::new(
            BlockName::new(BlockKind::ObserverDecay, i, j),
            vec![vec![Some(own)], vec![Some(error), Some(diagonal)]],
        ));
    }
    let distinct = spec.lyapunov.matrices(group.len());
    let slacks: Vec<Affine> = unknowns[..distinct]
        .iter()
        .map(|unknown| unknown.slack.expression())
        .collect();
    problem.require_trace(&slacks, (distinct * n) as f64);
    (problem, unknowns)
}

/// The observer with given `H`, or what would help.
fn design(
    plant: &SwitchedPlant,
    spec: &ObserverSpec,
    units: &OwnedUnits,
    kind: ObserverKind,
    note: Option<String>,
    h: Vec<Vec<DMatrix<f64>>>,
) -> Result<ObserverDesign, DesignError> {
    let attempt = |spec: &ObserverSpec| attempt(plant, spec, units, kind, note.clone(), &h);
    attempt(spec).map_err(|mut error| {
        if let Some(found) = error.advice_mut() {
            *found = advice(spec, &|candidate| attempt(candidate).is_ok());
        }
        error
    })
}

/// The same without advice.
fn attempt(
    plant: &SwitchedPlant,
    spec: &ObserverSpec,
    units: &OwnedUnits,
    kind: ObserverKind,
    note: Option<String>,
    h: &[Vec<DMatrix<f64>>],
) -> Result<ObserverDesign, DesignError> {
    let model = ErrorModel::new(plant, &units.per_unit(), h);
    model.check_detectable(spec)?;
    let mut gains = Vec::new();
    let mut matrices = Vec::new();
    for group in spec.lyapunov.groups(plant.modes.len()) {
        let (problem, unknowns) = error_decay(&model, spec, &group);
        let margin = problem.margin()?;
        if margin.margin < SMALLEST_MARGIN {
            return Err(infeasible(margin.margin, margin.weights));
        }
        for unknown in &unknowns {
            let slack = unknown.slack.value(&margin.scalars);
            let injection = unknown.injection.value(&margin.scalars);
            let gain = slack.lu().solve(&injection);
            gains.push(gain.ok_or(SolverFailure::NumericalTrouble)?);
            matrices.push(unknown.lyapunov.value(&margin.scalars));
        }
    }
    matrices.truncate(spec.lyapunov.matrices(gains.len()));
    let parts = Parts {
        radius: (0..gains.len())
            .map(|i| spectral_radius(&(&model.projected[i][i] - &gains[i] * &model.outputs[i])))
            .collect(),
        gains: gains.iter().map(|gain| units.physical(gain)).collect(),
        decoupling: h.to_vec(),
        matrices,
    };
    parts.proved(plant, spec, units, kind, note)
}

/// An observer that has not been proved yet.
struct Parts {
    /// Spectral radius of each mode's error.
    radius: Vec<f64>,
    /// `K_i` in physical units.
    gains: Vec<DMatrix<f64>>,
    /// `H_ij` in physical units.
    decoupling: Vec<Vec<DMatrix<f64>>>,
    /// Lyapunov matrices in per-unit.
    matrices: Vec<DMatrix<f64>>,
}

impl Parts {
    /// The observer, once what it claims is proved.
    fn proved(
        self,
        plant: &SwitchedPlant,
        spec: &ObserverSpec,
        units: &OwnedUnits,
        kind: ObserverKind,
        note: Option<String>,
    ) -> Result<ObserverDesign, DesignError> {
        let wrap = |row: Vec<DMatrix<f64>>| row.iter().map(plain).collect();
        let decoupling = self.decoupling.into_iter().map(wrap).collect();
        let mut observer = Observer::new(kind, wrap(self.gains), decoupling);
        observer.note = note;
        let mut found = ObserverDesign {
            spec: spec.clone(),
            spectral_radius: self.radius,
            observer,
            dwell: None,
            certificate: ObserverCertificate {
                states: units.states.clone(),
                outputs: units.outputs.clone(),
                lyapunov: self.matrices.into_iter().map(LyapunovMatrix).collect(),
            },
            lost: None,
        };
        if spec.lyapunov != Lyapunov::Dwell {
            found.verify(plant)?;
            return Ok(found);
        }
        let mu = observer_growth(plant, &found).ok_or(SolverFailure::NumericalTrouble)?;
        let mut outcome = Err(SolverFailure::NumericalTrouble.into());
        for allowance in DwellTime::ALLOWANCES {
            let dwell = DwellTime::new(mu * (1.0 + allowance), spec.decay, plant.sample_time);
            found.dwell = Some(dwell);
            outcome = found.verify(plant).map_err(DesignError::from);
            if outcome.is_ok() {
                break;
            }
        }
        outcome.map(|()| found)
    }
}

/// Ratios of the sensors' noise to the disturbance that are tried for a Kalman filter.
const RATIOS: [f64; 13] = [
    1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.2, 0.5, 1.0, 3.0, 10.0, 100.0,
];

/// A ratio in the middle, where nothing chooses one.
pub(crate) const USUAL_RATIO: f64 = 0.1;

/// The plant as the filters of all modes see it.
fn filters(plant: &SwitchedPlant, spec: &ObserverSpec, units: &OwnedUnits) -> Vec<Filtered> {
    let noise = match spec.noise.len() == units.outputs.len() {
        true => &spec.noise,
        false => &units.outputs,
    };
    let modes = plant.modes.iter();
    modes
        .map(|mode| Filtered::new(mode, &units.per_unit(), noise))
        .collect()
}

/// An observer in the running, with what is known of it before it is proved.
pub(crate) struct Candidate {
    /// The observer; of a filter, before it is moved to where its decay can be proved.
    pub observer: Observer,
    /// Ratio of the noises it was made for, or that filters beside it are made for.
    pub ratio: f64,
    /// The proved design, where there is one already.
    ready: Option<ObserverDesign>,
}

impl Candidate {
    fn ready(design: ObserverDesign) -> Self {
        Self {
            observer: design.observer.clone(),
            ratio: USUAL_RATIO,
            ready: Some(design),
        }
    }

    /// The Kalman filter of a ratio; `None` where it does not exist.
    fn filter(filters: &[Filtered], units: &OwnedUnits, ratio: f64) -> Option<Self> {
        let gains = filters.iter().map(|filter| filter.gain(&[], ratio));
        let physical = |gain: DMatrix<f64>| plain(&units.physical(&gain));
        let gains: Vec<Matrix> = gains
            .map(|gain| gain.map(physical))
            .collect::<Option<_>>()?;
        let none = DMatrix::zeros(filters[0].a.nrows(), filters[0].c.nrows());
        Some(Self {
            observer: Observer::new(
                ObserverKind::Kalman,
                vec![plain(&none); filters.len()],
                vec![gains; filters.len()],
            ),
            ratio,
            ready: None,
        })
    }

    /// The observer, proved; a filter is first moved to where its decay can be.
    ///
    /// # Errors
    /// The asked decay cannot be proved of it.
    pub fn proved(
        &self,
        plant: &SwitchedPlant,
        spec: &ObserverSpec,
        scaling: &Scaling,
    ) -> Result<ObserverDesign, DesignError> {
        match &self.ready {
            Some(design) => Ok(design.clone()),
            None => kalman(plant, spec, &units(scaling), self.ratio)
                .ok_or_else(|| SolverFailure::NumericalTrouble.into()),
        }
    }
}

/// The Kalman filter of this ratio of noises, moved towards faster decay where the filter itself does
/// not decay as asked, and proved; `None` where there is none.
fn kalman(
    plant: &SwitchedPlant,
    spec: &ObserverSpec,
    units: &OwnedUnits,
    ratio: f64,
) -> Option<ObserverDesign> {
    let filters = filters(plant, spec, units);
    let kalman = filters.iter().map(|filter| filter.gain(&[], ratio));
    let (gains, matrices) = with_functions(spec, &filters, kalman.collect::<Option<_>>()?)?;
    let errors = filters
        .iter()
        .zip(&gains)
        .map(|(filter, gain)| filter.error(gain));
    let modes = filters.len();
    let physical: Vec<DMatrix<f64>> = gains.iter().map(|gain| units.physical(gain)).collect();
    let parts = Parts {
        radius: errors.map(|error| spectral_radius(&error)).collect(),
        gains: vec![DMatrix::zeros(filters[0].a.nrows(), filters[0].c.nrows()); modes],
        decoupling: vec![physical; modes],
        matrices,
    };
    parts
        .proved(plant, spec, units, ObserverKind::Kalman, None)
        .ok()
}

/// Gains (per-unit) near the given ones, and matrices in which their errors decay as asked.
#[allow(clippy::type_complexity, reason = "two lists, one line")]
fn with_functions(
    spec: &ObserverSpec,
    filters: &[Filtered],
    kalman: Vec<DMatrix<f64>>,
) -> Option<(Vec<DMatrix<f64>>, Vec<DMatrix<f64>>)> {
    let decay = spec.decay * (1.0 - 1e-7);
    let fixed = |i: usize| Demand::Fixed(filters[i].error(&kalman[i]));
    let mut gains = kalman.clone();
    let mut matrices = Vec::new();
    for group in spec.lyapunov.groups(filters.len()) {
        let demands: Vec<Demand> = group.iter().map(|&i| fixed(i)).collect();
        if let Some(function) = common_function(&demands, decay) {
            matrices.push(function);
            continue;
        }
        let free = |&i: &usize| Demand::Free(&filters[i], &[]);
        let function = common_function(&group.iter().map(free).collect::<Vec<_>>(), decay)?;
        for i in group {
            gains[i] = blended(&filters[i], &[], &kalman[i], &function, decay)?;
        }
        matrices.push(function);
    }
    let wanted = spec.lyapunov.matrices(filters.len());
    let shared = matrices[0].clone();
    matrices.resize(wanted, shared);
    Some((gains, matrices))
}

/// The Kalman filters of the usual ratios of noises and, where it exists and nothing speaks against
/// it, the unknown input observer; or the one observer that is asked for.
///
/// # Errors
/// No observer decays as asked; the error says why and what would help.
pub(crate) fn candidates(
    plant: &SwitchedPlant,
    spec: &ObserverSpec,
    scaling: &Scaling,
) -> Result<Vec<Candidate>, DesignError> {
    Dimensions::check(plant)?;
    spec.check()?;
    let only =
        |found: Result<ObserverDesign, DesignError>| found.map(|o| vec![Candidate::ready(o)]);
    match spec.kind {
        ObserverChoice::Uio => return only(unknown_input(plant, spec, scaling)),
        ObserverChoice::Luenberger => return only(luenberger(plant, spec, scaling, None)),
        ObserverChoice::Auto | ObserverChoice::Kalman => {}
    }
    let units = units(scaling);
    // Whether any filter decays as asked: one of them tells for all.
    if kalman(plant, spec, &units, USUAL_RATIO).is_none() {
        return only(luenberger(plant, spec, scaling, None));
    }
    let filters = filters(plant, spec, &units);
    let of = |&ratio: &f64| Candidate::filter(&filters, &units, ratio);
    let mut found: Vec<Candidate> = RATIOS.iter().filter_map(of).collect();
    if spec.kind == ObserverChoice::Auto && reason_against(plant).is_none() {
        let decoupled = unknown_input(plant, spec, scaling);
        found.extend(decoupled.ok().map(Candidate::ready));
    }
    Ok(found)
}

/// The observer with gains for every set of lost sensors that can be served and proved.
pub(crate) fn with_lost_sensors(
    plant: &SwitchedPlant,
    observer: ObserverDesign,
    ratio: f64,
) -> ObserverDesign {
    let units = OwnedUnits {
        states: observer.certificate.states.clone(),
        outputs: observer.certificate.outputs.clone(),
    };
    let filters = filters(plant, &observer.spec, &units);
    lost_synthesis::add(plant, observer, &filters, ratio)
}

/// The changes among the usual ones that work.
fn advice(spec: &ObserverSpec, works: &dyn Fn(&ObserverSpec) -> bool) -> Vec<Advice> {
    let slower = Advice::DECAYS.into_iter().find(|&decay| {
        let candidate = ObserverSpec {
            decay,
            ..spec.clone()
        };
        decay > spec.decay && works(&candidate)
    });
    let other = spec.lyapunov.weaker().iter().find(|&&lyapunov| {
        spec.decay < 1.0
            && works(&ObserverSpec {
                lyapunov,
                ..spec.clone()
            })
    });
    let mut advice: Vec<Advice> = slower.map(Advice::ObserverDecay).into_iter().collect();
    advice.extend(other.map(|&lyapunov| Advice::ObserverLyapunov(lyapunov)));
    advice
}
