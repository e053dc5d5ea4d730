//! The fault estimator that a design file asks for.

use crate::check;
use crate::complaint::{Complaint, at};
use crate::healthy_log::Logs;
use crate::schema::{self, EstimatorMethod};
use crate::values::{NameOrList, NumberOrList};
use crate::wording::of_spec;
use ftc_control::parameters;
use ftc_design::assembly::{
    DatabaseSource, EstimatorSpec, KnownDisturbance, LONGEST_DEBOUNCE, Threshold,
};
use ftc_design::commissioning::longest_response;
use ftc_design::{HypothesesSpec, MODE_LENGTH};
use ftc_plant::Dimensions;

/// How the names of logs end.
const LOG_ENDINGS: [&str; 4] = [".csv", ".tsv", ".txt", ".dat"];

pub(crate) fn estimator(
    given: &schema::Estimator,
    disturbance: Option<KnownDisturbance>,
    dims: Dimensions,
    logs: &Logs,
) -> Result<EstimatorSpec, Complaint> {
    let usual = EstimatorSpec::default();
    let database = database(given, logs)?.unwrap_or(usual.database);
    let method = match (given.method, &database) {
        // With a model that is right, such as an identified one, it accuses a sensor a sample earlier.
        (None, DatabaseSource::Recorded(_)) => parameters::EstimatorMethod::Reference,
        (None, _) => usual.method,
        (Some(EstimatorMethod::Observer), _) => parameters::EstimatorMethod::Observer,
        (Some(EstimatorMethod::Reference), _) => parameters::EstimatorMethod::Reference,
        (Some(EstimatorMethod::Sliding), _) => parameters::EstimatorMethod::Sliding,
        (Some(EstimatorMethod::None), _) => parameters::EstimatorMethod::None,
    };
    let response_length = match given.response_length {
        None => None,
        Some(length) => Some(at(
            "estimator.response_length",
            check::count(length, 1, longest_response(dims.inputs)),
        )?),
    };
    let debounce = match given.debounce {
        None => usual.debounce,
        Some(samples) => at(
            "estimator.debounce",
            check::count(samples, 1, LONGEST_DEBOUNCE as usize),
        )? as u32,
    };
    let stuck_after = match given.stuck_after {
        None => usual.stuck_after,
        Some(samples) => at(
            "estimator.stuck_after",
            check::count(samples, 0, LONGEST_DEBOUNCE as usize),
        )? as u32,
    };
    let hypotheses = hypotheses(given, dims)?;
    if hypotheses.mode_length.is_some() && method != parameters::EstimatorMethod::Observer {
        return Err(Complaint::of(
            "estimator.mode",
            "= \"estimated\" is for method = \"observer\" only: change one of them",
        ));
    }
    for key in unread(given, method) {
        logs.notes.add(format!(
            "estimator.{key}: method = \"{}\" does not use it: leave it out, or set another method",
            name_of(method)
        ));
    }
    let mut estimator = EstimatorSpec::default();
    estimator.method = method;
    estimator.response_length = response_length;
    estimator.database = database;
    estimator.threshold = threshold(given, dims, usual.threshold)?;
    estimator.debounce = debounce;
    estimator.stuck_after = stuck_after;
    estimator.adapt = given.adapt.unwrap_or(usual.adapt);
    estimator.disturbance = disturbance;
    estimator.hypotheses = hypotheses;
    estimator.check(dims).map_err(|error| of_spec(&error))?;
    Ok(estimator)
}

/// What `estimator.method` calls a method.
fn name_of(method: parameters::EstimatorMethod) -> &'static str {
    match method {
        parameters::EstimatorMethod::Observer => "observer",
        parameters::EstimatorMethod::Reference => "reference",
        parameters::EstimatorMethod::Sliding => "sliding",
        parameters::EstimatorMethod::None => "none",
    }
}

/// The keys that ask for something of which this method knows nothing.
fn unread(given: &schema::Estimator, method: parameters::EstimatorMethod) -> Vec<&'static str> {
    let of_the_database = [
        ("response_length", given.response_length.is_some()),
        (
            "debounce",
            given.debounce.is_some_and(|samples| samples != 1),
        ),
        ("adapt", given.adapt == Some(true)),
    ];
    let of_the_observer = [
        ("model_error", given.model_error.is_some()),
        ("fault_rate", given.fault_rate.is_some()),
        ("fault_length", given.fault_length.is_some()),
        ("input_load", given.input_load.is_some()),
        ("ambiguous", given.ambiguous.is_some()),
        ("authority", given.authority.is_some()),
    ];
    let (database, observer) = match method {
        parameters::EstimatorMethod::Observer => (&of_the_database[..], &[][..]),
        parameters::EstimatorMethod::Reference => (&[][..], &of_the_observer[..]),
        parameters::EstimatorMethod::Sliding => (&of_the_database[2..], &of_the_observer[..]),
        // Whoever turns it off for once keeps the keys.
        parameters::EstimatorMethod::None => (&[][..], &[][..]),
    };
    let keys = database.iter().chain(observer);
    keys.filter(|(_, given)| *given)
        .map(|(key, _)| *key)
        .collect()
}

