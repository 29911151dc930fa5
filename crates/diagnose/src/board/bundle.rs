//! A camera and the poses of all views, fitted together (Levenberg-Marquardt on the distances between points as seen
//! and as predicted, weighed after Huber so that a wrong point does not decide).

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use nalgebra::{DMatrix, DVector};

use super::motion::BoardPath;
use super::solve::{Block, OWN, Step, covariance, step};
use shutterbug::camera::{Distortion, Intrinsics, Pose};
use shutterbug::error::Result;

/// What the views share, in this order: focal lengths and principal point, px; lens; readout along rows and along
/// columns, s.
pub const PARAMETERS: [&str; 11] =
    ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "readout_rows_s", "readout_columns_s"];
const COUNT: usize = PARAMETERS.len();
const READOUT: usize = 9;
/// Residuals beyond so many standard deviations count by their size instead of their square: 95 % as efficient as least
/// squares where all errors are normal (Huber).
const HUBER: f64 = 1.345;
/// Most steps, and the relative fall of the cost below which it has come to an end.
const MOST_STEPS: usize = 100;
const CONVERGED: f64 = 1e-10;

/// A camera as a vector: see [`PARAMETERS`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Columns and rows of its pictures, px.
    pub size: [u32; 2],
    /// Values of [`PARAMETERS`].
    pub values: [f64; COUNT],
}

impl Camera {
    /// A pinhole with its principal point in the middle.
    pub(super) fn pinhole(size: [u32; 2], focal_px: [f64; 2]) -> Self {
        let mut values = [0.0; COUNT];
        values[..2].copy_from_slice(&focal_px);
        (values[2], values[3]) = (0.5 * f64::from(size[0]), 0.5 * f64::from(size[1]));
        Self { size, values }
    }

    /// Size and pinhole.
    pub fn intrinsics(&self) -> Intrinsics {
        let [fx, fy, cx, cy] = [0, 1, 2, 3].map(|i| self.values[i]);
        Intrinsics { width: self.size[0], height: self.size[1], fx, fy, cx, cy }
    }

    /// The lens.
    pub fn lens(&self) -> Distortion {
        let v = &self.values;
        Distortion::BrownConrady { k: [v[4], v[5], v[8]], p: [v[6], v[7]] }
    }

    /// A value by its name in [`PARAMETERS`]; 0 for another name.
    pub fn get(&self, name: &str) -> f64 {
        PARAMETERS.iter().position(|p| *p == name).map_or(0.0, |i| self.values[i])
    }

    /// Where a point in front of the camera falls, px.
    pub fn project(&self, point_m: DVec3) -> Option<DVec2> {
        let ideal = point_m.truncate() / point_m.z;
        let k = self.intrinsics();
        let at = self.lens().distort(ideal);
        (point_m.z > 0.0).then(|| DVec2::new(k.fx * at.x + k.cx, k.fy * at.y + k.cy))
    }

    /// How late the line of a place is read, s after the frame's start.
    pub fn late_s(&self, px: DVec2) -> f64 {
        let [w, h] = self.size.map(f64::from);
        self.values[READOUT] * px.y / h + self.values[READOUT + 1] * px.x / w
    }
}

/// A point as seen, and where it is on the board.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub on_board_m: DVec3,
    pub px: DVec2,
}

/// A fit under way.
#[derive(Clone, Debug)]
pub(super) struct Bundle {
    pub camera: Camera,
    /// Camera from board, at each frame's start.
    pub poses: Vec<Pose>,
    /// By view.
    pub points: Vec<Vec<Point>>,
    /// Of a board that moves: when each frame began, s.
    pub starts_s: Option<Vec<f64>>,
}

/// A prediction and what it depends on.
struct Predicted {
    residual: DVec2,
    /// By axis: derivatives by the shared parameters and by rotation and translation of the pose.
    by_shared: [[f64; COUNT]; 2],
    by_own: [[f64; OWN]; 2],
}

impl Bundle {
    fn path(&self) -> Result<Option<BoardPath>> {
        self.starts_s.as_deref().map(|s| BoardPath::new(s, &self.poses)).transpose()
    }

    /// Number of residuals.
    pub(super) fn residual_count(&self) -> usize {
        2 * self.points.iter().map(Vec::len).sum::<usize>()
    }

    /// Seen minus predicted, px, by view; points behind the camera are infinitely far off.
    pub(super) fn residuals(&self) -> Result<Vec<Vec<DVec2>>> {
        let path = self.path()?;
        let of = |view: usize| {
            let pose = &self.poses[view];
            let residual = |p: &Point| {
                let moved = path
                    .as_ref()
                    .map_or(*pose, |path| path.since(view, self.camera.late_s(p.px)).0.then_from(pose));
                let at = self.camera.project(moved.transform(p.on_board_m));
                at.map_or(DVec2::INFINITY, |at| p.px - at)
            };
            self.points[view].iter().map(residual).collect()
        };
        Ok((0..self.points.len()).map(of).collect())
    }

