//! Properties of whole pages: well-formed, finite, escaped, small, for any sizes.

use super::figure::{Figure, Mark, Series};
use super::page::{Column, KeyNumber, Page, Row, Section, Table};
use super::simulate::{Extent, SimulateError, TableOfSamples};
use super::{Digest, demo, svg};
use ftc_control::parameters::{Compensation, Estimator, FeedbackGains, Observer, StateFeedback};
use ftc_control::{Controller, Matrix};
use ftc_design::{ControllerDesign, Design, DesignRecord, Signal, Signals};
use ftc_plant::scenario::{FaultEvent, FaultKind, ModeInterval, Waveform};
use ftc_plant::{Mode, Scenario, SwitchedPlant};
use ftc_simulate::{PlantSimulator, Variant, run};
use nalgebra::DMatrix;
use proptest::prelude::*;
use std::path::PathBuf;

#[path = "../../../tests/common/mod.rs"]
mod common;

/// Breaks a page that escapes nothing.
const HOSTILE: &str = "<script>alert(1)</script> & \"y'\" ]]> \u{1}";

fn signals(count: usize, symbol: &str, unit: Option<&str>) -> Vec<Signal> {
    (1..=count)
        .map(|index| {
            let mut signal = Signal::new(&format!("{symbol}[{index}]"));
            signal.unit = unit.map(String::from);
            signal
        })
        .collect()
}

/// The paper's example with the hand-made controller.
fn paper(noise: f64) -> Design {
    let controller = common::controller_design(common::Channel::State, noise);
    let plant = common::plant(common::Channel::State);
    let signals = Signals::numbered(plant.dimensions());
    let scenario = common::scenario(common::reference("levels"), noise, 1);
    DesignRecord::new("paper", plant, signals, controller, scenario).into()
}

/// A plant of first-order lags in any size, with a proportional-integral controller and no estimator.
fn lags(outputs: usize, disturbances: usize, steps: u64) -> Design {
    let square = DMatrix::identity(outputs, outputs);
    let diagonal = |value: f64| Matrix::identity(outputs).scaled(value);
    let mode = |pole: f64| {
        Mode::new(&square * pole, &square * (1.0 - pole), square.clone()).with_disturbance(
            DMatrix::from_element(outputs, disturbances, 0.1),
            DMatrix::zeros(outputs, disturbances),
        )
    };
    let gains = FeedbackGains::new(diagonal(-0.1), diagonal(0.2), diagonal(-0.1));
    let plant = SwitchedPlant::new(0.01, vec![mode(0.5), mode(0.7)]);
    let at = |time: f64| time * steps as f64 * 0.01;
    let signals = Signals::new(
        signals(outputs, "u", Some("V")),
        signals(outputs, "y", Some("A")),
        signals(outputs, "x", None),
    );
    let mut observer = Observer::luenberger(vec![diagonal(0.4); 2]);
    observer.note = Some("no disturbance to decouple".into());
    let mut estimator = Estimator::none(outputs);
    estimator.thresholds = vec![0.1; outputs];
    estimator.largest_fault = vec![1e6; outputs];
    let controller = ControllerDesign::new(
        StateFeedback::new((0..outputs).collect(), vec![gains; 2]),
        observer,
        estimator,
        Compensation::None,
    );
    let mut scenario = Scenario::new(
        steps,
        vec![
            Waveform::Square {
                amplitude: 1.0,
                period: at(0.4),
                offset: 0.0
            };
            outputs
        ],
        plant.dimensions(),
    );
    scenario.noise = vec![0.02; outputs];
    scenario.seed = 7;
    scenario.schedule = vec![
        ModeInterval { from: 0.0, mode: 0 },
        ModeInterval {
            from: at(0.5),
            mode: 1,
        },
    ];
    scenario.events = vec![FaultEvent {
        sensor: outputs - 1,
        from: at(0.6),
        until: at(0.8),
        kind: FaultKind::Dropout,
    }];
    scenario.disturbance = vec![
        Waveform::Sine {
            amplitude: 1.0,
            period: at(0.2),
            phase: 0.0,
            offset: 0.0
        };
        disturbances
    ];
    DesignRecord::new("lags", plant, signals, controller, scenario).into()
}

