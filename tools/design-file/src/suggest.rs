//! What the user may have meant.

/// Below this similarity (0 to 1) a guess is worse than the list of what is known.
const SIMILAR: f64 = 0.7;

/// Names the known word nearest to `word`, or lists the known ones if none is near.
pub fn nearest(word: &str, known: &[&str]) -> String {
    let lower = word.to_lowercase();
    let similarity = |other: &&str| strsim::jaro_winkler(&lower, &other.to_lowercase());
    let best = known
        .iter()
        .max_by(|a, b| similarity(a).total_cmp(&similarity(b)));
    match best {
        Some(best) if similarity(best) >= SIMILAR => format!("did you mean {best}?"),
        _ => format!("use one of {}", known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn a_slip_is_recognised_and_a_stranger_is_not() {
        let known = ["tracked", "latency", "decay", "A"];
        assert_eq!(nearest("decy", &known), "did you mean decay?");
        assert_eq!(nearest("Latencey", &known), "did you mean latency?");
        assert_eq!(nearest("a", &known), "did you mean A?");
        assert_eq!(
            nearest("zzz", &known),
            "use one of tracked, latency, decay, A"
        );
    }
}
