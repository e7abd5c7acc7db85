//! A guarded contact detector: when does a force-torque sensor feel a touch?
//!
//! The first samples are its tare. A touch begins where the force, less the tare, exceeds a threshold for some samples
//! in sequence, and ends where it falls below a lower one: noise at the threshold makes no second touch.
//! The touch is at the stamp of the first of these samples, because the pad moves on; its wrench is their mean.

use serde::Deserialize;

use crate::messages::Wrench;

/// When a force is a touch.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Thresholds {
    /// Whether the wrenches are looked at at all.
    pub enabled: bool,
    /// A touch begins above this, in N.
    pub threshold_n: f64,
    /// It ends below this, in N; lower than the threshold.
    pub release_n: f64,
    /// So many samples in sequence, at least 1.
    pub debounce_samples: u32,
    /// The mean of so many samples is the tare, at least 1.
    pub tare_samples: u32,
    /// For sensors that publish the wrench that they exert: it is turned round.
    pub invert: bool,
}

impl Default for Thresholds {
    fn default() -> Self {
        Self {
            enabled: true,
            threshold_n: 1.0,
            release_n: 0.5,
            debounce_samples: 5,
            tare_samples: 100,
            invert: false,
        }
    }
}

impl Thresholds {
    /// What is wrong with them, in words that name the parameter.
    pub(crate) fn problem(&self) -> Option<String> {
        let Self { enabled: _, threshold_n, release_n, debounce_samples, tare_samples, invert: _ } = *self;
        if !(threshold_n > 0.0 && threshold_n.is_finite()) {
            Some(format!("contact.threshold_n is {threshold_n}: give a force in N that is above 0"))
        } else if !(0.0..threshold_n).contains(&release_n) {
            Some(format!("contact.release_n is {release_n}: give 0 to less than contact.threshold_n"))
        } else if debounce_samples == 0 || tare_samples == 0 {
            Some("contact.debounce_samples and contact.tare_samples are at least 1".to_owned())
        } else {
            None
        }
    }
}

/// A touch that was felt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Stamp of the first sample above the threshold, in ns.
    pub stamp_ns: i64,
    /// Mean of the samples since, tare included; on the sensor, in its frame.
    pub wrench: Wrench,
    /// The tare.
    pub rest_wrench: Wrench,
}

/// Samples that are added up for a mean.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    parts: [f64; 6],
    count: u32,
}

impl Sum {
    fn add(&mut self, sample: [f64; 6]) {
        self.parts.iter_mut().zip(sample).for_each(|(sum, part)| *sum += part);
        self.count += 1;
    }

    fn mean(&self) -> [f64; 6] {
        self.parts.map(|part| part / f64::from(self.count.max(1)))
    }
}

/// Where the detector is: Taring -> Free -> Rising -> Pressed -> Free, and back from Rising where the force falls.
#[derive(Debug, Clone, Copy)]
enum Phase {
    Taring(Sum),
    Free,
    Rising { since_ns: i64, sum: Sum },
    Pressed,
}

/// Feels touches in a stream of wrenches.
#[derive(Debug, Clone)]
pub struct ContactDetector {
    thresholds: Thresholds,
    tare: [f64; 6],
    phase: Phase,
}

impl ContactDetector {
    /// One that begins with its tare.
    pub fn new(thresholds: Thresholds) -> Self {
        Self { thresholds, tare: [0.0; 6], phase: Phase::Taring(Sum::default()) }
    }

    /// Takes the next samples as tare; the sensor must touch nothing.
    pub fn tare(&mut self) {
        self.phase = Phase::Taring(Sum::default());
    }

    /// Whether the tare is still being taken.
    pub fn is_taring(&self) -> bool {
        matches!(self.phase, Phase::Taring(_))
    }

    /// Force beyond the tare, in N.
    fn load_n(&self, sample: [f64; 6]) -> f64 {
        (0..3).map(|axis| (sample[axis] - self.tare[axis]).powi(2)).sum::<f64>().sqrt()
    }

    /// Takes the next sample, and says so where it completes a touch. What is no number is passed over.
    pub fn sample(&mut self, stamp_ns: i64, wrench: Wrench) -> Option<Touch> {
        let sign = if self.thresholds.invert { -1.0 } else { 1.0 };
        let sample = wrench.to_array().map(|part| sign * part);
        if !sample.iter().all(|part| part.is_finite()) {
            return None;
        }
        let load_n = self.load_n(sample);
        let Thresholds { threshold_n, release_n, debounce_samples, tare_samples, .. } = self.thresholds;
        match &mut self.phase {
            Phase::Taring(sum) => {
                sum.add(sample);
                if sum.count >= tare_samples {
                    self.tare = sum.mean();
                    self.phase = Phase::Free;
                }
                None
            }
            Phase::Pressed => {
                if load_n < release_n {
                    self.phase = Phase::Free;
                }
                None
            }
            Phase::Free | Phase::Rising { .. } if load_n <= threshold_n => {
                self.phase = Phase::Free;
                None
            }
            Phase::Free => self.rise(stamp_ns, Sum::default(), sample, debounce_samples),
            Phase::Rising { since_ns, sum } => {
                let (since_ns, sum) = (*since_ns, *sum);
                self.rise(since_ns, sum, sample, debounce_samples)
            }
        }
    }