    /// Standard deviation of a coordinate from the median of their sizes, which wrong points do not move.
    pub(super) fn spread_px(&self) -> Result<f64> {
        let mut sizes: Vec<f64> =
            self.residuals()?.iter().flatten().flat_map(|r| [r.x.abs(), r.y.abs()]).collect();
        sizes.sort_by(f64::total_cmp);
        Ok(sizes.get(sizes.len() / 2).map_or(0.0, |m| m / 0.6745).max(1e-9))
    }

    /// Huber's cost, twice: the sum of squares over the variance where no residual is large.
    pub(super) fn cost(&self, spread_px: f64) -> Result<f64> {
        let of = |r: f64| {
            let r = r.abs() / spread_px;
            if r <= HUBER { r * r } else { HUBER * (2.0 * r - HUBER) }
        };
        Ok(self.residuals()?.iter().flatten().map(|r| of(r.x) + of(r.y)).sum())
    }

    fn predicted(&self, path: Option<&BoardPath>, view: usize, point: &Point) -> Predicted {
        let late_s = self.camera.late_s(point.px);
        let since = path.map(|p| p.since(view, late_s));
        let pose = since.map_or(self.poses[view], |(since, _, _)| since.then_from(&self.poses[view]));
        let x = pose.transform(point.on_board_m);
        let k = self.camera.intrinsics();
        let ideal = x.truncate() / x.z;
        let (at, bend) = self.camera.lens().distort_with_jacobian(ideal);
        let focal = DVec2::new(k.fx, k.fy);
        let residual = point.px - (focal * at + DVec2::new(k.cx, k.cy));
        // How a move of the point in the camera's space moves it in the picture.
        let moved = |d: DVec3| focal * (bend * ((d.truncate() - ideal * d.z) / x.z));
        let (r2, xy) = (ideal.length_squared(), ideal.x * ideal.y);
        let mut shared = [DVec2::ZERO; COUNT];
        shared[0] = DVec2::new(at.x, 0.0);
        shared[1] = DVec2::new(0.0, at.y);
        (shared[2], shared[3]) = (DVec2::X, DVec2::Y);
        shared[4] = focal * ideal * r2;
        shared[5] = focal * ideal * r2 * r2;
        shared[6] = focal * DVec2::new(2.0 * xy, r2 + 2.0 * ideal.y * ideal.y);
        shared[7] = focal * DVec2::new(r2 + 2.0 * ideal.x * ideal.x, 2.0 * xy);
        shared[8] = focal * ideal * r2 * r2 * r2;
        if let Some((_, then, step_s)) = since {
            let velocity = moved((then.transform(x) - x) / step_s);
            let [w, h] = self.camera.size.map(f64::from);
            shared[READOUT] = velocity * (point.px.y / h);
            shared[READOUT + 1] = velocity * (point.px.x / w);
        }
        // Rotations turn the board about its own origin, so that they do not move it as well; what has happened since
        // the frame's start comes behind them.
        let arm = self.poses[view].rotation * point.on_board_m;
        let later = since.map_or(glam::DQuat::IDENTITY, |(since, _, _)| since.rotation);
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let own: [DVec2; OWN] =
            std::array::from_fn(|i| moved(later * if i < 3 { axes[i].cross(arm) } else { axes[i - 3] }));
        Predicted {
            residual,
            by_shared: [shared.map(|d| d.x), shared.map(|d| d.y)],
            by_own: [own.map(|d| d.x), own.map(|d| d.y)],
        }
    }

    fn blocks(&self, free: &[usize], spread_px: f64) -> Result<Vec<Block>> {
        let path = self.path()?;
        let of = |view: usize| {
            let mut block = Block::new(free.len());
            for point in &self.points[view] {
                let p = self.predicted(path.as_ref(), view, point);
                for axis in 0..2 {
                    let by_shared = chosen(&p.by_shared[axis], free);
                    let residual = p.residual[axis];
                    block.add(&by_shared, &p.by_own[axis], residual, weight(residual, spread_px));
                }
            }
            block
        };
        Ok((0..self.points.len()).map(of).collect())
    }

    fn moved(&self, free: &[usize], step: &Step) -> Self {
        let mut next = self.clone();
        for (&i, s) in free.iter().zip(step.shared.iter()) {
            next.camera.values[i] += s;
        }
        for (pose, own) in next.poses.iter_mut().zip(&step.own) {
            let turn = glam::DQuat::from_scaled_axis(DVec3::new(own[0], own[1], own[2]));
            pose.rotation = (turn * pose.rotation).normalize();
            pose.translation_m += DVec3::new(own[3], own[4], own[5]);
        }
        next
    }

