//! From a signal at given times to its value at each sample.

/// What a signal is between two of its times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(clippy::exhaustive_enums, reason = "as a design file names them")]
pub enum Interpolation {
    /// What it was at the earlier one.
    #[default]
    Hold,
    /// On the straight line between them.
    Linear,
}

/// The values at `0, sample_time, 2 sample_time ...` up to the last of the ascending `times`, at most
/// `most` of them. Before the first time the first value holds. A time that is a sample but for
/// rounding counts as one.
pub fn resample(
    times: &[f64],
    values: &[f64],
    sample_time: f64,
    interpolation: Interpolation,
    most: usize,
) -> Vec<f64> {
    let (Some(&last), Some(&start)) = (times.last(), values.first()) else {
        return Vec::new();
    };
    let rounding = 1e-6 * sample_time;
    let samples = ((last + rounding) / sample_time).max(0.0) as usize;
    let mut next = 0;
    (0..=samples.min(most.saturating_sub(1)))
        .map(|tick| {
            let now = tick as f64 * sample_time;
            while next < times.len() && times[next] <= now + rounding {
                next += 1;
            }
            let Some(held) = next.checked_sub(1) else {
                return start;
            };
            match (interpolation, times.get(next)) {
                (Interpolation::Linear, Some(after)) => {
                    let share = ((now - times[held]) / (after - times[held])).max(0.0);
                    values[held] + share * (values[next] - values[held])
                }
                _ => values[held],
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finer_table_is_read_at_the_samples() {
        let times: Vec<f64> = (0..100).map(|k| f64::from(k) * 0.1).collect();
        let values: Vec<f64> = (0..100).map(f64::from).collect();
        let found = resample(&times, &values, 1.0, Interpolation::Hold, 1000);
        assert_eq!(found, [0., 10., 20., 30., 40., 50., 60., 70., 80., 90.]);
    }

    #[test]
    fn a_coarser_one_is_held_or_joined_by_lines() {
        let (times, values) = ([2.0, 4.0], [1.0, 3.0]);
        let hold = resample(&times, &values, 1.0, Interpolation::Hold, 9);
        assert_eq!(hold, [1.0, 1.0, 1.0, 1.0, 3.0]);
        let linear = resample(&times, &values, 1.0, Interpolation::Linear, 9);
        assert_eq!(linear, [1.0, 1.0, 1.0, 2.0, 3.0]);
    }
}
