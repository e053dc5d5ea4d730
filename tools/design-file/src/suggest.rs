//! What the user may have meant.

/// Below this similarity (0 to 1) a guess is worse than the list of what is known.
const SIMILAR: f64 = 0.7;

/// Names the known word nearest to `word`, or lists the known ones if none is near.
pub fn nearest(word: &str, known: &[&str]) -> String {
    match similar(word, known) {
        Some(best) => format!("did you mean {best}?"),
        None => format!("use one of {}", known.join(", ")),
    }
}

/// The known word nearest to `word`, if any is near.
pub fn similar<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    let lower = word.to_lowercase();
    let similarity = |other: &str| strsim::jaro_winkler(&lower, &other.to_lowercase());
    let rated = known.iter().map(|other| (similarity(other), *other));
    let best = rated.max_by(|(a, _), (b, _)| a.total_cmp(b))?;
    (best.0 >= SIMILAR).then_some(best.1)
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
