//! A [`Figure`] drawn as SVG.
//!
//! The picture is 400 units wide and scales with its place; that width keeps the lettering readable
//! from a phone to half a desktop page. Colours are CSS custom properties behind classes, with plain
//! attributes beneath for viewers that know no CSS variables. Curves are drawn in tenths of a unit
//! with relative whole-number coordinates, which keeps a page of thirty figures small.

use super::axis::Axis;
use super::decimate::{self, Point};
use super::figure::{Dash, Figure, Ink, Mark, Series, Weight};
use super::text::{clean, superscript};
use maud::{Markup, PreEscaped, html};
use std::fmt::Write as _;

/// Style rules every diagram needs, once per document.
pub const STYLE: &str = include_str!("figure.css");

const WIDTH: f64 = 400.0;
const PLOT_HEIGHT: f64 = 164.0;
const RIGHT: f64 = 14.0;
const LEGEND_ROW: f64 = 18.0;
const SWATCH: f64 = 26.0;
/// How much wider the title is set than the rest.
const BOLD: f64 = 1.28;
/// Pixel columns a curve is resolved into: nearly two per unit of width.
const COLUMNS: usize = 720;

/// A document of its own, style included.
pub fn document(figure: &Figure) -> String {
    let drawing = Drawing::new(figure, &figure.key);
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{}\n",
        drawing.render(true).into_string()
    )
}

/// A part of a page that holds [`STYLE`]; `id` is unique on that page.
pub fn inline(figure: &Figure, id: &str) -> Markup {
    Drawing::new(figure, id).render(false)
}

impl Ink {
    /// Its class and the colour for viewers without CSS variables.
    fn class_and_colour(self) -> (&'static str, &'static str) {
        match self {
            Self::Text => ("ink-text", "#1c2127"),
            Self::Faint => ("ink-faint", "#a3abb5"),
            Self::Blue => ("ink-blue", "#0069a8"),
            Self::Vermilion => ("ink-vermilion", "#c44e00"),
            Self::Green => ("ink-green", "#00996f"),
            Self::Purple => ("ink-purple", "#9b4f96"),
            Self::Ochre => ("ink-ochre", "#a66f00"),
        }
    }
}

impl Dash {
    /// Dash lengths in tenths of a unit.
    fn pattern(self) -> Option<&'static str> {
        match self {
            Self::Solid => None,
            Self::Dashed => Some("70 40"),
            Self::Dotted => Some("1 36"),
            Self::Chain => Some("90 35 1 35"),
        }
    }
}

impl Weight {
    /// Width in tenths of a unit.
    fn width(self) -> &'static str {
        match self {
            Self::Thin => "11",
            Self::Normal => "18",
            Self::Broad => "52",
        }
    }
}

/// Everything placed, ready to be written.
struct Drawing<'a> {
    figure: &'a Figure,
    id: &'a str,
    x: Axis,
    y: Axis,
    legend: Vec<Entry<'a>>,
    left: f64,
    top: f64,
}

/// A place in the legend.
struct Entry<'a> {
    name: String,
    series: Option<&'a Series>,
    x: f64,
    y: f64,
}

impl<'a> Drawing<'a> {
    fn new(figure: &'a Figure, id: &'a str) -> Self {
        let (from, until) = figure.x_range();
        let (low, high) = figure.y_range();
        let x = Axis::new(from, until, 6);
        let y = Axis::with_margin(low, high, 5);
        let widest = y
            .ticks
            .iter()
            .map(|t| width_of(&y.label(*t)))
            .fold(0.0, f64::max);
        let legend = place_legend(figure);
        let rows = legend.last().map_or(0.0, |entry| entry.y);
        Self {
            figure,
            id,
            x,
            y,
            legend,
            left: (widest + 12.0).max(34.0),
            top: rows + 32.0,
        }
    }

    fn right(&self) -> f64 {
        WIDTH - RIGHT
    }

    fn bottom(&self) -> f64 {
        self.top + PLOT_HEIGHT
    }

    fn x_at(&self, value: f64) -> f64 {
        self.left + self.x.fraction(value) * (self.right() - self.left)
    }

    fn y_at(&self, value: f64) -> f64 {
        self.bottom() - self.y.fraction(value) * PLOT_HEIGHT
    }

