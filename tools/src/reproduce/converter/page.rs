//! The page of the converter.

use super::{CONTENDERS, Trial, name};
use crate::report::page::{Block, Column, Page, Row, Section, Table};
use crate::report::text::aligned;
use ftc::design::Design;
use ftc::simulate::Variant;

/// Everything.
pub fn page(_design: &Design, trials: &[Trial]) -> Page {
    Page {
        title: "AC/DC converter: fault-tolerant against predictive control".into(),
        sections: vec![Section::new("Every fault").with(Block::Table(table(trials)))],
        ..Page::default()
    }
}

fn table(trials: &[Trial]) -> Table {
    let mut columns = vec![Column::name("fault")];
    columns.extend(CONTENDERS.map(|variant| Column::number(name(variant))));
    let rows = trials.iter().map(|trial| {
        let mut cells = vec![trial.case.words.clone()];
        cells.extend(CONTENDERS.map(|variant: Variant| {
            let values = trial.vaf(variant);
            let values: Vec<String> = values.iter().map(|v| aligned(*v, 2)).collect();
            values.join(" / ")
        }));
        Row {
            cells,
            ..Row::default()
        }
    });
    Table {
        caption: "True VAF (%)".into(),
        columns,
        rows: rows.collect(),
        notes: Vec::new(),
    }
}
