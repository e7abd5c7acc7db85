//! A limb: a part that stays on an axis of its host, the first part, such as a neck on a bottle.
//!
//! It reaches from the middle of its host out through one of its ends, and turns with it. Five
//! parameters are left to it instead of eleven, so far fewer touches are enough to tell it from the
//! body, and it cannot stick out on the other side. Most of what people make has such parts.

use super::part::{Along, Freedom, Part, Row, cycle};
use crate::geometry::Vector;

impl Part {
    /// Moved and turned to where the host holds it; a free part stays where it is.
    pub(super) fn held_by(mut self, host: &Self) -> Self {
        if let Some(along) = self.along {
            self.rotation = host.axes_with_third(along.axis);
            self.centre = host.centre + host.rotation * self.offset_on_host(along);
        }
        self
    }

    /// Its centre, seen from its host and along its host's axes.
    fn offset_on_host(&self, along: Along) -> Vector {
        let mut offset = Vector::zeros();
        offset[along.axis] = along.side * self.log_axes[2].exp();
        offset
    }

    /// What a limb is free to do: to grow along its axis with its inner end in place, to widen, and
    /// to change its exponents.
    pub(super) fn freedom(&self) -> Freedom {
        let mut freedom = Freedom::identity();
        if let Some(along) = self.along {
            for fixed in [0, 1, 2, 5, 6, 7, 8] {
                freedom[(fixed, fixed)] = 0.0;
            }
            let mut growth = Row::zeros();
            let outwards = self.rotation * Vector::z();
            growth.fixed_rows_mut::<3>(0).copy_from(&(outwards * (along.side * self.log_axes[2].exp())));
            growth[5] = 1.0;
            freedom += growth * growth.transpose() / growth.norm_squared();
        }
        freedom
    }

    /// How many parameters it has.
    pub(super) fn parameters(&self) -> f64 {
        if self.along.is_some() { 5.0 } else { 11.0 }
    }

    /// A row of derivatives by a limb's parameters as one by its host's: it is moved and turned along.
    pub(super) fn row_of_host(&self, host: &Self, row: &Row) -> Row {
        let mut of_host = Row::zeros();
        if let Some(along) = self.along {
            let by_centre: Vector = row.fixed_rows::<3>(0).into_owned();
            let mut by_rotation =
                self.offset_on_host(along).cross(&host.rotation.inverse_transform_vector(&by_centre));
            for (own, axis) in cycle(along.axis).into_iter().enumerate() {
                by_rotation[axis] += row[6 + own];
            }
            of_host.fixed_rows_mut::<3>(0).copy_from(&by_centre);
            of_host.fixed_rows_mut::<3>(6).copy_from(&by_rotation);
        }
        of_host
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    fn part(along: Option<Along>) -> Part {
        Part {
            centre: Vector::new(0.3, -0.2, 0.5),
            log_axes: Vector::new(-0.2, -0.4, 0.3),
            rotation: Rotation3::from_euler_angles(0.3, -0.5, 0.9),
            exponents: [0.6, 0.8],
            along,
        }
    }

    #[test]
    fn a_limb_reaches_from_the_middle_of_its_host_through_one_end() {
        let host = part(None);
        for (axis, side) in [(0, 1.0), (1, -1.0), (2, 1.0)] {
            let limb = part(Some(Along { axis, side })).held_by(&host);
            let out = host.rotation * Vector::from_fn(|k, _| if k == axis { side } else { 0.0 });
            assert!((limb.centre - host.centre - out * 0.3_f64.exp()).norm() < 1e-12);
            assert!(((limb.rotation * Vector::z()).dot(&out).abs() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_host_feels_what_its_limb_does() {
        let host = part(None);
        let block = [1.9, 0.4, -0.7].map(|x| [x; crate::template::samples::LANES]);
        for (axis, side) in [(0, 1.0), (1, -1.0), (2, -1.0)] {
            let limb = part(Some(Along { axis, side })).held_by(&host);
            let own = Row::from_fn(|k, _| limb.field().linearised(&block).rows[k][0]);
            let row = limb.row_of_host(&host, &own);
            let distance = |host: &Part| limb.clone().held_by(host).field().distances(&block)[0];
            for k in [0, 1, 2, 6, 7, 8] {
                let mut step = Row::zeros();
                step[k] = 1e-6;
                let difference = (distance(&host.retract(&step)) - distance(&host)) / 1e-6;
                // The derivative of the slope in the distance's denominator is left out.
                assert!((difference - row[k]).abs() < 0.3 * row.norm(), "{k}: {difference} {}", row[k]);
            }
        }
    }

    #[test]
    fn a_limb_is_free_in_five_ways_and_a_part_in_eleven() {
        let host = part(None);
        assert_eq!(host.freedom().trace(), 11.0);
        let limb = part(Some(Along { axis: 1, side: 1.0 })).held_by(&host);
        assert!((limb.freedom().trace() - limb.parameters()).abs() < 1e-12);
        let mut step = Row::zeros();
        step[5] = 1e-3;
        let grown = limb.retract(&(limb.freedom() * step));
        assert!((grown.clone().held_by(&host).centre - grown.centre).norm() < 1e-6);
    }
}