    /// Fits the poses and the parameters `free` (places in [`PARAMETERS`]).
    pub(super) fn fit(&mut self, free: &[usize], spread_px: f64) -> Result<()> {
        let mut cost = self.cost(spread_px)?;
        let mut damping = 1e-3;
        for _ in 0..MOST_STEPS {
            let blocks = self.blocks(free, spread_px)?;
            let before = cost;
            while damping < 1e9 {
                let next = step(&blocks, damping).map(|s| self.moved(free, &s));
                let lower = match &next {
                    Some(next) if next.is_sane() => Some(next.cost(spread_px)?).filter(|c| *c < cost),
                    _ => None,
                };
                if let (Some(next), Some(lower)) = (next, lower) {
                    (*self, cost) = (next, lower);
                    damping = (damping * 0.1).max(1e-12);
                    break;
                }
                damping *= 10.0;
            }
            if !(before - cost > CONVERGED * before) {
                break;
            }
        }
        Ok(())
    }

    /// A step beyond this is no camera's.
    fn is_sane(&self) -> bool {
        let k = self.camera.intrinsics();
        k.fx > 0.0 && k.fy > 0.0 && self.camera.values.iter().all(|v| v.is_finite())
    }

    /// Whether the views fix the parameters `free`.
    pub(super) fn fixes(&self, free: &[usize], spread_px: f64) -> Result<bool> {
        Ok(covariance(&self.blocks(free, spread_px)?).is_some())
    }

    /// Standard deviations of the parameters `free`; `None` where the views do not fix them. What a point is off by may
    /// be its own in each view, or the board's, and then the same in all: the wider of both counts.
    pub(super) fn deviations(&self, free: &[usize], spread_px: f64) -> Result<Option<Vec<f64>>> {
        let own = OWN * self.poses.len();
        let left = self.residual_count().saturating_sub(own + free.len()).max(1) as f64;
        // The mean weighed square, which for normal errors is a little less than the variance.
        let variance = self.cost(spread_px)? / left * spread_px * spread_px;
        let blocks = self.blocks(free, spread_px)?;
        let Some(each) = covariance(&blocks) else { return Ok(None) };
        let Some(pulls) = self.pulls(&blocks, free, spread_px)? else { return Ok(None) };
        let points = pulls.len() as f64;
        // As many points as parameters fit what is theirs as well.
        let few = points / (points - (free.len() + OWN) as f64 / 2.0).max(1.0);
        let shared = &each * pulls.iter().map(|p| p * p.transpose()).sum::<DMatrix<f64>>() * &each * few;
        let wider = |i: usize| (variance * each[(i, i)]).max(shared[(i, i)]).sqrt();
        Ok(Some((0..free.len()).map(wider).collect()))
    }

    /// What each point of the board pulls the parameters `free` by, in all views together.
    fn pulls(&self, blocks: &[Block], free: &[usize], spread_px: f64) -> Result<Option<Vec<DVector<f64>>>> {
        let path = self.path()?;
        let mut pulls = BTreeMap::new();
        for (view, block) in blocks.iter().enumerate() {
            let Some(pull) = block.pull() else { return Ok(None) };
            for point in &self.points[view] {
                let p = self.predicted(path.as_ref(), view, point);
                let sum = pulls.entry(place_of(point)).or_insert_with(|| DVector::zeros(free.len()));
                for axis in 0..2 {
                    let by_shared = chosen(&p.by_shared[axis], free);
                    let weighed = p.residual[axis] * weight(p.residual[axis], spread_px);
                    *sum += pull(&by_shared, &p.by_own[axis]) * weighed;
                }
            }
        }
        Ok(Some(pulls.into_values().collect()))
    }

    /// How many residuals count as one: one where those of a point differ from view to view, as many as there are views
    /// where they are the same in all (the design effect of clusters; Kish, Survey Sampling, 1965).
    pub(super) fn alike(&self) -> Result<f64> {
        let mut of_points = BTreeMap::new();
        for (points, residuals) in self.points.iter().zip(self.residuals()?) {
            for (point, r) in points.iter().zip(residuals) {
                let (count, sum, squares) =
                    of_points.entry(place_of(point)).or_insert((0.0, DVec2::ZERO, 0.0));
                (*count, *sum, *squares) = (*count + 1.0, *sum + r, *squares + r.length_squared());
            }
        }
        let (mut common, mut each, mut others) = (0.0, 0.0, 0.0);
        for (count, sum, squares) in of_points.into_values() {
            common += sum.length_squared() - squares;
            each += squares;
            others += (count - 1.0) * squares;
        }
        Ok(1.0 + (common / others.max(1e-300)).clamp(0.0, 1.0) * others / each.max(1e-300))
    }

