//! Coordinate frames that are attached to one another (ROS tf), each with its motion over time.

use std::collections::HashMap;

use super::contents::Link;
use shutterbug::camera::Pose;

/// Most frames between one and the root.
const MAX_LINKS: usize = 1000;

/// A frame in its parent.
#[derive(Clone, Debug, Default)]
struct Branch {
    parent: String,
    /// It rests, whatever its stamp.
    rests: bool,
    /// At increasing times, ns.
    samples: Vec<(i64, Pose)>,
}

impl Branch {
    /// The pose at a time; nothing outside what is known.
    fn at(&self, ns: i64) -> Option<Pose> {
        if self.rests {
            return self.samples.last().map(|(_, pose)| *pose);
        }
        let next = self.samples.partition_point(|(t, _)| *t < ns);
        let (to, pose) = self.samples.get(next)?;
        if *to == ns {
            return Some(*pose);
        }
        let (from, before) = self.samples.get(next.checked_sub(1)?)?;
        let share =
            (i128::from(ns) - i128::from(*from)) as f64 / (i128::from(*to) - i128::from(*from)) as f64;
        Some(before.interpolate(pose, share))
    }
}

/// All frames, by name.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    branches: HashMap<String, Branch>,
    /// Links that hang a frame on a second parent.
    pub(super) contradictions: usize,
}

impl Tree {
    /// Adds what a message says. `rests`: of /tf_static.
    pub(super) fn add(&mut self, link: Link, rests: bool) {
        let branch = self.branches.entry(link.child).or_default();
        if branch.samples.is_empty() {
            branch.parent = link.parent;
        } else if branch.parent != link.parent {
            self.contradictions += 1;
            return;
        }
        branch.rests |= rests;
        branch.samples.push((link.stamp_ns, link.pose));
    }

    /// Sorts what was added; of two samples of one time the later one counts.
    pub(super) fn finish(&mut self) {
        for branch in self.branches.values_mut() {
            if branch.rests {
                branch.samples.drain(..branch.samples.len() - 1);
                continue;
            }
            branch.samples.reverse();
            branch.samples.sort_by_key(|(t, _)| *t);
            branch.samples.dedup_by_key(|(t, _)| *t);
        }
    }

    /// Names of all frames, sorted.
    pub(super) fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> =
            self.branches.iter().flat_map(|(child, b)| [child.as_str(), b.parent.as_str()]).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// The frame and those that it hangs on, up to the root; circles end.
    fn chain<'a>(&'a self, frame: &'a str) -> Vec<&'a str> {
        let mut chain = vec![frame];
        while let Some(branch) = self.branches.get(*chain.last().expect("begins with one")) {
            if chain.len() > MAX_LINKS || chain.contains(&branch.parent.as_str()) {
                break;
            }
            chain.push(&branch.parent);
        }
        chain
    }

    /// The frame that all others of this one's tree hang on; itself if it hangs on none.
    pub(super) fn root<'a>(&'a self, frame: &'a str) -> &'a str {
        self.chain(frame).last().expect("begins with one")
    }

    /// The frames whose links lead from one to the other: those up from each to where they meet. Nothing if they do
    /// not.
    fn way<'a>(&'a self, from: &'a str, to: &'a str) -> Option<[Vec<&'a str>; 2]> {
        let (up, down) = (self.chain(from), self.chain(to));
        let meeting = up.iter().position(|f| down.contains(f))?;
        let other = down.iter().position(|f| *f == up[meeting])?;
        Some([up[..meeting].to_vec(), down[..other].to_vec()])
    }

    /// Whether there is a way from one frame to another.
    pub(super) fn joins(&self, a: &str, b: &str) -> bool {
        self.way(a, b).is_some()
    }

    /// `to` from `frame` at a time; nothing without a way, or outside what is known.
    pub(super) fn pose(&self, to: &str, frame: &str, ns: i64) -> Option<Pose> {
        let [up, down] = self.way(to, frame)?;
        let product = |names: &[&str]| {
            names.iter().try_fold(Pose::IDENTITY, |pose, name| {
                Some(self.branches.get(*name)?.at(ns)?.then_from(&pose))
            })
        };
        Some(product(&up)?.inverse().then_from(&product(&down)?))
    }

    /// Stamps of all links between two frames that move; empty where all rest.
    pub(super) fn stamps(&self, a: &str, b: &str) -> Vec<i64> {
        let Some(way) = self.way(a, b) else { return Vec::new() };
        let moving = way.iter().flatten().filter_map(|f| self.branches.get(*f)).filter(|b| !b.rests);
        let mut stamps: Vec<i64> = moving.flat_map(|b| b.samples.iter().map(|(t, _)| *t)).collect();
        stamps.sort_unstable();
        stamps.dedup();
        stamps
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;

    fn link(ns: i64, parent: &str, child: &str, x: f64, turn: f64) -> Link {
        let pose = Pose { rotation: DQuat::from_rotation_z(turn), translation_m: DVec3::new(x, 0.0, 0.0) };
        Link { stamp_ns: ns, parent: parent.to_owned(), child: child.to_owned(), pose }
    }

    #[test]
    fn poses_follow_the_links_up_and_down() {
        let mut tree = Tree::default();
        tree.add(link(5, "base", "camera", 0.5, 0.0), true);
        tree.add(link(300, "map", "base", 3.0, 0.0), false);
        tree.add(link(100, "map", "base", 1.0, std::f64::consts::FRAC_PI_2), false);
        tree.add(link(0, "map", "mark", 7.0, 0.0), true);
        tree.finish();
        // Half way: x = 2, turned by 45 degrees; the camera is 0.5 before the base.
        let pose = tree.pose("map", "camera", 200).expect("known");
        let lever = 0.5 * std::f64::consts::FRAC_1_SQRT_2;
        assert!((pose.translation_m - DVec3::new(2.0 + lever, lever, 0.0)).length() < 1e-12, "{pose:?}");
        // From a frame of another branch: up and down.
        let seen = tree.pose("mark", "camera", 300).expect("known");
        assert!((seen.translation_m.x - (3.5 - 7.0)).abs() < 1e-12);
        assert_eq!(tree.pose("map", "camera", 99), None, "never extrapolated");
        assert_eq!(tree.pose("map", "nothing", 200), None);
        assert_eq!((tree.root("camera"), tree.stamps("map", "camera")), ("map", vec![100, 300]));
        assert!(tree.stamps("mark", "map").is_empty());
    }

    #[test]
    fn circles_end_and_second_parents_are_counted() {
        let mut tree = Tree::default();
        tree.add(link(0, "a", "b", 1.0, 0.0), true);
        tree.add(link(0, "b", "a", 1.0, 0.0), true);
        tree.add(link(0, "c", "b", 1.0, 0.0), true);
        tree.finish();
        assert_eq!((tree.contradictions, tree.root("b")), (1, "a"));
        assert!(!tree.joins("a", "c"));
    }
}