fn hostile(mut design: Design) -> Design {
    design.name = HOSTILE.into();
    let all = [
        &mut design.record.signals.inputs,
        &mut design.record.signals.outputs,
        &mut design.record.signals.states,
    ];
    for signal in all.into_iter().flatten() {
        signal.name = format!("{HOSTILE} {}", "long ".repeat(30));
        signal.unit = Some(HOSTILE.into());
    }
    for mode in &mut design.plant.modes {
        mode.name = HOSTILE.into();
    }
    design.controller.observer.note = Some(HOSTILE.into());
    design
}

fn simulate(design: &Design) -> Vec<Digest> {
    let plant = PlantSimulator::new(design.plant.clone(), design.scenario.clone());
    let controller = Controller::new(design.parameters()).unwrap();
    Variant::ALL
        .map(|variant| Digest::of(design, &run(&plant, &controller, variant)))
        .into()
}

/// Every number of every path, in document order.
fn check_svg(document: &str) -> Vec<String> {
    let tree =
        roxmltree::Document::parse(document).unwrap_or_else(|error| panic!("{error}: {document}"));
    let mut ids = Vec::new();
    for node in tree.descendants() {
        for attribute in node.attributes() {
            let value = attribute.value();
            assert!(
                !value.contains("NaN") && !value.contains("inf"),
                "{} = {value}",
                attribute.name()
            );
        }
        ids.extend(node.attribute("id").map(String::from));
        if let Some(path) = node.attribute("d") {
            assert!(
                path.chars().all(|c| "MhvlHV-. 0123456789".contains(c)),
                "{path}"
            );
        }
    }
    ids
}

/// Checks a page and returns it.
fn check_page(page: &Page) -> String {
    let html = page.render();
    let mut ids = Vec::new();
    let mut rest = html.as_str();
    while let Some(start) = rest.find("<svg") {
        let end = start + rest[start..].find("</svg>").expect("an svg that ends") + "</svg>".len();
        ids.extend(check_svg(&rest[start..end]));
        rest = &rest[end..];
    }
    let total = ids.len();
    ids.sort();
    ids.dedup();
    assert_eq!(ids.len(), total, "every id occurs once");
    assert_eq!(total, 3 * page.figures().count());
    assert!(!html.contains("<script"), "user strings are escaped");
    assert!(!html.contains('\u{1}'), "control characters are replaced");
    for foreign in ["http://", "https://", "url(h", "@import"] {
        let allowed = html.matches("http://www.w3.org/2000/svg").count();
        let found = html.matches(foreign).count();
        assert!(
            found == 0 || (foreign == "http://" && found == allowed),
            "{foreign}"
        );
    }
    html
}

/// Pages for the browser test, written where it looks for them.
fn keep(name: &str, design: &Design, runs: &[Digest]) {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../target/pages")
        .join(name);
    std::fs::create_dir_all(&folder).expect("a folder");
    for (name, text) in super::files(design, runs, &[], super::page::Section::new("None")) {
        if name.ends_with(".svg") {
            check_svg(&text);
        }
        std::fs::write(folder.join(name), text).expect("a file");
    }
}

#[test]
fn the_papers_example_makes_a_whole_page() {
    for (name, noise) in [("paper", 0.0), ("noisy", 0.005)] {
        let design = paper(noise);
        let runs = simulate(&design);
        let page = demo::page(&design, &runs, &[]);
        assert_eq!(page.figures().count(), 2 + 2 + 2 + 2 + 1);
        let html = check_page(&page);
        assert!(
            html.contains("4 of 4")
                && html.contains("fault present")
                && html.contains("mode 2: second")
        );
        assert!(html.len() < 1_000_000, "{}", html.len());
        keep(name, &design, &runs);
    }
}

#[test]
fn any_size_makes_a_page_below_a_megabyte() {
    for (outputs, disturbances, steps) in [(1, 0, 1), (1, 0, 300), (12, 3, 20_000)] {
        let design = lags(outputs, disturbances, steps);
        let runs = simulate(&design);
        let html = check_page(&demo::page(&design, &runs, &[]));
        assert!(html.len() < 1_000_000, "{} bytes", html.len());
        keep(&format!("lags-{outputs}-{steps}"), &design, &runs);
    }
}

#[test]
fn user_strings_cannot_break_out() {
    let design = hostile(paper(0.005));
    let runs = simulate(&design);
    let html = check_page(&demo::page(&design, &runs, &[]));
    assert!(html.contains("&lt;script&gt;"));
    keep("hostile", &design, &runs);
}

#[test]
fn nothing_simulated_is_said_so() {
    let html = check_page(&demo::page(&paper(0.0), &[], &[]));
    assert!(html.contains("Nothing was simulated."));
}