fn hypotheses(given: &schema::Estimator, dims: Dimensions) -> Result<HypothesesSpec, Complaint> {
    let usual = HypothesesSpec::default();
    let sizes = |key: &str, value: &Option<NumberOrList>, count: usize| match value {
        None => Ok(None),
        Some(value) => at(key, value.spread(count)).map(Some),
    };
    let estimated = given.mode == Some(schema::ModeSource::Estimated);
    let mode_length = match (estimated, given.mode_length) {
        (false, None) => None,
        (false, Some(_)) => {
            return Err(Complaint::of(
                "estimator.mode_length",
                "is given, but the mode is told: add mode = \"estimated\", or remove it",
            ));
        }
        (true, length) => Some(length.unwrap_or(MODE_LENGTH)),
    };
    let mut hypotheses = HypothesesSpec::default();
    hypotheses.model_error = given.model_error.unwrap_or(usual.model_error);
    hypotheses.fault_rate = given.fault_rate.unwrap_or(usual.fault_rate);
    hypotheses.fault_length = given.fault_length.unwrap_or(usual.fault_length);
    hypotheses.ambiguous = match given.ambiguous {
        None => usual.ambiguous,
        Some(schema::Ambiguous::TrustSensors) => parameters::Ambiguous::TrustSensors,
        Some(schema::Ambiguous::TrustModel) => parameters::Ambiguous::TrustModel,
    };
    hypotheses.mode_length = mode_length;
    hypotheses.authority = sizes("estimator.authority", &given.authority, dims.outputs)?;
    hypotheses.input_load = sizes("estimator.input_load", &given.input_load, dims.inputs)?;
    Ok(hypotheses)
}

/// The database that is named, if any is.
fn database(given: &schema::Estimator, logs: &Logs) -> Result<Option<DatabaseSource>, Complaint> {
    let is_log = |name: &str| {
        let name = name.to_lowercase();
        LOG_ENDINGS.iter().any(|ending| name.ends_with(ending))
    };
    let Some(files) = given.logs() else {
        return Ok(given.database.as_ref().map(|name| match name {
            NameOrList::Name(name) if name == schema::MODEL => DatabaseSource::Model,
            _ => DatabaseSource::Commission,
        }));
    };
    if let NameOrList::Name(name) = files
        && !is_log(name)
    {
        return Err(Complaint::of(
            "estimator.database",
            format!(
                "= \"{}\" is not a known value and no CSV file: {}",
                crate::sentence::shorten(name),
                crate::suggest::nearest(name, &[schema::COMMISSION, schema::MODEL])
            ),
        ));
    }
    if let NameOrList::List(names) = files
        && let Some(name) = names.iter().find(|name| !is_log(name))
    {
        return Err(Complaint::of(
            "estimator.database",
            format!(
                "lists \"{}\": list CSV files only, one per mode",
                crate::sentence::shorten(name)
            ),
        ));
    }
    if matches!(
        given.method,
        Some(EstimatorMethod::Sliding | EstimatorMethod::None)
    ) {
        return Err(Complaint::of(
            "estimator.database",
            "names a log, which only the methods \"observer\" and \"reference\" use: set another estimator.method, or \
             leave it out",
        ));
    }
    let recorded = at("estimator.database", logs.read(files))?;
    Ok(Some(DatabaseSource::Recorded(recorded)))
}

fn threshold(
    given: &schema::Estimator,
    dims: Dimensions,
    usual: Threshold,
) -> Result<Threshold, Complaint> {
    match (&given.threshold, given.sigmas) {
        (Some(_), Some(_)) => Err(Complaint::of(
            "estimator.threshold",
            "and estimator.sigmas exclude each other: give one of them",
        )),
        (Some(threshold), None) => {
            let values = at("estimator.threshold", threshold.spread(dims.outputs))?;
            Ok(Threshold::Given(values))
        }
        (None, None) => Ok(usual),
        (None, Some(sigmas)) => Ok(Threshold::Sigmas(sigmas)),
    }
}