    fn render(&self, alone: bool) -> Markup {
        let height = self.bottom() + 40.0;
        let title = clean(&self.figure.title);
        html! {
            svg xmlns="http://www.w3.org/2000/svg" class="diagram" viewBox=(format!("0 0 {WIDTH} {height}"))
                width=[alone.then_some(WIDTH * 2.0)] role="img" aria-labelledby={ (self.id) "-title " (self.id) "-description" }
                font-family="sans-serif" font-size="12.5" {
                title id={ (self.id) "-title" } { (title) }
                desc id={ (self.id) "-description" } { (self.description()) }
                @if alone { style { (PreEscaped(STYLE)) } }
                clipPath id={ (self.id) "-clip" } {
                    rect x=(units(self.left)) y=(units(self.top)) width=(units(self.right() - self.left)) height=(units(PLOT_HEIGHT)) {}
                }
                rect class="paper" width=(WIDTH) height=(height) fill="#fff" {}
                text class="title" x="6" y="17" font-weight="600" { (fit(&title, (WIDTH - 12.0) / BOLD)) }
                (self.draw_legend())
                (self.draw_spans())
                (self.draw_axes())
                (self.draw_curves())
                (self.draw_marks())
                (self.draw_remark())
            }
        }
    }

    /// What a screen reader says after the title.
    fn description(&self) -> String {
        let names: Vec<String> = self.figure.series.iter().map(|s| clean(&s.name)).collect();
        format!(
            "{} over {}: {}.",
            clean(&self.figure.y_label),
            clean(&self.figure.x_label),
            names.join(", ")
        )
    }

    fn draw_legend(&self) -> Markup {
        html! {
            @for entry in &self.legend {
                @if let Some(series) = entry.series {
                    g transform="scale(.1)" {
                        (stroke(series, &format!("M{} {}h{}", tenths(entry.x), tenths(entry.y - 4.0), tenths(SWATCH))))
                    }
                } @else {
                    rect class="shade" x=(units(entry.x)) y=(units(entry.y - 10.0)) width=(SWATCH) height="12" fill="#f9e7da" {}
                }
                text x=(units(entry.x + SWATCH + 6.0)) y=(units(entry.y)) { (entry.name) }
            }
        }
    }

    fn draw_spans(&self) -> Markup {
        html! {
            @for spans in &self.figure.spans {
                @for [from, until] in merged(spans.intervals.iter().map(|[a, b]| [self.x_at(*a), self.x_at(*b)])) {
                    rect class="shade" x=(units(from)) y=(units(self.top)) width=(units(until - from)) height=(PLOT_HEIGHT)
                        fill="#f9e7da" clip-path={ "url(#" (self.id) "-clip)" } {}
                }
            }
        }
    }

    fn draw_axes(&self) -> Markup {
        let mut grid = String::new();
        for tick in &self.x.ticks {
            let _ = write!(
                grid,
                "M{} {}v{}",
                units(self.x_at(*tick)),
                units(self.top),
                units(PLOT_HEIGHT)
            );
        }
        for tick in &self.y.ticks {
            let _ = write!(
                grid,
                "M{} {}H{}",
                units(self.left),
                units(self.y_at(*tick)),
                units(self.right())
            );
        }
        let frame = format!(
            "M{} {}V{}H{}",
            units(self.left),
            units(self.top),
            units(self.bottom()),
            units(self.right())
        );
        html! {
            path class="grid" d=(grid) fill="none" stroke="#e4e7eb" {}
            path class="frame" d=(frame) fill="none" stroke="#59636e" {}
            @for tick in &self.x.ticks {
                text class="tick" x=(units(self.x_at(*tick))) y=(units(self.bottom() + 15.0)) text-anchor="middle" { (self.x.label(*tick)) }
            }
            @for tick in &self.y.ticks {
                text class="tick" x=(units(self.left - 6.0)) y=(units(self.y_at(*tick) + 4.0)) text-anchor="end" { (self.y.label(*tick)) }
            }
            text x=(units(self.right())) y=(units(self.bottom() + 32.0)) text-anchor="end" { (axis_label(&self.figure.x_label, &self.x)) }
            text x="6" y=(units(self.top - 9.0)) { (axis_label(&self.figure.y_label, &self.y)) }
        }
    }

