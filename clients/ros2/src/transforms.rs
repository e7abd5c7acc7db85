//! What TF said, so that a frame's pose is known at the stamp of a measurement.
//!
//! Each frame has one parent and a history of poses in it; static ones hold at any time. A lookup walks from both frames
//! to where they meet and interpolates each link at the stamp. It never extrapolates: what is not known is refused, in
//! words that say what to do, and [`LookupError::may_come`] says whether waiting helps.

use std::collections::{BTreeMap, HashMap};

use nalgebra::Isometry3;

use crate::messages::{Pose, TransformStamped, frame};

/// Why there is no transform.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LookupError {
    /// Nobody has published the frame.
    #[error(
        "TF has no frame {frame:?} (it has: {known}): is the node that publishes it running, and is the name right?"
    )]
    Unknown {
        /// The frame that was asked for.
        frame: String,
        /// Some that there are.
        known: String,
    },
    /// The frames are in two trees.
    #[error(
        "TF does not connect {target:?} (under {target_root:?}) with {from:?} (under {from_root:?}): \
         publish the transform between the two roots, for instance with static_transform_publisher"
    )]
    Disconnected {
        /// The frame to transform into.
        target: String,
        /// The top of its tree.
        target_root: String,
        /// The frame to transform from.
        from: String,
        /// The top of its tree.
        from_root: String,
    },
    /// The frames go round in a circle.
    #[error(
        "TF has a loop: {path}; two nodes publish the same frame under different parents: stop one of them"
    )]
    Loop {
        /// The frames of the circle.
        path: String,
    },
    /// The stamp is later than the last transform.
    #[error(
        "the stamp is {by_s:.3} s later than the last transform of {frame:?}: is its publisher alive, and are the clocks of \
         both machines the same?"
    )]
    TooNew {
        /// The child of the link.
        frame: String,
        /// How much later, in s.
        by_s: f64,
    },
    /// The stamp is earlier than the first transform that is kept.
    #[error(
        "the stamp is {by_s:.3} s earlier than the first transform of {frame:?} that is kept: raise tf.buffer_s, or look \
         whether the clocks of both machines are the same"
    )]
    TooOld {
        /// The child of the link.
        frame: String,
        /// How much earlier, in s.
        by_s: f64,
    },
    /// The transforms around the stamp are too far from each other.
    #[error(
        "the transforms of {frame:?} around the stamp are {gap_s:.3} s apart, and more than tf.max_gap_s is not bridged: \
         publish them more often, or raise tf.max_gap_s"
    )]
    Gap {
        /// The child of the link.
        frame: String,
        /// How far apart, in s.
        gap_s: f64,
    },
}

impl LookupError {
    /// Whether the next messages may bring what is missing.
    pub fn may_come(&self) -> bool {
        matches!(self, Self::Unknown { .. } | Self::Disconnected { .. } | Self::TooNew { .. })
    }
}

/// Where a frame is in its parent.
#[derive(Debug, Clone)]
struct Link {
    parent: String,
    poses: History,
}

#[derive(Debug, Clone)]
enum History {
    Static(Isometry3<f64>),
    Moving(BTreeMap<i64, Isometry3<f64>>),
}

/// The transforms of the last while.
#[derive(Debug, Clone)]
pub struct Transforms {
    links: HashMap<String, Link>,
    kept_ns: i64,
    longest_gap_ns: i64,
}

/// The time that asks for the latest transform, as in ROS.
pub const LATEST: i64 = 0;

impl Transforms {
    /// Keeps transforms for `kept_s` and interpolates over `longest_gap_s` at most.
    pub fn new(kept_s: f64, longest_gap_s: f64) -> Self {
        let ns = |s: f64| (s * 1e9) as i64;
        Self { links: HashMap::new(), kept_ns: ns(kept_s), longest_gap_ns: ns(longest_gap_s) }
    }