#[test]
fn a_lost_sensor_leaves_a_gap_in_its_curve() {
    let design = lags(1, 0, 300);
    let runs = simulate(&design);
    let page = demo::page(&design, &runs, &[]);
    let document = svg::document(page.figures().next().expect("an output"));
    let tree = roxmltree::Document::parse(&document).expect("well-formed");
    let measured = tree
        .descendants()
        .filter(|node| node.attribute("class") == Some("ink-faint"))
        .filter_map(|node| node.attribute("d"))
        .max_by_key(|path| path.len())
        .expect("the measured curve");
    assert_eq!(measured.matches('M').count(), 2, "{measured}");
}

#[test]
fn a_curve_that_runs_away_does_not_flatten_the_others() {
    let smooth: Vec<_> = (0..100)
        .map(|k| [k as f64, (k as f64 / 10.0).sin()])
        .collect();
    let wild: Vec<_> = (0..100).map(|k| [k as f64, 1.5f64.powi(k * 10)]).collect();
    let figure = Figure::new("f", "t", "x", "y")
        .with(Series::new("wild", wild).secondary())
        .with(Series::new("smooth", smooth));
    let document = svg::document(&figure);
    check_svg(&document);
    assert!(document.contains("wild leaves the picture"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_figure_is_well_formed_and_finite(
        values in prop::collection::vec(prop_oneof![8 => any::<f64>(), 8 => -1.0..1.0f64, 1 => Just(f64::NAN)], 0..3000),
        words in any::<String>(),
        step in any::<bool>(),
        spans in prop::collection::vec(0.0..3000.0f64, 0..20),
    ) {
        let points = values.iter().enumerate().map(|(k, v)| [k as f64, *v]).collect();
        let series = Series { step, ..Series::new(words.clone(), points) };
        let marks: Vec<Mark> = spans.iter().map(|at| Mark { at: *at, label: words.clone() }).collect();
        let mut intervals: Vec<[f64; 2]> = spans.iter().map(|at| [*at, at + 20.0]).collect();
        intervals.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let figure = Figure::new("figure", &words, &words, &words)
            .with(series)
            .shade(&words, intervals)
            .mark(&marks);
        check_svg(&svg::document(&figure));
    }

    #[test]
    fn any_words_are_escaped_in_every_block(words in any::<String>()) {
        let words = words + HOSTILE;
        let table = Table {
            caption: words.clone(),
            columns: vec![Column::name(&words), Column::number(&words), Column::words(&words)],
            rows: vec![Row { cells: vec![words.clone(); 3], ..Row::default() }],
            notes: vec![words.clone()],
        };
        let page = Page {
            title: words.clone(),
            lead: words.clone(),
            key_numbers: vec![KeyNumber { value: words.clone(), meaning: words.clone() }],
            sections: vec![
                Section::new(&words)
                    .paragraph(&words)
                    .with(super::page::Block::Table(table))
                    .with(super::page::Block::Facts(vec![(words.clone(), words.clone())])),
            ],
            footer: words,
        };
        check_page(&page);
    }
}

/// What would fill a disk is refused before it begins, with what would fit; the estimate is that of the
/// table within a factor of two.
#[test]
fn a_scenario_that_is_too_long_is_refused_with_an_estimate() {
    struct Bytes(u64);
    impl std::io::Write for &mut Bytes {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0 += bytes.len() as u64;
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let design = paper(0.005);
    let extent = |steps| Extent::new(design.plant.dimensions(), 2, steps, false);
    let mut written = Bytes(0);
    let mut table = TableOfSamples::new(&mut written, 1.0);
    crate::simulate::simulate(&design, Vec::new(), false, &mut table).unwrap();
    table.finish().unwrap();
    let estimate = extent(design.scenario.steps).bytes;
    assert!(
        written.0 < 2 * estimate && estimate < 2 * written.0,
        "{} bytes, estimated {estimate}",
        written.0
    );
    let refused = extent(1_000_000_000).check();
    let Err(error @ SimulateError::TooLong { most, .. }) = refused else {
        panic!("it is accepted")
    };
    let what = error.to_string();
    assert!(what.contains("scenario.steps is 1000000000"), "{what}");
    assert!(what.ends_with(&format!("at most {most}")), "{what}");
    assert!(extent(most).check().is_ok() && extent(most + most / 1000).check().is_err());
}