    fn draw_curves(&self) -> Markup {
        html! {
            g clip-path={ "url(#" (self.id) "-clip)" } {
                g transform="scale(.1)" {
                    @for series in &self.figure.series { (stroke(series, &self.path(series))) }
                }
            }
        }
    }

    /// Path commands of a curve in tenths of a unit.
    fn path(&self, series: &Series) -> String {
        let resolved = series.points.len() <= 2 * COLUMNS;
        let mut path = String::new();
        for run in decimate::runs(&series.points, COLUMNS) {
            let corners = self.corners(&run, series.step && resolved);
            write_run(&mut path, &corners);
        }
        path
    }

    fn corners(&self, run: &[Point], step: bool) -> Vec<[i64; 2]> {
        let mut corners: Vec<[i64; 2]> = Vec::with_capacity(run.len());
        for &[x, y] in run {
            let next = [tenths(self.x_at(x)), tenths(self.y_at(y))];
            if step && let Some(&[_, level]) = corners.last() {
                corners.push([next[0], level]);
            }
            corners.push(next);
        }
        corners
    }

    fn draw_marks(&self) -> Markup {
        let placed = self.place_marks();
        html! {
            @for (x, label) in placed {
                path class="mark" d={ "M" (units(x)) " " (units(self.top)) "v" (units(PLOT_HEIGHT)) } fill="none" stroke="#59636e" stroke-dasharray="2 3" {}
                @if let Some((start, label)) = label {
                    text class="mark-label" x=(units(start)) y=(units(self.top - 5.0)) { (label) }
                }
            }
        }
    }

    /// Where each mark stands, and where its label starts if there is room for it above the frame.
    fn place_marks(&self) -> Vec<(f64, Option<(f64, String)>)> {
        let mut free = 6.0 + width_of(&axis_label(&self.figure.y_label, &self.y)) + 8.0;
        let mut last = f64::NEG_INFINITY;
        let mut placed = Vec::new();
        for Mark { at, label } in &self.figure.marks {
            let x = self.x_at(*at);
            if x - last < 2.0 {
                continue;
            }
            last = x;
            let label = fit(&clean(label), 150.0);
            let width = width_of(&label);
            let start = (x - 0.5 * width).min(self.right() - width).max(free);
            // A label keeps touching the line it belongs to.
            let fits = start <= x && start + width <= self.right() + 1.0;
            if fits {
                free = start + width + 6.0;
            }
            placed.push((x, fits.then_some((start, label))));
        }
        placed
    }

    /// Names the curves that leave the picture.
    fn draw_remark(&self) -> Markup {
        let cut: Vec<String> = self
            .figure
            .series
            .iter()
            .filter(|series| {
                let (low, high) = series.y_range();
                low < self.y.low || high > self.y.high
            })
            .map(|series| clean(&series.name))
            .collect();
        html! {
            @if !cut.is_empty() {
                text class="remark" x=(units(self.right() - 4.0)) y=(units(self.bottom() - 6.0)) text-anchor="end" {
                    (fit(&format!("{} leaves the picture", cut.join(", ")), WIDTH - 80.0))
                }
            }
        }
    }
}

/// A stroked path in tenths of a unit.
fn stroke(series: &Series, path: &str) -> Markup {
    let (class, colour) = series.ink.class_and_colour();
    let opacity = (series.weight == Weight::Broad).then_some("0.45");
    let cap = if series.dash == Dash::Solid && series.weight == Weight::Broad {
        "butt"
    } else {
        "round"
    };
    html! {
        path class=(class) d=(path) fill="none" stroke=(colour) stroke-width=(series.weight.width())
            stroke-dasharray=[series.dash.pattern()] stroke-opacity=[opacity] stroke-linecap=(cap) stroke-linejoin="round" {}
    }
}

