//! The figures of the page.

use super::digest::{Curves, Digest, points};
use super::{RANKING, find, name_of, unit_of, variant_name};
use crate::decimate::Thinned;
use crate::figure::{Dash, Figure, Ink, Mark, Series, Weight};
use crate::style;
use crate::text::with_unit;
use ftc_control::parameters::EstimatorMethod;
use ftc_design::Design;
use ftc_simulate::Variant;

const TIME: &str = "time (s)";
const FAULTY: &str = "fault present";

/// The runs of one scenario, and what all figures share.
pub struct Scene<'a> {
    design: &'a Design,
    runs: &'a [Digest],
    /// The run whose measurements, estimates and scenario are shown.
    main: Option<&'a Digest>,
    marks: Vec<Mark>,
}

impl<'a> Scene<'a> {
    /// Collects the runs.
    pub fn new(design: &'a Design, runs: &'a [Digest]) -> Self {
        let main = find(runs, Variant::Ftc)
            .or(runs.first())
            .filter(|run| run.samples() > 0);
        let mut scene = Self {
            design,
            runs,
            main,
            marks: Vec::new(),
        };
        scene.marks = scene.switches();
        scene
    }

    /// One figure per output: the true output of every variant about the reference.
    pub fn outputs(&self) -> Vec<Figure> {
        self.for_each(
            |curves| curves.y.len(),
            |run, output| self.output(run, output),
        )
    }

    /// One figure per sensor: fault and estimate; none when nothing is estimated and nothing fails.
    pub fn faults(&self) -> Vec<Figure> {
        let Some(run) = self.main else {
            return Vec::new();
        };
        let estimates = self.design.controller.estimator.method != EstimatorMethod::None;
        if estimates || !run.any_fault_intervals().is_empty() {
            self.for_each(
                |curves| curves.f_hat.len(),
                |run, sensor| self.fault(run, sensor),
            )
        } else {
            Vec::new()
        }
    }

    /// One figure per sensor: residual and threshold.
    pub fn residuals(&self) -> Vec<Figure> {
        if self.design.controller.estimator.method == EstimatorMethod::None {
            return Vec::new();
        }
        self.for_each(
            |curves| curves.residual.len(),
            |run, sensor| self.residual(run, sensor),
        )
    }

    /// One figure per input: the command of every variant.
    pub fn inputs(&self) -> Vec<Figure> {
        self.for_each(|curves| curves.u.len(), |run, input| self.input(run, input))
    }

    /// One figure per disturbance.
    pub fn disturbances(&self) -> Vec<Figure> {
        self.for_each(
            |curves| curves.disturbance.len(),
            |run, channel| {
                let name = format!("w[{}]", channel + 1);
                let points = points(&run.curves().disturbance, channel);
                Figure::new(
                    format!("disturbance-{}", channel + 1),
                    format!("Disturbance {name}"),
                    TIME,
                    name.clone(),
                )
                .with(Series::new(name, points).ink(Ink::Purple))
                .mark(&self.marks)
            },
        )
    }

    fn for_each(
        &self,
        size: impl Fn(&Curves) -> usize,
        make: impl Fn(&Digest, usize) -> Figure,
    ) -> Vec<Figure> {
        self.main.map_or_else(Vec::new, |run| {
            (0..size(run.curves()))
                .map(|index| make(run, index))
                .collect()
        })
    }

    fn output(&self, run: &Digest, output: usize) -> Figure {
        let outputs = &self.design.signals.outputs;
        let name = name_of(outputs, output, "y");
        let label = with_unit(&name, unit_of(outputs, output));
        let mut figure = Figure::new(
            format!("output-{}", output + 1),
            format!("Output {name}"),
            TIME,
            label,
        )
        .with(style::measured(points(&run.curves().y, output)));
        for series in self.variants(|curves| &curves.y_true, output) {
            figure = figure.with(series);
        }
        if let Some(row) = self
            .design
            .controller
            .feedback
            .tracked
            .iter()
            .position(|row| *row == output)
        {
            let reference = points(&run.curves().reference, row);
            figure = figure.with(style::reference(reference));
        }
        figure
            .shade(FAULTY, self.times(run.fault_intervals(output)))
            .mark(&self.marks)
    }

