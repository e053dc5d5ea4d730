//! SI meaning of the units that control engineers write most.
//!
//! A unit that is not listed is declared by name only, which the standard allows; tools then
//! check that connected names agree but cannot convert.

/// The SI base units in which a meaning is expressed.
#[cfg(feature = "xml")]
pub(crate) const BASE: [&str; 6] = ["kg", "m", "s", "A", "K", "rad"];

/// A unit in SI: `SI value = factor * value + offset`, in these powers of the base units.
#[cfg(feature = "xml")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Meaning {
    pub exponents: [i8; 6],
    pub factor: f64,
    pub offset: f64,
}

/// Display units: `display = factor * unit`.
const DISPLAYS: [(&str, &str, f64); 4] = [
    ("rad", "deg", 180.0 / std::f64::consts::PI),
    ("rad/s", "rpm", 30.0 / std::f64::consts::PI),
    ("s", "ms", 1e3),
    ("Pa", "bar", 1e-5),
];

/// What a unit means in SI base units, if it is a known one.
#[cfg(feature = "xml")]
pub(crate) fn meaning(unit: &str) -> Option<Meaning> {
    let (exponents, factor) = match unit {
        "1" => ([0, 0, 0, 0, 0, 0], 1.0),
        "%" => ([0, 0, 0, 0, 0, 0], 0.01),
        "kg" => ([1, 0, 0, 0, 0, 0], 1.0),
        "m" => ([0, 1, 0, 0, 0, 0], 1.0),
        "mm" => ([0, 1, 0, 0, 0, 0], 1e-3),
        "s" => ([0, 0, 1, 0, 0, 0], 1.0),
        "min" => ([0, 0, 1, 0, 0, 0], 60.0),
        "h" => ([0, 0, 1, 0, 0, 0], 3600.0),
        "ms" => ([0, 0, 1, 0, 0, 0], 1e-3),
        "A" => ([0, 0, 0, 1, 0, 0], 1.0),
        "mA" => ([0, 0, 0, 1, 0, 0], 1e-3),
        "K" | "degC" => ([0, 0, 0, 0, 1, 0], 1.0),
        "deg" => ([0, 0, 0, 0, 0, 1], std::f64::consts::PI / 180.0),
        "rpm" => ([0, 0, -1, 0, 0, 1], std::f64::consts::PI / 30.0),
        "rad" => ([0, 0, 0, 0, 0, 1], 1.0),
        "rad/s" => ([0, 0, -1, 0, 0, 1], 1.0),
        "Hz" => ([0, 0, -1, 0, 0, 0], 1.0),
        "m/s" => ([0, 1, -1, 0, 0, 0], 1.0),
        "m/s2" => ([0, 1, -2, 0, 0, 0], 1.0),
        "m3/s" => ([0, 3, -1, 0, 0, 0], 1.0),
        "N" => ([1, 1, -2, 0, 0, 0], 1.0),
        "N.m" => ([1, 2, -2, 0, 0, 0], 1.0),
        "Pa" => ([1, -1, -2, 0, 0, 0], 1.0),
        "bar" => ([1, -1, -2, 0, 0, 0], 1e5),
        "J" => ([1, 2, -2, 0, 0, 0], 1.0),
        "W" => ([1, 2, -3, 0, 0, 0], 1.0),
        "kW" => ([1, 2, -3, 0, 0, 0], 1e3),
        "V" => ([1, 2, -3, -1, 0, 0], 1.0),
        "kV" => ([1, 2, -3, -1, 0, 0], 1e3),
        "Ohm" => ([1, 2, -3, -2, 0, 0], 1.0),
        "degF" => ([0, 0, 0, 0, 1, 0], 5.0 / 9.0),
        _ => return None,
    };
    let offset = match unit {
        "degC" => 273.15,
        "degF" => 273.15 - 32.0 * 5.0 / 9.0,
        _ => 0.0,
    };
    Some(Meaning {
        exponents,
        factor,
        offset,
    })
}

/// The unit in which a person would rather read this one.
pub(crate) fn display_unit(unit: &str) -> Option<&'static str> {
    DISPLAYS
        .iter()
        .find(|(of, ..)| *of == unit)
        .map(|(_, display, _)| *display)
}

/// `display = factor * unit`.
#[cfg(feature = "xml")]
pub(crate) fn display_factor(unit: &str, display: &str) -> f64 {
    DISPLAYS
        .iter()
        .find(|(of, name, _)| *of == unit && *name == display)
        .map_or(1.0, |(.., factor)| *factor)
}