/// Appends one run: an absolute start, then relative moves; points in line with an axis are merged.
fn write_run(path: &mut String, corners: &[[i64; 2]]) {
    let Some(&[x, y]) = corners.first() else {
        return;
    };
    let _ = write!(path, "M{x} {y}");
    let mut moves: Vec<[i64; 2]> = Vec::new();
    for pair in corners.windows(2) {
        let step = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
        match (moves.last_mut(), step) {
            (_, [0, 0]) => {}
            (Some([dx, 0]), [more, 0]) if dx.signum() == more.signum() => *dx += more,
            (Some([0, dy]), [0, more]) if dy.signum() == more.signum() => *dy += more,
            _ => moves.push(step),
        }
    }
    if moves.is_empty() {
        path.push_str("h0");
    }
    for [dx, dy] in moves {
        let _ = match (dx, dy) {
            (dx, 0) => write!(path, "h{dx}"),
            (0, dy) => write!(path, "v{dy}"),
            (dx, dy) if dy < 0 => write!(path, "l{dx}{dy}"),
            (dx, dy) => write!(path, "l{dx} {dy}"),
        };
    }
}

/// Entries from left to right, in as many rows as they need.
fn place_legend(figure: &Figure) -> Vec<Entry<'_>> {
    let curves = figure.series.iter().map(|s| (s.name.as_str(), Some(s)));
    let shades = figure.spans.iter().map(|s| (s.name.as_str(), None));
    let (mut x, mut y) = (6.0, 37.0);
    let mut entries = Vec::new();
    for (name, series) in curves.chain(shades).filter(|(name, _)| !name.is_empty()) {
        let name = fit(&clean(name), WIDTH - 60.0);
        let width = SWATCH + 6.0 + width_of(&name) + 14.0;
        if x > 6.0 && x + width > WIDTH {
            (x, y) = (6.0, y + LEGEND_ROW);
        }
        entries.push(Entry { name, series, x, y });
        x += width;
    }
    entries
}

/// Intervals less than a unit apart become one, and none is thinner than a unit.
fn merged(intervals: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut found: Vec<[f64; 2]> = Vec::new();
    for [from, until] in intervals {
        let until = until.max(from + 1.0);
        match found.last_mut() {
            Some([_, end]) if from - *end < 1.0 => *end = end.max(until),
            _ => found.push([from, until]),
        }
    }
    found
}

fn axis_label(label: &str, axis: &Axis) -> String {
    let label = fit(&clean(label), WIDTH - 80.0);
    if axis.exponent == 0 {
        label
    } else {
        format!("{label} × 10{}", superscript(axis.exponent))
    }
}

/// A generous estimate of the width of a text in the diagram's font.
fn width_of(text: &str) -> f64 {
    text.chars()
        .map(|c| match c {
            'i' | 'l' | 'j' | 't' | 'f' | 'r' | '.' | ',' | '[' | ']' | '(' | ')' | ' ' => 4.4,
            'm' | 'w' | 'M' | 'W' | '<' | '>' | '=' | '+' | '±' | '&' => 11.4,
            c if c.is_uppercase() => 8.8,
            c if (c as u32) > 0x2E80 => 13.0,
            _ => 7.7,
        })
        .sum()
}

/// As much of a text as fits into `width`, with an ellipsis where something was cut.
fn fit(text: &str, width: f64) -> String {
    if width_of(text) <= width {
        return text.to_owned();
    }
    let mut left = width - width_of("…");
    let kept: String = text
        .chars()
        .take_while(|c| {
            left -= width_of(c.encode_utf8(&mut [0; 4]));
            left >= 0.0
        })
        .collect();
    kept + "…"
}

fn tenths(value: f64) -> i64 {
    (10.0 * value).round() as i64
}

/// One decimal is finer than any screen.
fn units(value: f64) -> String {
    format!("{}", tenths(value) as f64 / 10.0)
}

#[cfg(test)]
mod tests {
    use super::{Ink, STYLE};

    /// Viewers without CSS variables, and paper, show the colours of the light page.
    #[test]
    fn a_colour_is_the_same_with_style_and_without() {
        for ink in [
            Ink::Text,
            Ink::Faint,
            Ink::Blue,
            Ink::Vermilion,
            Ink::Green,
            Ink::Purple,
            Ink::Ochre,
        ] {
            let (class, colour) = ink.class_and_colour();
            let name = class.trim_start_matches("ink-");
            let wanted = format!("--{name}:{colour}");
            assert_eq!(STYLE.matches(&wanted).count(), 2, "{wanted}");
        }
    }
}
