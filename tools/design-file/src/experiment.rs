//! The experiment that a design file asks for.

use crate::assemble::names;
use crate::check;
use crate::complaint::{Complaint, Key, at};
use crate::defaults;
use crate::schema;
use crate::signal::{Signal as SignalOverTime, Tables};
use crate::true_plant::{beyond_the_end, mode_names};
use crate::values::Which;
use crate::wording::of_scenario;
use ftc_design::Signals;
use ftc_design::assembly::KnownDisturbance;
use ftc_plant::scenario::{MOST_STEPS, ModeInterval, Waveform};
use ftc_plant::{Dimensions, Scenario, SwitchedPlant};

/// Everything the scenario depends on.
pub(crate) struct ScenarioContext<'a> {
    pub(crate) scenario: &'a schema::Scenario,
    pub(crate) known: Option<&'a KnownDisturbance>,
    pub(crate) tracked: &'a [usize],
    pub(crate) signals: &'a Signals,
    pub(crate) plant: &'a SwitchedPlant,
    pub(crate) dims: Dimensions,
    pub(crate) tables: Tables<'a>,
    /// When the scenario ends, in seconds.
    pub(crate) end: f64,
}

impl ScenarioContext<'_> {
    pub(crate) fn resolve(&self) -> Result<Scenario, Complaint> {
        let given = self.scenario;
        let steps = given.steps.map_or(Ok(defaults::STEPS), |steps| {
            let steps = check::count(steps, 1, MOST_STEPS as usize);
            at("scenario.steps", steps).map(|steps| steps as u64)
        })?;
        let seed = given.seed.map_or(Ok(defaults::SEED), |seed| {
            at("scenario.seed", check::seed(seed))
        })?;
        let (outputs, disturbances) = (self.dims.outputs, self.dims.disturbances);
        let schedule = self.schedule()?;
        let first = schedule.first().map_or(0, |interval| interval.mode);
        let noise = self.noise()?;
        let tracked = self.tracked.len();
        let reference = self.channels("reference", &given.reference, tracked, |at| {
            self.step(at, first, steps)
        })?;
        let mut scenario = Scenario::new(steps, reference, self.dims);
        scenario.noise = noise;
        scenario.seed = seed;
        scenario.fault = self.channels("fault", &given.fault, outputs, |_| Waveform::ZERO)?;
        scenario.disturbance =
            self.channels("disturbance", &given.disturbance, disturbances, |at| {
                self.expected_disturbance(at)
            })?;
        scenario.events = self.events()?;
        scenario.schedule = schedule;
        let modes = self.plant.modes.len();
        let checked = scenario.check(self.dims, modes, tracked);
        checked.map_err(|error| of_scenario(&error))?;
        Ok(scenario)
    }

    fn noise(&self) -> Result<Vec<f64>, Complaint> {
        let outputs = self.dims.outputs;
        match &self.scenario.noise {
            None => Ok(vec![0.0; outputs]),
            Some(given) => at("scenario.noise", given.spread(outputs)),
        }
    }

    fn schedule(&self) -> Result<Vec<ModeInterval>, Complaint> {
        let whole = [schema::ModeInterval {
            from: 0.0,
            mode: Which::Number(1),
        }];
        let given = self.scenario.schedule.as_deref().unwrap_or(&whole);
        let names = mode_names(self.plant);
        let resolve = |(entry, interval): (usize, &schema::ModeInterval)| {
            let key = Key::from("scenario.schedule").entry(entry);
            let mode = interval.mode.index(&names, "modes");
            let mode = at(key.clone().then("mode"), mode)?;
            self.warn_beyond_the_end(&key, interval.from);
            Ok(ModeInterval {
                from: interval.from,
                mode,
            })
        };
        given.iter().enumerate().map(resolve).collect()
    }

    fn channels(
        &self,
        name: &str,
        given: &Option<Vec<SignalOverTime>>,
        size: usize,
        default: impl Fn(usize) -> Waveform,
    ) -> Result<Vec<Waveform>, Complaint> {
        let key = Key::from("scenario").then(name);
        let Some(given) = given else {
            return Ok((0..size).map(default).collect());
        };
        let waveform = |(index, signal): (usize, &SignalOverTime)| {
            let waveform = signal.waveform(self.tables);
            waveform.map_err(|what| what.inside(key.clone().entry(index)))
        };
        given.iter().enumerate().map(waveform).collect()
    }

    fn events(&self) -> Result<Vec<ftc_plant::scenario::FaultEvent>, Complaint> {
        let events = self.scenario.events.iter().flatten().enumerate();
        let names = names(&self.signals.outputs);
        events
            .map(|(index, event)| {
                let key = Key::from("scenario.events").entry(index);
                let fault = event.fault(&names);
                let fault = fault.map_err(|what| what.inside(key.clone()))?;
                self.warn_beyond_the_end(&key, fault.from);
                Ok(fault)
            })
            .collect()
    }

    /// Says of an entry that begins when the scenario is over that it never acts.
    fn warn_beyond_the_end(&self, key: &Key, from: f64) {
        if from >= self.end {
            self.tables.notes.add(beyond_the_end(key, from, self.end));
        }
    }

    /// A step of a tracked output from its operating point in the first mode.
    fn step(&self, tracked: usize, first_mode: usize, steps: u64) -> Waveform {
        let output = self.tracked[tracked];
        let start = self.plant.modes[first_mode].operating_point.y[output];
        let nominal = self.signals.outputs[output].nominal;
        let height = if nominal == 1.0 { 1.0 } else { nominal / 5.0 };
        let time = (steps / 10).max(1) as f64 * self.plant.sample_time;
        Waveform::Steps {
            points: vec![[0.0, start], [time, start + height]],
        }
    }

    /// A sine of the known period and amplitude.
    fn expected_disturbance(&self, channel: usize) -> Waveform {
        let sine = self.known.and_then(|known| {
            let amplitude = *known.amplitude.as_ref()?.get(channel)?;
            Some(Waveform::Sine {
                amplitude,
                period: known.period,
                phase: 0.0,
                offset: 0.0,
            })
        });
        sine.unwrap_or(Waveform::ZERO)
    }
}
