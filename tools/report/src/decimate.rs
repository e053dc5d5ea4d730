//! Fewer points, the same picture.

/// A point `[time, value]`.
pub type Point = [f64; 2];

/// Splits a curve into runs of finite points and keeps, where there are more than two points per
/// pixel column, only the smallest and the largest of each column (in the order they occur) besides
/// the curve's two ends. Times ascend; `columns` is the width of the picture in pixels.
pub fn runs(points: &[Point], columns: usize) -> Vec<Vec<Point>> {
    if points.len() <= 2 * columns {
        return split(points);
    }
    let finite = |point: &&Point| is_finite(point);
    let Some((first, last)) = points
        .iter()
        .find(finite)
        .zip(points.iter().rev().find(finite))
    else {
        return Vec::new();
    };
    let width = ((last[0] - first[0]) / columns as f64).max(f64::MIN_POSITIVE);
    let column = |point: &Point| ((point[0] - first[0]) / width).min(columns as f64 - 1.0) as usize;
    let mut found: Vec<Vec<Point>> = Vec::new();
    let mut open = false;
    let mut rest = points;
    while let Some(head) = rest.iter().position(is_finite) {
        // A gap that lies between two columns breaks the curve; one inside a column is narrower than a pixel.
        open &= head == 0;
        rest = &rest[head..];
        let here = column(&rest[0]);
        let length = rest
            .iter()
            .position(|point| point[0].is_finite() && column(point) != here)
            .unwrap_or(rest.len());
        let (bucket, tail) = rest.split_at(length);
        if !open {
            found.push(Vec::new());
        }
        if let Some(run) = found.last_mut() {
            run.extend(with_extremes(bucket, std::iter::empty()));
        }
        open = bucket.last().is_some_and(is_finite);
        rest = tail;
    }
    keep_ends(&mut found, *first, *last);
    found
}

/// Points up to which a curve is kept whole while it grows.
const KEPT_WHOLE: u64 = 20_000;
/// Stretches that a longer one is divided into.
const STRETCHES: u64 = 4_096;

/// A curve that grows point by point. Where it will have more than [`KEPT_WHOLE`] points, of each of
/// [`STRETCHES`] stretches only the ends, the smallest and the largest are kept.
#[derive(Clone, Debug)]
pub struct Thinned {
    /// Points of a stretch; 1 where all are kept.
    stretch: usize,
    kept: Vec<Point>,
    /// The present stretch.
    present: Vec<Point>,
}

impl Thinned {
    /// A curve that will have so many points.
    pub fn new(points: u64) -> Self {
        let stretch = match points > KEPT_WHOLE {
            true => points.div_ceil(STRETCHES),
            false => 1,
        };
        Self {
            stretch: stretch as usize,
            kept: Vec::new(),
            present: Vec::new(),
        }
    }

    /// Adds a point.
    pub fn push(&mut self, point: Point) {
        if self.stretch == 1 {
            self.kept.push(point);
            return;
        }
        self.present.push(point);
        if self.present.len() == self.stretch {
            self.kept.extend(outline(&self.present));
            self.present.clear();
        }
    }

    /// The curve so far.
    pub fn points(&self) -> Vec<Point> {
        let mut points = self.kept.clone();
        points.extend(outline(&self.present));
        points
    }
}

/// Both ends of a stretch (a gap there remains a gap), its smallest and its largest finite point.
fn outline(stretch: &[Point]) -> impl Iterator<Item = Point> {
    let ends = (!stretch.is_empty()).then(|| [0, stretch.len() - 1]);
    with_extremes(stretch, ends.into_iter().flatten())
}

fn is_finite(point: &Point) -> bool {
    point.iter().all(|value| value.is_finite())
}

fn split(points: &[Point]) -> Vec<Vec<Point>> {
    points
        .split(|point| !is_finite(point))
        .filter(|run| !run.is_empty())
        .map(<[Point]>::to_vec)
        .collect()
}

/// The points at these positions, the smallest and the largest finite one, in the order they occur, each once.
fn with_extremes(
    points: &[Point],
    positions: impl Iterator<Item = usize>,
) -> impl Iterator<Item = Point> {
    let by_value = |a: &usize, b: &usize| points[*a][1].total_cmp(&points[*b][1]);
    let finite = || (0..points.len()).filter(|&at| is_finite(&points[at]));
    let (low, high) = (finite().min_by(by_value), finite().max_by(by_value));
    let mut kept: Vec<usize> = positions.chain(low).chain(high).collect();
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|at| points[at])
}

