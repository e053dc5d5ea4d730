//! Numbers and lists in words.

use ftc_design::Signal;

/// A string that is legal in XML: control characters become the replacement character.
pub fn clean(text: &str) -> String {
    text.chars()
        .map(|c| {
            let illegal = c.is_control() || matches!(c, '\u{FFFE}' | '\u{FFFF}');
            if illegal { '\u{FFFD}' } else { c }
        })
        .collect()
}

/// `name (unit)`, or the name alone where there is no unit, or a number's.
pub fn with_unit(name: &str, unit: Option<&str>) -> String {
    let unit = unit.filter(|unit| *unit != "1");
    unit.map_or_else(|| name.to_owned(), |unit| format!("{name} ({unit})"))
}

/// Values of signals with so many digits behind the point, each with its unit.
pub fn with_units(values: &[f64], signals: &[Signal], digits: usize) -> String {
    let one = |(value, signal): (&f64, &Signal)| match signal.unit.as_deref() {
        Some(unit) if unit != "1" => format!("{value:.digits$e} {unit}"),
        _ => format!("{value:.digits$e}"),
    };
    let texts: Vec<String> = values.iter().zip(signals).map(one).collect();
    texts.join(", ")
}

/// At most four significant digits, a real minus sign, and a dash for what is no number.
pub fn number(value: f64) -> String {
    let digits = significant(value);
    if digits.contains('·') {
        return digits;
    }
    trim_zeros(&digits).to_owned()
}

/// Four significant digits, also where they are zeros: for columns of like numbers.
pub fn significant(value: f64) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let magnitude = value.abs();
    let plain = if magnitude == 0.0 {
        "0".into()
    } else if (1e-3..1e6).contains(&magnitude) {
        let digits = (3 - magnitude.log10().floor() as i32).max(0) as usize;
        format!("{value:.digits$}")
    } else {
        let power = magnitude.log10().floor() as i32;
        let mantissa = value / 10f64.powi(power);
        format!("{mantissa:.3}·10{}", superscript(power))
    };
    plain.replace('-', "−")
}

/// A number with so many decimals.
pub fn aligned(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let digits = format!("{value:.decimals$}");
    let zero = !digits.contains(|c: char| ('1'..='9').contains(&c));
    digits.replace('-', if zero { "" } else { "−" })
}

/// An exponent as superscript digits.
pub fn superscript(power: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    power
        .to_string()
        .chars()
        .map(|c| c.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]))
        .collect()
}

/// `1 sample`, `2 samples`.
pub fn count(number: usize, noun: &str) -> String {
    let ending = if number == 1 { "" } else { "s" };
    format!("{number} {noun}{ending}")
}

/// `a`, `a and b`, `a, b and c`.
pub fn list(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

fn trim_zeros(text: &str) -> &str {
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_as_a_person_writes_them() {
        for (value, wanted) in [
            (0.0, "0"),
            (1.0, "1"),
            (-0.5, "−0.5"),
            (98.394_3, "98.39"),
            (123_456.0, "123456"),
            (1.5e-7, "1.500·10⁻⁷"),
            (-2e15, "−2.000·10¹⁵"),
            (f64::NAN, "–"),
        ] {
            assert_eq!(number(value), wanted);
        }
    }

    #[test]
    fn what_rounds_to_zero_has_no_sign() {
        assert_eq!(aligned(-2e-15, 3), "0.000");
        assert_eq!(aligned(-0.01, 2), "−0.01");
    }

    #[test]
    fn lists_and_counts_are_english() {
        let items: Vec<String> = ["a", "b", "c"].map(String::from).into();
        assert_eq!(list(&items), "a, b and c");
        assert_eq!(list(&items[..2]), "a and b");
        assert_eq!(count(1, "sample"), "1 sample");
        assert_eq!(count(0, "sample"), "0 samples");
    }

    #[test]
    fn control_characters_never_reach_a_page() {
        assert_eq!(clean("a\u{0}b\u{7}c\n"), "a\u{FFFD}b\u{FFFD}c\u{FFFD}");
    }
}
