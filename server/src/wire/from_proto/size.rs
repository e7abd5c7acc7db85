//! Whether a view has the size of an object: lengths in millimetres are the commonest mistake of all.

use palpate_core::geometry::Point;
use palpate_core::warning::{Warning, WarningKind};
use palpate_proto::v1;

use super::non_finite;
use crate::error::Error;
use crate::limits::SMALLEST_CLOUD_M;
use crate::session::PlausibleSize;

/// The share of the points at each end of an axis that says nothing of the size: a few may be astray.
const ASTRAY: f64 = 0.02;

/// # Errors
/// A bound that is no length, or bounds that are not in order.
pub(super) fn plausible_size(path: &str, sizes: Option<&v1::PlausibleSize>) -> Result<PlausibleSize, Error> {
    let default = PlausibleSize::default();
    let Some(&v1::PlausibleSize { min_m, max_m, refuse_above_m }) = sizes else {
        return Ok(default);
    };
    let positive = |name: &str, value: Option<f64>, default: f64| match value.unwrap_or(default) {
        value if !value.is_finite() => {
            Err(non_finite(format!("{path}.{name}"), format!("{value} is not finite")))
        }
        value if value > 0.0 => Ok(value),
        value => Err(Error::field(format!("{path}.{name}"), format!("{value} m is not above 0"))),
    };
    let sizes = PlausibleSize {
        min_m: positive("min_m", min_m, default.min_m)?,
        max_m: positive("max_m", max_m, default.max_m)?,
        refuse_above_m: positive("refuse_above_m", refuse_above_m, default.refuse_above_m)?,
    };
    if sizes.min_m >= sizes.max_m {
        let description = format!("{} m is not above min_m, {} m", sizes.max_m, sizes.min_m);
        return Err(Error::field(format!("{path}.max_m"), description));
    }
    if sizes.max_m > sizes.refuse_above_m {
        let description = format!("{} m is below max_m, {} m", sizes.refuse_above_m, sizes.max_m);
        return Err(Error::field(format!("{path}.refuse_above_m"), description));
    }
    Ok(sizes)
}

/// Refuses a view that is too small to be an object, before anything is fitted to it.
///
/// # Errors
/// Its points lie closer together than any sensor resolves.
pub(super) fn check_least_size(path: &str, points: &[Point]) -> Result<(), Error> {
    let size_m = extent_m(points);
    if size_m >= SMALLEST_CLOUD_M {
        return Ok(());
    }
    let description = format!(
        "this object would be {size_m:.1e} m across, below the limit of {SMALLEST_CLOUD_M} m: no probe can touch it; \
         send metres"
    );
    Err(Error::field(format!("{path}.points"), description))
}

/// Warns of a view that is implausibly small or large, by the longest side of its bounding box.
///
/// # Errors
/// It is larger than what is to be refused.
pub(crate) fn check_size(
    path: &str,
    points: &[Point],
    sizes: &PlausibleSize,
) -> Result<Option<Warning>, Error> {
    let PlausibleSize { min_m, max_m, refuse_above_m } = *sizes;
    let size_m = extent_m(points);
    let said = if size_m < 0.001 {
        format!("this object would be {:.2} mm across", 1000.0 * size_m)
    } else if size_m < 0.1 {
        format!("this object would be {:.1} mm across", 1000.0 * size_m)
    } else {
        format!("this object would be {size_m:.1} m across")
    };
    if size_m > refuse_above_m {
        let description = format!(
            "{said}, beyond config.plausible_size.refuse_above_m, {refuse_above_m} m: are these millimetres? Send metres"
        );
        return Err(Error::field(format!("{path}.points"), description));
    }
    let question = if size_m > max_m {
        "are these millimetres?"
    } else if size_m < min_m {
        "were metres divided by 1000?"
    } else {
        return Ok(None);
    };
    let message = format!("{said}: {question} Send metres, or set config.plausible_size");
    Ok(Some(Warning::new(WarningKind::ImplausibleSize, message).with("size_m", size_m)))
}

