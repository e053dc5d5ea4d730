//! What a figure shows, before anything is drawn.
#![expect(
    clippy::exhaustive_structs,
    clippy::exhaustive_enums,
    reason = "what a page can draw, for the programs of this workspace"
)]

pub use super::decimate::Point;

/// One diagram over time (or any other ascending abscissa).
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Name of its file and anchor: lower-case letters, digits and hyphens.
    pub key: String,
    /// Title above the diagram.
    pub title: String,
    /// Label of the abscissa, with its unit.
    pub x_label: String,
    /// Label of the ordinate, with its unit.
    pub y_label: String,
    /// Curves; later ones are drawn over earlier ones.
    pub series: Vec<Series>,
    /// Shaded intervals of the abscissa, and what they mean.
    pub spans: Vec<Spans>,
    /// Vertical lines with a few words each.
    pub marks: Vec<Mark>,
}

/// One curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// `[x, y]`, `x` ascending; a point that is not finite leaves a gap.
    pub points: Vec<Point>,
    /// Colour.
    pub ink: Ink,
    /// Pattern, so that curves differ without colour as well.
    pub dash: Dash,
    /// Line width.
    pub weight: Weight,
    /// Whether each value holds until the next.
    pub step: bool,
    /// Whether the ordinate must cover the whole curve. A curve that need not is cut off where it
    /// would flatten all others, and the figure says so.
    pub leading: bool,
}

/// Colours that people with any colour vision tell apart, each in a light and a dark shade.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// The colour of the text.
    Text,
    /// Grey, for what should stay in the background.
    Faint,
    /// Blue.
    Blue,
    /// Vermilion.
    Vermilion,
    /// Bluish green.
    Green,
    /// Reddish purple.
    Purple,
    /// Ochre.
    Ochre,
}

/// The pattern of a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dash {
    /// Uninterrupted.
    #[default]
    Solid,
    /// Long dashes.
    Dashed,
    /// Dots.
    Dotted,
    /// Dash and dot in turn.
    Chain,
}

/// The width of a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Weight {
    /// A thin line.
    Thin,
    /// A line.
    #[default]
    Normal,
    /// A translucent band for another curve to lie on.
    Broad,
}

/// Shaded intervals with one meaning.
#[derive(Clone, Debug, PartialEq)]
pub struct Spans {
    /// Name in the legend.
    pub name: String,
    /// `[from, until]`, ascending.
    pub intervals: Vec<[f64; 2]>,
}

/// A vertical line.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Where.
    pub at: f64,
    /// What happens there.
    pub label: String,
}

impl Figure {
    /// An empty diagram.
    pub fn new(
        key: impl Into<String>,
        title: impl Into<String>,
        x_label: impl Into<String>,
        y_label: impl Into<String>,
    ) -> Self {
        Self {
            key: key.into(),
            title: title.into(),
            x_label: x_label.into(),
            y_label: y_label.into(),
            series: Vec::new(),
            spans: Vec::new(),
            marks: Vec::new(),
        }
    }

    /// Draws a curve over those already there.
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Shades intervals; none at all leave no entry in the legend.
    pub fn shade(mut self, name: &str, intervals: Vec<[f64; 2]>) -> Self {
        if !intervals.is_empty() {
            self.spans.push(Spans {
                name: name.into(),
                intervals,
            });
        }
        self
    }

    /// Draws vertical lines.
    pub fn mark(mut self, marks: &[Mark]) -> Self {
        self.marks.extend_from_slice(marks);
        self
    }

    /// The interval of the abscissa covered by the curves.
    pub(super) fn x_range(&self) -> (f64, f64) {
        range(self.series.iter(), 0)
    }

    /// The interval of the ordinate to show: all leading curves, and the others as far as they leave
    /// the leading ones at least a fifth of the height.
    pub(super) fn y_range(&self) -> (f64, f64) {
        let (low, high) = range(self.series.iter().filter(|s| s.leading), 1);
        let (lowest, highest) = range(self.series.iter(), 1);
        let room = 2.0 * (high - low);
        if room > 0.0 && room.is_finite() {
            (lowest.max(low - room), highest.min(high + room))
        } else {
            (lowest, highest)
        }
    }
}

impl Series {
    /// A solid blue line.
    pub fn new(name: impl Into<String>, points: Vec<Point>) -> Self {
        Self {
            name: name.into(),
            points,
            ink: Ink::Blue,
            dash: Dash::Solid,
            weight: Weight::Normal,
            step: false,
            leading: true,
        }
    }

    /// In another colour.
    pub fn ink(self, ink: Ink) -> Self {
        Self { ink, ..self }
    }

    /// In another pattern.
    pub fn dash(self, dash: Dash) -> Self {
        Self { dash, ..self }
    }

    /// In another width.
    pub fn weight(self, weight: Weight) -> Self {
        Self { weight, ..self }
    }

    /// Each value holds until the next.
    pub fn step(self) -> Self {
        Self { step: true, ..self }
    }

    /// Does not widen the range of the ordinate.
    pub fn secondary(self) -> Self {
        Self {
            leading: false,
            ..self
        }
    }

    /// Smallest and largest finite ordinate; infinity and minus infinity when there is none.
    pub(super) fn y_range(&self) -> (f64, f64) {
        range(std::iter::once(self), 1)
    }
}

fn range<'a>(series: impl Iterator<Item = &'a Series>, coordinate: usize) -> (f64, f64) {
    series
        .flat_map(|series| &series.points)
        .filter(|point| point.iter().all(|value| value.is_finite()))
        .map(|point| point[coordinate])
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        })
}
