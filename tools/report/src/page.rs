//! A page made of blocks.
#![expect(
    clippy::exhaustive_structs,
    clippy::exhaustive_enums,
    reason = "what a page can show, for the programs of this workspace"
)]

use super::figure::Figure;
use super::svg;
use super::text::clean;
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// A self-contained HTML page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Page {
    /// Heading and title of the window.
    pub title: String,
    /// What happened, in a sentence or two.
    pub lead: String,
    /// The few numbers to remember.
    pub key_numbers: Vec<KeyNumber>,
    /// The rest.
    pub sections: Vec<Section>,
    /// Where the page comes from.
    pub footer: String,
}

/// A number and what it means.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyNumber {
    /// The number with its unit.
    pub value: String,
    /// A few words.
    pub meaning: String,
}

/// A part of a page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// Heading.
    pub heading: String,
    /// Its content in reading order.
    pub blocks: Vec<Block>,
}

/// Something inside a section.
#[derive(Clone, Debug, PartialEq)]
pub enum Block {
    /// A paragraph.
    Paragraph(String),
    /// Figures side by side where there is room.
    Figures(Vec<Figure>),
    /// A table.
    Table(Table),
    /// Names and what they stand for.
    Facts(Vec<(String, String)>),
}

/// A table with notes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// What it shows.
    pub caption: String,
    /// Its columns.
    pub columns: Vec<Column>,
    /// Its rows, as long as there are columns.
    pub rows: Vec<Row>,
    /// Remarks below it.
    pub notes: Vec<String>,
}

/// The head of a column.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// How its cells are set.
    pub kind: ColumnKind,
}

/// How the cells of a column are set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnKind {
    /// Sentences, wrapped.
    Words,
    /// A name or a number that must not be broken, aligned to the right when it is a number.
    Number,
    /// A short name.
    Name,
}

/// A row of cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// The cells.
    pub cells: Vec<String>,
    /// Whether it is the row the page is about.
    pub emphasised: bool,
    /// Whether a group of rows begins with it.
    pub begins_group: bool,
}

impl Column {
    /// A column of short names.
    pub fn name(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            kind: ColumnKind::Name,
        }
    }

    /// A column of numbers.
    pub fn number(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            kind: ColumnKind::Number,
        }
    }

    /// A column of sentences.
    pub fn words(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            kind: ColumnKind::Words,
        }
    }
}

impl ColumnKind {
    fn class(self) -> &'static str {
        match self {
            Self::Words => "words",
            Self::Number => "number",
            Self::Name => "name",
        }
    }
}

impl Page {
    /// Every figure in reading order.
    pub fn figures(&self) -> impl Iterator<Item = &Figure> {
        self.sections
            .iter()
            .flat_map(|section| &section.blocks)
            .flat_map(|block| match block {
                Block::Figures(figures) => figures.as_slice(),
                _ => &[],
            })
    }

    /// The page as HTML.
    pub fn render(&self) -> String {
        let mut number = 0;
        html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    title { (clean(&self.title)) }
                    link rel="icon" href="data:,";
                    style { (PreEscaped(include_str!("page.css"))) (PreEscaped(svg::STYLE)) }
                }
                body {
                    main {
                        header {
                            h1 { (clean(&self.title)) }
                            p.lead { (clean(&self.lead)) }
                            @if !self.key_numbers.is_empty() {
                                ul.key-numbers {
                                    @for key in &self.key_numbers {
                                        li { strong { (clean(&key.value)) } " " span { (clean(&key.meaning)) } }
                                    }
                                }
                            }
                        }
                        @for section in &self.sections { (section.render(&mut number)) }
                        footer { (clean(&self.footer)) }
                    }
                }
            }
        }
        .into_string()
    }
}

impl Section {
    /// An empty section.
    pub fn new(heading: impl Into<String>) -> Self {
        Self {
            heading: heading.into(),
            blocks: Vec::new(),
        }
    }

    /// Adds a block.
    pub fn with(mut self, block: Block) -> Self {
        self.blocks.push(block);
        self
    }

    /// Adds a paragraph.
    pub fn paragraph(self, text: impl Into<String>) -> Self {
        self.with(Block::Paragraph(text.into()))
    }

    /// Adds figures.
    pub fn figures(self, figures: Vec<Figure>) -> Self {
        self.with(Block::Figures(figures))
    }

    /// `number` counts the figures of the page, whose identifiers are made of it.
    fn render(&self, number: &mut usize) -> Markup {
        html! {
            section {
                h2 { (clean(&self.heading)) }
                @for block in &self.blocks { (block.render(number)) }
            }
        }
    }
}

impl Block {
    fn render(&self, number: &mut usize) -> Markup {
        match self {
            Self::Paragraph(text) => html! { p { (clean(text)) } },
            Self::Figures(figures) => html! {
                div.figures {
                    @for figure in figures {
                        figure {
                            ({
                                *number += 1;
                                svg::inline(figure, &format!("figure-{number}"))
                            })
                        }
                    }
                }
            },
            Self::Table(table) => table.render(),
            Self::Facts(facts) => html! {
                dl {
                    @for (name, value) in facts { div { dt { (clean(name)) } dd { (clean(value)) } } }
                }
            },
        }
    }
}

impl Table {
    /// Whether it is text to be read: on a phone its cells then stand below one another.
    fn is_prose(&self) -> bool {
        let words = |column: &&Column| column.kind == ColumnKind::Words;
        self.columns.iter().filter(words).count() > 1
    }

    fn render(&self) -> Markup {
        let caption = clean(&self.caption);
        html! {
            p.caption { (caption) }
            div.table role="region" tabindex="0" aria-label=(caption) {
                table.prose[self.is_prose()] {
                    thead {
                        tr {
                            @for column in &self.columns { th scope="col" class=(column.kind.class()) { (clean(&column.name)) } }
                        }
                    }
                    tbody {
                        @for row in &self.rows {
                            tr.emphasised[row.emphasised].group[row.begins_group] {
                                @for (cell, column) in row.cells.iter().zip(&self.columns) {
                                    td class=(column.kind.class()) data-label=(clean(&column.name)) { (clean(cell)) }
                                }
                            }
                        }
                    }
                }
            }
            @for note in &self.notes { p.note { (clean(note)) } }
        }
    }
}