    /// Views, counted up to `enough`, whose points lie further from those of every view before than what all are off
    /// by. Another picture from the same place tells nothing of the camera.
    pub(super) fn places(&self, enough: usize) -> Result<usize> {
        let off_px = self.rms_px()?;
        let mut kept: Vec<usize> = Vec::new();
        for view in 0..self.points.len() {
            if kept.len() < enough
                && kept.iter().all(|k| self.apart_px(*k, view) > 2.0 * off_px[*k].max(off_px[view]))
            {
                kept.push(view);
            }
        }
        Ok(kept.len())
    }

    /// Root mean square distance of the points that two views share, px; without any they are far apart.
    fn apart_px(&self, a: usize, b: usize) -> f64 {
        let square = |p: &Point| {
            let same = self.points[b].iter().find(|q| q.on_board_m == p.on_board_m)?;
            Some((same.px - p.px).length_squared())
        };
        let squares: Vec<f64> = self.points[a].iter().filter_map(square).collect();
        if squares.is_empty() {
            f64::INFINITY
        } else {
            (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
        }
    }

    /// Root mean square distance of each view's points, px.
    pub(super) fn rms_px(&self) -> Result<Vec<f64>> {
        let rms = |r: &Vec<DVec2>| {
            (r.iter().map(|d| d.length_squared()).sum::<f64>() / r.len().max(1) as f64).sqrt()
        };
        Ok(self.residuals()?.iter().map(rms).collect())
    }
}

/// A point's place on the board as a key.
fn place_of(point: &Point) -> [u64; 3] {
    point.on_board_m.to_array().map(f64::to_bits)
}

/// The weight of a residual after Huber.
fn weight(residual_px: f64, spread_px: f64) -> f64 {
    (HUBER * spread_px / residual_px.abs()).min(1.0)
}

fn chosen(of_all: &[f64; COUNT], free: &[usize]) -> Vec<f64> {
    free.iter().map(|&i| of_all[i]).collect()
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    fn bundle(starts_s: Option<Vec<f64>>) -> Bundle {
        let mut camera = Camera::pinhole([640, 480], [500.0, 510.0]);
        camera.values[4..].copy_from_slice(&[-0.25, 0.08, 0.001, -0.002, -0.01, 0.02, 0.003]);
        let poses: Vec<Pose> = (0..4)
            .map(|i| Pose {
                rotation: DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.1 * f64::from(i), -0.2),
                translation_m: DVec3::new(-0.12 + 0.02 * f64::from(i), -0.1, 0.4),
            })
            .collect();
        let board = |i: i32| DVec3::new(0.03 * f64::from(i % 9), 0.03 * f64::from(i / 9), 0.0);
        let points = |pose: &Pose| {
            let of = |i: i32| {
                let px = camera.project(pose.transform(board(i))).expect("in front");
                Point { on_board_m: board(i), px: px + DVec2::new(0.4, -0.3) }
            };
            (0..54).map(of).collect()
        };
        Bundle { camera, points: poses.iter().map(points).collect(), poses, starts_s }
    }

    /// Every analytic derivative against a difference of two predictions.
    #[test]
    fn derivatives_are_the_differences() {
        let bundle = bundle(Some(vec![0.0, 0.04, 0.08, 0.12]));
        let path = bundle.path().expect("a path");
        let p = bundle.points[1][40];
        let at = bundle.predicted(path.as_ref(), 1, &p);
        for i in 0..COUNT {
            let h = if i < 4 { 1e-4 } else { 1e-7 };
            let mut moved = bundle.clone();
            moved.camera.values[i] += h;
            let there = moved.predicted(path.as_ref(), 1, &p).residual;
            for axis in 0..2 {
                let should = (at.residual[axis] - there[axis]) / h;
                let is = at.by_shared[axis][i];
                assert!(
                    (is - should).abs() < 1e-3 * (1.0 + should.abs()),
                    "{}: {is} {should}",
                    PARAMETERS[i]
                );
            }
        }
        for i in 0..OWN {
            let h = 1e-7;
            let mut own = vec![nalgebra::SVector::zeros(); 4];
            own[1][i] = h;
            let moved = bundle.moved(&[], &Step { shared: nalgebra::DVector::zeros(0), own });
            let there = moved.predicted(path.as_ref(), 1, &p).residual;
            for axis in 0..2 {
                let should = (at.residual[axis] - there[axis]) / h;
                let is = at.by_own[axis][i];
                assert!((is - should).abs() < 1e-3 * (1.0 + should.abs()), "pose {i}: {is} {should}");
            }
        }
    }
}