fn keep_ends(found: &mut [Vec<Point>], first: Point, last: Point) {
    if let Some(run) = found.first_mut()
        && run.first() != Some(&first)
    {
        run.insert(0, first);
    }
    if let Some(run) = found.last_mut()
        && run.last() != Some(&last)
    {
        run.push(last);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn curve() -> impl Strategy<Value = Vec<Point>> {
        let value = prop_oneof![9 => -1e3..1e3f64, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY)];
        prop::collection::vec(value, 0..4000).prop_map(|values| {
            values
                .into_iter()
                .enumerate()
                .map(|(k, v)| [k as f64, v])
                .collect()
        })
    }

    fn range(points: impl Iterator<Item = Point>) -> Option<(f64, f64)> {
        points.filter(is_finite).fold(None, |range, [_, value]| {
            let (low, high) = range.unwrap_or((value, value));
            Some((low.min(value), high.max(value)))
        })
    }

    proptest! {
        #[test]
        fn extremes_survive_and_the_size_is_bounded(points in curve(), columns in 1..400usize) {
            let runs = runs(&points, columns);
            let kept: Vec<Point> = runs.iter().flatten().copied().collect();
            prop_assert!(kept.len() <= 2 * columns + 2);
            prop_assert!(kept.iter().all(is_finite));
            prop_assert!(kept.windows(2).all(|pair| pair[0][0] < pair[1][0]));
            prop_assert!(kept.iter().all(|point| points.contains(point)));
            prop_assert_eq!(range(kept.iter().copied()), range(points.iter().copied()));
        }

        #[test]
        fn extremes_survive_in_every_column(points in curve()) {
            let columns = 50;
            let kept: Vec<Point> = runs(&points, columns).concat();
            let finite: Vec<&Point> = points.iter().filter(|point| is_finite(point)).collect();
            if let [first, .., last] = finite[..] {
                let width = (last[0] - first[0]) / columns as f64;
                let column = |point: &Point| ((point[0] - first[0]) / width).min(columns as f64 - 1.0) as usize;
                for index in 0..columns {
                    let inside = |points: &[Point]| range(points.iter().filter(|p| is_finite(p) && column(p) == index).copied());
                    prop_assert_eq!(inside(&kept), inside(&points));
                }
            }
        }
    }

    #[test]
    fn a_curve_thinned_while_it_grows_looks_the_same() {
        let value = |k: u64| match k {
            300_000..320_000 => f64::NAN,
            412_345 => 7.0,
            999_999 => -9.0,
            k => (k as f64 * 1e-4).sin(),
        };
        let points: Vec<Point> = (0..1_000_000).map(|k| [k as f64, value(k)]).collect();
        let mut thinned = Thinned::new(1_000_000);
        points.iter().for_each(|&point| thinned.push(point));
        let kept = thinned.points();
        assert!(kept.len() <= 4 * (STRETCHES as usize + 1), "{}", kept.len());
        let (found, wanted) = (runs(&kept, 500), runs(&points, 500));
        assert_eq!(found.len(), wanted.len());
        for (found, wanted) in found.iter().zip(&wanted) {
            assert_eq!(
                (range(found.iter().copied()), found.first(), found.last()),
                (range(wanted.iter().copied()), wanted.first(), wanted.last())
            );
        }
        let mut short = Thinned::new(20_000);
        points[..20_000].iter().for_each(|&point| short.push(point));
        assert_eq!(short.points(), points[..20_000]);
    }

    #[test]
    fn a_long_gap_stays_a_gap() {
        let points: Vec<Point> = (0..10_000)
            .map(|k| {
                [
                    k as f64,
                    if (4000..6000).contains(&k) {
                        f64::NAN
                    } else {
                        1.0
                    },
                ]
            })
            .collect();
        let runs = runs(&points, 100);
        assert_eq!(runs.len(), 2);
        assert!(runs[0].iter().all(|p| p[0] < 4000.0) && runs[1].iter().all(|p| p[0] >= 6000.0));
    }

    #[test]
    fn a_short_curve_is_kept_as_it_is() {
        let points = vec![[0.0, 1.0], [1.0, f64::NAN], [2.0, 3.0], [3.0, 4.0]];
        assert_eq!(
            runs(&points, 100),
            [vec![[0.0, 1.0]], vec![[2.0, 3.0], [3.0, 4.0]]]
        );
    }
}