    fn fault(&self, run: &Digest, sensor: usize) -> Figure {
        let outputs = &self.design.signals.outputs;
        let name = name_of(outputs, sensor, "y");
        let truth = points(&run.curves().fault, sensor);
        Figure::new(
            format!("fault-{}", sensor + 1),
            format!("Fault of sensor {name}"),
            TIME,
            with_unit(&format!("fault of {name}"), unit_of(outputs, sensor)),
        )
        .with(style::true_fault(truth))
        .with(Series::new("estimate", points(&run.curves().f_hat, sensor)).step())
        .shade(FAULTY, self.times(run.fault_intervals(sensor)))
        .mark(&self.marks)
    }

    fn residual(&self, run: &Digest, sensor: usize) -> Figure {
        let outputs = &self.design.signals.outputs;
        let name = name_of(outputs, sensor, "y");
        let mut figure = Figure::new(
            format!("residual-{}", sensor + 1),
            format!("Residual of sensor {name}"),
            TIME,
            with_unit(&format!("residual of {name}"), unit_of(outputs, sensor)),
        )
        .with(
            Series::new("residual", points(&run.curves().residual, sensor))
                .ink(Ink::Purple)
                .weight(Weight::Thin)
                .step(),
        );
        if let Some(&threshold) = self.design.controller.estimator.thresholds.get(sensor) {
            let (from, until) = (0.0, self.time(run.samples() - 1));
            let level = |name: String, value| {
                Series::new(name, vec![[from, value], [until, value]])
                    .ink(Ink::Vermilion)
                    .dash(Dash::Dashed)
                    .weight(Weight::Thin)
            };
            let name = format!("threshold ±{}", crate::text::number(threshold));
            figure = figure
                .with(level(name, threshold))
                .with(level(String::new(), -threshold));
        }
        figure
            .shade(FAULTY, self.times(run.fault_intervals(sensor)))
            .mark(&self.marks)
    }

    fn input(&self, run: &Digest, input: usize) -> Figure {
        let inputs = &self.design.signals.inputs;
        let name = name_of(inputs, input, "u");
        let label = with_unit(&name, unit_of(inputs, input));
        let mut figure = Figure::new(
            format!("input-{}", input + 1),
            format!("Input {name}"),
            TIME,
            label,
        );
        for series in self.variants(|curves| &curves.u, input) {
            figure = figure.with(series.step());
        }
        figure
            .shade("a sensor is faulty", self.times(run.any_fault_intervals()))
            .mark(&self.marks)
    }

    /// A signal of every variant, each in the variant's own look; the one this is about on top.
    fn variants(&self, signal: impl Fn(&Curves) -> &[Thinned], index: usize) -> Vec<Series> {
        RANKING
            .into_iter()
            .rev()
            .filter_map(|variant| find(self.runs, variant))
            .map(|run| {
                let points = points(signal(run.curves()), index);
                style::variant(variant_name(run.variant), run.variant, points)
            })
            .collect()
    }

    fn time(&self, tick: u64) -> f64 {
        tick as f64 * self.design.plant.sample_time
    }

    fn times(&self, intervals: &[[usize; 2]]) -> Vec<[f64; 2]> {
        intervals
            .iter()
            .map(|interval| interval.map(|index| self.time(index as u64)))
            .collect()
    }

    /// A mark wherever another mode becomes active.
    fn switches(&self) -> Vec<Mark> {
        let Some(run) = self.main else {
            return Vec::new();
        };
        let modes = &self.design.plant.modes;
        let mark = |&(tick, mode): &(u64, usize)| Mark {
            at: self.time(tick),
            label: super::mode_name(modes, mode),
        };
        run.switches().iter().map(mark).collect()
    }
}
