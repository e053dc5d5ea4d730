//! The bound no causal controller beats when the plant needs a sample to answer.

/// The least mean square error of an output that can follow its reference only `delay` samples
/// late: each sample costs the square of what the reference moved meanwhile. Before the first
/// sample the output is taken to rest at `start`.
pub fn deadbeat_bound(reference: &[f64], start: f64, delay: usize) -> f64 {
    let late = std::iter::repeat_n(start, delay).chain(reference.iter().copied());
    let sum: f64 = reference
        .iter()
        .zip(late)
        .map(|(now, late)| (now - late) * (now - late))
        .sum();
    sum / reference.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_costs_its_square_once_per_sample_of_delay() {
        let reference = [0.0, 0.0, 2.0, 2.0, 2.0];
        assert_eq!(deadbeat_bound(&reference, 0.0, 1), 4.0 / 5.0);
        assert_eq!(deadbeat_bound(&reference, 0.0, 2), 8.0 / 5.0);
        assert_eq!(deadbeat_bound(&reference, 0.0, 0), 0.0);
    }
}
