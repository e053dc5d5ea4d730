//! The page inside an FMU, `documentation/index.html`: the design's experiment in figures, and the
//! design report.

use crate::connection::{self, Side};
use crate::page::{Block, Page, Section};
use crate::{Digest, Scene, simulate, summary};
use ftc_design::Design;
use ftc_simulate::Variant;

/// The most samples that are simulated for the figures; an export is to remain quick.
const MOST_SAMPLES: u64 = 20_000;

/// The runs that the figures show: with and without fault tolerance.
pub fn runs(design: &Design) -> Vec<Digest> {
    let mut shown = design.clone();
    shown.scenario.steps = shown.scenario.steps.min(MOST_SAMPLES);
    let shows = [Variant::Ftc, Variant::NoFtc];
    shows.map(|variant| simulate::one(&shown, variant)).into()
}

/// The page of one of the two FMUs, of which `title` and `lead` speak; without a side, of the design.
pub fn page(
    design: &Design,
    runs: &[Digest],
    side: Option<Side>,
    title: String,
    lead: String,
) -> String {
    let scene = Scene::new(design, runs);
    let sections = [
        Section::new("Outputs")
            .paragraph(extent(design))
            .figures(scene.outputs()),
        Section::new("Sensor faults")
            .figures(scene.faults())
            .figures(scene.residuals()),
        Section::new("Inputs").figures(scene.inputs()),
        Section::new("Disturbance").figures(scene.disturbances()),
    ];
    let report = summary::sections(design)
        .into_iter()
        .map(|(title, lines)| Section::new(title).with(Block::Facts(lines)));
    Page {
        title,
        lead,
        sections: side
            .map(|side| connection::section(design, side))
            .into_iter()
            .chain(sections.into_iter().filter(shows_something))
            .chain(report)
            .collect(),
        footer: format!("Made by ftc-fmu {}.", env!("CARGO_PKG_VERSION")),
        ..Page::default()
    }
    .render()
}

/// What the figures show of the experiment.
fn extent(design: &Design) -> String {
    let steps = design.scenario.steps;
    let part = if steps > MOST_SAMPLES {
        format!("the first {MOST_SAMPLES} of {steps} samples")
    } else {
        format!("all {steps} samples")
    };
    format!(
        "The scenario that the plant FMU runs ({part}), simulated when this FMU was made: what the plant \
         really does with and without fault-tolerant control (FTC)."
    )
}

fn shows_something(section: &Section) -> bool {
    section
        .blocks
        .iter()
        .any(|block| matches!(block, Block::Figures(figures) if !figures.is_empty()))
}
