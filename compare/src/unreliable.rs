//! Points of which too few samples count.

use crate::select::in_order;
use record::Point;

/// So many of them are named.
const NAMED: usize = 5;

/// Whether too few samples of a point count, so that its rates are hearsay.
pub fn unreliable(point: &Point) -> bool {
    point.measurement.as_ref().is_some_and(|measurement| measurement.unreliable)
}

/// A sentence with a space before it that names the unreliable ones of some things with a point; nothing where all
/// are sound.
pub fn sentence<'r, T>(
    all: impl IntoIterator<Item = T>,
    point: impl Fn(&T) -> &'r Point,
    name: impl Fn(&T) -> String,
) -> String {
    let names = all.into_iter().filter(|one| unreliable(point(one))).map(|one| name(&one));
    let names = in_order(names);
    let more = match names.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let named = names.iter().take(NAMED).map(String::as_str).collect::<Vec<_>>().join("; ");
    if names.is_empty() {
        String::new()
    } else {
        format!(" Unreliable, because too few samples count: {named}{more}.")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::example;

    #[test]
    fn unreliable_points_are_named_once_and_not_all() {
        let mut point = example().results.swap_remove(0);
        let told = |points: &[Point]| sentence(points.iter(), |point| point, |point| point.variant.clone());
        assert_eq!(told(std::slice::from_ref(&point)), "");
        point.measurement.get_or_insert_with(measurement).unreliable = true;
        assert_eq!(
            told(&[point.clone(), point.clone()]),
            " Unreliable, because too few samples count: Binary."
        );
        let many: Vec<Point> =
            (0..7).map(|at| Point { variant: format!("V{at}"), ..point.clone() }).collect();
        assert!(told(&many).ends_with(": V0; V1; V2; V3; V4 and 2 more."), "{}", told(&many));
    }

    fn measurement() -> record::Measurement {
        let now = record::Timestamp::from(std::time::UNIX_EPOCH);
        record::Measurement {
            part: 0,
            position: 0,
            started: now,
            finished: now,
            stopped: record::Stop::Precise,
            unreliable: false,
            verdict: None,
        }
    }
}
