//! The look of each kind of curve, the same in every figure.

use crate::figure::{Dash, Ink, Point, Series, Weight};
use ftc_simulate::Variant;

/// A signal of the loop that this variant closes.
pub fn variant(name: &str, variant: Variant, points: Vec<Point>) -> Series {
    let series = Series::new(name, points);
    match variant {
        Variant::Ftc => series.ink(Ink::Blue),
        Variant::NoFtc => series.ink(Ink::Vermilion).dash(Dash::Dashed).secondary(),
        Variant::ToldTheFault => series.ink(Ink::Green).weight(Weight::Broad),
        Variant::Additive => series.ink(Ink::Ochre).dash(Dash::Dashed).secondary(),
        Variant::Predictive => series.ink(Ink::Purple).dash(Dash::Chain).secondary(),
    }
}

/// The reference.
pub fn reference(points: Vec<Point>) -> Series {
    Series::new("reference", points)
        .ink(Ink::Text)
        .dash(Dash::Dotted)
        .step()
}

/// The fault that is really there.
pub fn true_fault(points: Vec<Point>) -> Series {
    Series::new("true fault", points)
        .ink(Ink::Ochre)
        .weight(Weight::Broad)
        .step()
}

/// What a sensor says.
pub fn measured(points: Vec<Point>) -> Series {
    Series::new("measured", points)
        .ink(Ink::Faint)
        .weight(Weight::Thin)
        .secondary()
}