    fn rise(&mut self, since_ns: i64, mut sum: Sum, sample: [f64; 6], enough: u32) -> Option<Touch> {
        sum.add(sample);
        if sum.count < enough {
            self.phase = Phase::Rising { since_ns, sum };
            return None;
        }
        self.phase = Phase::Pressed;
        let (wrench, rest_wrench) = (Wrench::from_array(sum.mean()), Wrench::from_array(self.tare));
        Some(Touch { stamp_ns: since_ns, wrench, rest_wrench })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::Vector3;

    fn push(z: f64) -> Wrench {
        Wrench { force: Vector3 { x: 0.3, y: 0.0, z }, torque: Vector3::default() }
    }

    /// A detector whose tare is (0.3, 0, -5), and which wants three samples above 1 N.
    fn tared() -> ContactDetector {
        let thresholds = Thresholds { debounce_samples: 3, tare_samples: 4, ..Thresholds::default() };
        let mut detector = ContactDetector::new(thresholds);
        for z in [-4.9, -5.1, -4.8, -5.2] {
            assert!(detector.is_taring());
            assert_eq!(detector.sample(0, push(z)), None);
        }
        assert!(!detector.is_taring());
        detector
    }

    /// Stamps of the touches in a sequence of forces, sampled each millisecond.
    fn touches(detector: &mut ContactDetector, forces: &[f64]) -> Vec<i64> {
        let sampled = forces.iter().enumerate();
        sampled
            .filter_map(|(at, &z)| detector.sample(at as i64, push(z)))
            .map(|touch| touch.stamp_ns)
            .collect()
    }

    #[test]
    fn a_touch_is_at_its_first_sample_and_its_wrench_is_the_mean() {
        let mut detector = tared();
        assert_eq!(detector.sample(1, push(-5.5)), None);
        assert_eq!(detector.sample(2, push(-6.5)), None);
        assert_eq!(detector.sample(3, push(-7.0)), None);
        let touch = detector.sample(4, push(-7.5)).unwrap();
        assert_eq!(touch.stamp_ns, 2);
        assert!((touch.wrench.force.z + 7.0).abs() < 1e-12);
        assert!((touch.rest_wrench.force.z + 5.0).abs() < 1e-12);
        assert!((touch.rest_wrench.force.x - 0.3).abs() < 1e-12);
    }

    #[test]
    fn spikes_shorter_than_the_debounce_are_no_touch() {
        assert_eq!(touches(&mut tared(), &[-9.0, -9.0, -5.0, -9.0, -9.0, -5.0]), Vec::<i64>::new());
    }

    #[test]
    fn noise_around_the_threshold_is_one_touch_until_the_force_is_gone() {
        let held = [-6.2, -6.3, -6.2, -5.9, -6.3, -5.8, -6.4, -6.2, -6.1];
        assert_eq!(touches(&mut tared(), &held), vec![0]);
        let again = [-6.2, -6.3, -6.2, -5.2, -6.3, -6.4, -6.2];
        assert_eq!(touches(&mut tared(), &again), vec![0, 4]);
    }

    #[test]
    fn a_sideways_force_is_a_touch_too_and_what_is_no_number_is_passed_over() {
        let mut detector = tared();
        let sideways = Wrench { force: Vector3 { x: 2.3, y: 0.0, z: -5.0 }, torque: Vector3::default() };
        assert_eq!(detector.sample(1, sideways), None);
        assert_eq!(detector.sample(2, push(f64::NAN)), None);
        assert_eq!(detector.sample(3, sideways), None);
        assert_eq!(detector.sample(4, sideways).unwrap().stamp_ns, 1);
    }

    #[test]
    fn a_new_tare_forgets_the_old_one() {
        let mut detector = tared();
        detector.tare();
        assert_eq!(touches(&mut detector, &[-9.0; 10]), Vec::<i64>::new());
        assert_eq!(touches(&mut detector, &[-9.0, -11.0, -11.0, -11.0]), vec![1]);
    }

    #[test]
    fn an_inverted_sensor_gives_the_wrench_that_acts_on_it() {
        let thresholds =
            Thresholds { debounce_samples: 1, tare_samples: 1, invert: true, ..Thresholds::default() };
        let mut detector = ContactDetector::new(thresholds);
        detector.sample(0, push(0.0));
        let touch = detector.sample(1, push(2.0)).unwrap();
        assert_eq!(touch.wrench.force.z, -2.0);
    }

    #[test]
    fn thresholds_that_cannot_be_are_named() {
        let wrong = Thresholds { release_n: 2.0, ..Thresholds::default() };
        assert!(wrong.problem().unwrap().contains("contact.release_n"));
        let wrong = Thresholds { threshold_n: f64::NAN, ..Thresholds::default() };
        assert!(wrong.problem().unwrap().contains("contact.threshold_n"));
        let wrong = Thresholds { debounce_samples: 0, ..Thresholds::default() };
        assert!(wrong.problem().unwrap().contains("debounce_samples"));
        assert_eq!(Thresholds::default().problem(), None);
    }
}