/// The longest side of the points' bounding box without those that may be astray, in metres.
fn extent_m(points: &[Point]) -> f64 {
    let side_m = |axis: usize| {
        let mut values: Vec<f64> = points.iter().map(|point| point[axis]).collect();
        let astray = (ASTRAY * values.len() as f64) as usize;
        let Some(last) = values.len().checked_sub(1) else { return 0.0 };
        let (_, high, _) = values.select_nth_unstable_by(last - astray, f64::total_cmp);
        let high = *high;
        let (_, low, _) = values.select_nth_unstable_by(astray, f64::total_cmp);
        high - *low
    };
    (0..3).map(side_m).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of points of this length.
    fn row(length_m: f64) -> Vec<Point> {
        (0..=100).map(|i| Point::new(0.3, length_m * f64::from(i) / 100.0 - 0.2, 0.1)).collect()
    }

    fn check(points: &[Point]) -> Result<Option<Warning>, Error> {
        check_size("prior", points, &PlausibleSize::default())
    }

    #[test]
    fn what_is_as_large_as_things_that_a_robot_touches_is_plausible() {
        for length_m in [0.006, 0.1, 0.9] {
            assert_eq!(check(&row(length_m)), Ok(None), "{length_m}");
        }
        assert!(check(&[]).unwrap().is_some());
    }

    #[test]
    fn millimetres_are_suspected_and_far_more_is_refused() {
        let message = |length_m| check(&row(length_m)).unwrap().unwrap().message;
        assert_eq!(
            message(80.0 / 0.96),
            "this object would be 80.0 m across: are these millimetres? Send metres, or set config.plausible_size"
        );
        assert!(message(0.000_08 / 0.96).starts_with("this object would be 0.08 mm across: "));
        assert!(message(0.004).contains("3.8 mm"));
        let refused = check(&row(150.0)).unwrap_err();
        assert_eq!(refused.fields()[0].field, "prior.points");
        assert!(refused.to_string().contains("refuse_above_m, 100 m"), "{refused}");
    }

    #[test]
    fn what_no_probe_can_touch_is_refused_with_the_limit() {
        assert_eq!(check_least_size("prior", &row(0.000_011 / 0.96)), Ok(()));
        for length_m in [0.000_009, 1e-9, 1e-39, 0.0] {
            let refused = check_least_size("prior", &row_at_origin(length_m)).unwrap_err();
            assert_eq!(refused.fields()[0].field, "prior.points");
            assert!(refused.to_string().contains("limit of 0.00001 m"), "{refused}");
        }
    }

    fn row_at_origin(length_m: f64) -> Vec<Point> {
        (0..=100).map(|i| Point::new(0.0, length_m * f64::from(i) / 100.0, 0.0)).collect()
    }

    #[test]
    fn two_points_of_a_hundred_may_be_astray() {
        let mut points = row(0.1);
        points[50] = Point::new(-700.0, 0.0, 0.0);
        points[51] = Point::new(0.0, 300.0, 900.0);
        assert_eq!(check(&points), Ok(None));
        points.extend([Point::new(0.0, 0.0, 5.0); 4]);
        assert!(check(&points).unwrap().is_some());
    }

    #[test]
    fn bounds_are_lengths_in_order() {
        let sizes = |min_m, max_m, refuse_above_m| {
            plausible_size("config.plausible_size", Some(&v1::PlausibleSize { min_m, max_m, refuse_above_m }))
        };
        assert_eq!(sizes(None, None, None), Ok(PlausibleSize::default()));
        assert_eq!(sizes(Some(0.1), Some(2.0), None).unwrap().max_m, 2.0);
        let field = |outcome: Result<PlausibleSize, Error>| outcome.unwrap_err().fields()[0].field.clone();
        assert_eq!(field(sizes(Some(0.0), None, None)), "config.plausible_size.min_m");
        assert_eq!(field(sizes(None, Some(-1.0), None)), "config.plausible_size.max_m");
        assert_eq!(field(sizes(None, None, Some(f64::NAN))), "config.plausible_size.refuse_above_m");
        assert_eq!(field(sizes(Some(2.0), None, None)), "config.plausible_size.max_m");
        assert_eq!(field(sizes(None, Some(200.0), None)), "config.plausible_size.refuse_above_m");
    }
}