    /// Takes one transform of `/tf` or `/tf_static`.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn insert(&mut self, transform: &TransformStamped, is_static: bool) -> Result<(), String> {
        let (parent, child) = (frame(&transform.header.frame_id), frame(&transform.child_frame_id));
        if parent.is_empty() || child.is_empty() || parent == child {
            return Err(format!("frame {child:?} under {parent:?}: both need a name, and not the same"));
        }
        let pose =
            Pose { position: transform.transform.translation, orientation: transform.transform.rotation };
        let pose = pose.to_isometry().ok_or_else(|| {
            format!("frame {child:?} under {parent:?} is no pose: numbers that are none, or a quaternion that is not of length 1")
        })?;
        let stamp_ns = transform.header.stamp.as_ns();
        let kept_ns = self.kept_ns;
        let link = self
            .links
            .entry(child.to_owned())
            .or_insert_with(|| Link { parent: parent.to_owned(), poses: History::Moving(BTreeMap::new()) });
        if link.parent != parent {
            // What is grasped gets another parent: from then on its poses are in that one.
            *link = Link { parent: parent.to_owned(), poses: History::Moving(BTreeMap::new()) };
        }
        if is_static {
            link.poses = History::Static(pose);
            return Ok(());
        }
        if let History::Static(_) = link.poses {
            link.poses = History::Moving(BTreeMap::new());
        }
        if let History::Moving(poses) = &mut link.poses {
            // A recording that starts again, or a simulation: what was before is of another time.
            let newest = poses.last_key_value().map_or(i64::MIN, |(&at, _)| at);
            if newest.saturating_sub(stamp_ns) > kept_ns {
                poses.clear();
            }
            poses.insert(stamp_ns, pose);
            let newest = newest.max(stamp_ns);
            if poses.len() > 1 && poses.first_key_value().is_some_and(|(&at, _)| newest - at > kept_ns) {
                *poses = poses.split_off(&(newest - kept_ns));
            }
        }
        Ok(())
    }

    /// The pose of frame `from` in frame `target` at a stamp in ns, or at the latest common time for [`LATEST`].
    ///
    /// # Errors
    /// [`LookupError`].
    pub fn lookup(&self, target: &str, from: &str, stamp_ns: i64) -> Result<Isometry3<f64>, LookupError> {
        let (target, from) = (frame(target), frame(from));
        if target == from {
            return Ok(Isometry3::identity());
        }
        // What moves is asked for first: where nothing is known, its name says more than that of the fixed frame.
        let (up_from, up_target) = (self.path_up(from)?, self.path_up(target)?);
        let meeting = up_from.iter().find(|&frame| up_target.contains(frame)).ok_or_else(|| {
            let root = |path: &[&str]| path.last().copied().unwrap_or_default().to_owned();
            LookupError::Disconnected {
                target: target.to_owned(),
                target_root: root(&up_target),
                from: from.to_owned(),
                from_root: root(&up_from),
            }
        })?;
        let below = |path: &[&'_ str]| -> Vec<String> {
            path.iter().take_while(|frame| *frame != meeting).map(|&frame| frame.to_owned()).collect()
        };
        let (below_target, below_from) = (below(&up_target), below(&up_from));
        let stamp_ns = match stamp_ns {
            LATEST => self.latest_common(below_target.iter().chain(&below_from)),
            stamp_ns => stamp_ns,
        };
        let meeting_from_target = self.chained(&below_target, stamp_ns)?;
        let meeting_from_from = self.chained(&below_from, stamp_ns)?;
        Ok(meeting_from_target.inverse() * meeting_from_from)
    }

    /// The frame and all above it, up to the top.
    fn path_up<'a>(&'a self, from: &'a str) -> Result<Vec<&'a str>, LookupError> {
        if !self.links.contains_key(from) && !self.links.values().any(|link| link.parent == from) {
            let mut known: Vec<_> = self.links.keys().map(String::as_str).collect();
            known.sort_unstable();
            known.truncate(12);
            let known = if known.is_empty() { "none yet".to_owned() } else { known.join(", ") };
            return Err(LookupError::Unknown { frame: from.to_owned(), known });
        }
        let mut path = vec![from];
        let mut at = from;
        while let Some(link) = self.links.get(at) {
            at = &link.parent;
            if path.contains(&at) {
                path.push(at);
                return Err(LookupError::Loop { path: path.join(" -> ") });
            }
            path.push(at);
        }
        Ok(path)
    }

    /// The latest time at which all moving ones of these frames are known.
    fn latest_common<'a>(&self, frames: impl Iterator<Item = &'a String>) -> i64 {
        let newest = frames.filter_map(|frame| match &self.links.get(frame)?.poses {
            History::Moving(poses) => poses.last_key_value().map(|(&at, _)| at),
            History::Static(_) => None,
        });
        newest.min().unwrap_or(LATEST)
    }

    /// The pose of the first of these frames in the parent of the last one.
    fn chained(&self, frames: &[String], stamp_ns: i64) -> Result<Isometry3<f64>, LookupError> {
        frames.iter().try_fold(Isometry3::identity(), |top_from_source, frame| {
            // A path holds only frames that have a link.
            let link = self
                .links
                .get(frame)
                .ok_or_else(|| LookupError::Unknown { frame: frame.clone(), known: String::new() })?;
            Ok(self.sampled(frame, &link.poses, stamp_ns)? * top_from_source)
        })
    }

    fn sampled(&self, frame: &str, poses: &History, stamp_ns: i64) -> Result<Isometry3<f64>, LookupError> {
        let poses = match poses {
            History::Static(pose) => return Ok(*pose),
            History::Moving(poses) => poses,
        };
        let seconds = |ns: i64| ns as f64 * 1e-9;
        let before = poses.range(..=stamp_ns).next_back();
        let after = poses.range(stamp_ns..).next();
        match (before, after) {
            (Some((&t0, pose0)), Some((&t1, pose1))) => {
                if t1 - t0 > self.longest_gap_ns {
                    return Err(LookupError::Gap { frame: frame.to_owned(), gap_s: seconds(t1 - t0) });
                }
                let share = if t1 == t0 { 0.0 } else { (stamp_ns - t0) as f64 / (t1 - t0) as f64 };
                // Half a turn within one gap has no shortest way; the nearer end is as good.
                let nearer = if share < 0.5 { pose0 } else { pose1 };
                Ok(pose0.try_lerp_slerp(pose1, share, 1e-9).unwrap_or(*nearer))
            }
            (Some((&last, _)), None) => {
                Err(LookupError::TooNew { frame: frame.to_owned(), by_s: seconds(stamp_ns - last) })
            }
            (None, Some((&first, _))) => {
                Err(LookupError::TooOld { frame: frame.to_owned(), by_s: seconds(first - stamp_ns) })
            }
            (None, None) => Err(LookupError::TooNew { frame: frame.to_owned(), by_s: 0.0 }),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};

    use super::*;
    use crate::messages::{Header, Quaternion, Time, Transform};

    const MS: i64 = 1_000_000;

    /// `child` in `parent`, moved along x and turned about z.
    fn link(parent: &str, child: &str, stamp_ns: i64, x: f64, yaw: f64) -> TransformStamped {
        TransformStamped {
            header: Header { stamp: Time::from_ns(stamp_ns), frame_id: parent.to_owned() },
            child_frame_id: child.to_owned(),
            transform: Transform {
                translation: crate::messages::Vector3 { x, y: 0.0, z: 0.0 },
                rotation: Quaternion { x: 0.0, y: 0.0, z: (yaw / 2.0).sin(), w: (yaw / 2.0).cos() },
            },
        }
    }

    /// base -> arm (moving) -> pad (static), and base -> camera (static).
    fn scene() -> Transforms {
        let mut transforms = Transforms::new(10.0, 0.5);
        // Out of order on purpose.
        for (at, x, yaw) in [(1000, 1.0, 0.0), (1200, 3.0, 1.0), (1100, 2.0, 0.5)] {
            transforms.insert(&link("base", "/arm", at * MS, x, yaw), false).unwrap();
        }
        transforms.insert(&link("arm", "pad", 0, 0.1, 0.0), true).unwrap();
        transforms.insert(&link("/base", "camera", 0, -1.0, 0.0), true).unwrap();
        transforms
    }

    #[test]
    fn a_moving_frame_is_interpolated_along_the_chain() {
        let base_from_pad = scene().lookup("base", "pad", 1150 * MS).unwrap();
        let expected = Vector3::new(2.5 + 0.1 * 0.75_f64.cos(), 0.1 * 0.75_f64.sin(), 0.0);
        assert!((base_from_pad.translation.vector - expected).norm() < 1e-12);
        assert!((base_from_pad.rotation.angle() - 0.75).abs() < 1e-12);
    }

    #[test]
    fn a_lookup_over_the_common_parent_is_the_inverse_of_the_one_back() {
        let scene = scene();
        let there = scene.lookup("camera", "pad", 1100 * MS).unwrap();
        let back = scene.lookup("pad", "/camera", 1100 * MS).unwrap();
        let p = Point3::new(0.3, -0.2, 0.7);
        assert!((back * (there * p) - p).norm() < 1e-12);
        let arm_in_camera = scene.lookup("camera", "arm", 1100 * MS).unwrap();
        assert!((arm_in_camera.translation.vector.x - 3.0).abs() < 1e-12);
    }

    #[test]
    fn nothing_is_extrapolated_and_only_the_future_may_come() {
        let scene = scene();
        let newer = scene.lookup("base", "pad", 1250 * MS).unwrap_err();
        assert!(newer.may_come() && newer.to_string().contains("0.050 s later"), "{newer}");
        let older = scene.lookup("base", "pad", 900 * MS).unwrap_err();
        assert!(!older.may_come() && older.to_string().contains("tf.buffer_s"), "{older}");
    }

    #[test]
    fn a_gap_is_not_bridged() {
        let mut scene = scene();
        scene.insert(&link("base", "arm", 2000 * MS, 9.0, 0.0), false).unwrap();
        let gap = scene.lookup("base", "arm", 1500 * MS).unwrap_err();
        assert!(!gap.may_come() && gap.to_string().contains("tf.max_gap_s"), "{gap}");
        assert!(scene.lookup("base", "arm", 2000 * MS).is_ok());
    }

    #[test]
    fn static_frames_hold_at_any_time_and_the_latest_is_the_latest_common_one() {
        let scene = scene();
        assert!(scene.lookup("base", "camera", 77 * MS).is_ok());
        assert_eq!(scene.lookup("base", "arm", LATEST).unwrap().translation.vector.x, 3.0);
    }

    #[test]
    fn frames_that_nobody_connects_are_told_with_their_roots() {
        let mut scene = scene();
        scene.insert(&link("world", "table", 0, 0.0, 0.0), true).unwrap();
        let apart = scene.lookup("base", "table", 1100 * MS).unwrap_err();
        assert!(apart.may_come() && apart.to_string().contains("\"world\""), "{apart}");
        let unknown = scene.lookup("base", "hand", 1100 * MS).unwrap_err();
        assert!(unknown.may_come() && unknown.to_string().contains("arm, camera, pad"), "{unknown}");
    }

    #[test]
    fn loops_are_found_and_named() {
        let mut transforms = Transforms::new(10.0, 0.5);
        for (parent, child) in [("a", "b"), ("b", "c"), ("c", "a")] {
            transforms.insert(&link(parent, child, 0, 0.0, 0.0), true).unwrap();
        }
        let error = transforms.lookup("a", "c", MS).unwrap_err();
        assert!(matches!(error, LookupError::Loop { .. }) && !error.may_come(), "{error}");
        assert!(transforms.insert(&link("a", "a", 0, 0.0, 0.0), true).unwrap_err().contains("not the same"));
    }

    #[test]
    fn what_is_no_pose_is_refused() {
        let mut transforms = Transforms::new(10.0, 0.5);
        let mut wrong = link("base", "arm", MS, 0.0, 0.0);
        wrong.transform.rotation = Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 0.0 };
        assert!(transforms.insert(&wrong, false).unwrap_err().contains("\"arm\""));
        assert!(transforms.insert(&link("base", "arm", MS, f64::NAN, 0.0), false).is_err());
    }

    #[test]
    fn old_transforms_are_forgotten_and_a_time_that_starts_again_is_a_new_one() {
        let mut transforms = Transforms::new(1.0, 10.0);
        for second in 10..15 {
            transforms.insert(&link("base", "arm", second * 1000 * MS, second as f64, 0.0), false).unwrap();
        }
        assert!(matches!(
            transforms.lookup("base", "arm", 11_500 * MS).unwrap_err(),
            LookupError::TooOld { .. }
        ));
        assert!(transforms.lookup("base", "arm", 13_500 * MS).is_ok());
        transforms.insert(&link("base", "arm", 2000 * MS, 7.0, 0.0), false).unwrap();
        assert_eq!(transforms.lookup("base", "arm", LATEST).unwrap().translation.vector.x, 7.0);
    }

    #[test]
    fn a_frame_that_gets_another_parent_is_there_from_then_on() {
        let mut scene = scene();
        scene.insert(&link("camera", "pad", 1100 * MS, 5.0, 0.0), false).unwrap();
        let base_from_pad = scene.lookup("base", "pad", 1100 * MS).unwrap();
        assert!((base_from_pad.translation.vector.x - 4.0).abs() < 1e-12);
    }
}
