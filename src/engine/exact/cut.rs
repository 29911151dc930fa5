//! How finely triangles must be cut. Each corner is projected at the time of its own line, so a rolling shutter turns a
//! straight edge into a curve; the edge that is drawn must stay near that curve.
//!
//! Over an edge, displacement is velocity times time, and both change: by dv and dt from end to end, and the velocity
//! by a dt on its own. To second order the chord is then off by `dv dt / 4 + a dt^2 / 8` in its middle. Velocities at
//! both ends follow from the camera's turn and way; where an end is beside or behind the camera, they differ over an
//! angle s by at most (w + V/d) s for a camera that turns at w rad/s and passes at V m/s what is d m away. The largest
//! over samples of the camera's path counts, so triangles are cut once, at load.

use glam::{DVec2, DVec3, Vec3};

use crate::camera::{ExtendedLens, Intrinsics, Pose, Trajectory};
use crate::engine::scene::Stage;
use crate::engine::scene::lens::Cone;
use crate::raster::{Mesh, MotionGroups};
use crate::scene::Vertex;

/// Samples of the path: the span of the trajectory, and three times in each of the frames that are expected.
const PATH_SAMPLES: usize = 64;
const FRAME_SAMPLES: usize = 96;
/// What is nearer to the lens is cut as if it were so far away, m.
const NEAREST_M: f64 = 0.15;
/// Angle beyond the picture's corner within which edges still count, rad.
const CONE_GUARD: f64 = 0.1;

/// The camera as a motion group sees it at one time.
struct Seen {
    camera_from_object: Pose,
    /// Of the camera, in its own frame: rad/s and m/s.
    turn: DVec3,
    pass: DVec3,
    /// Magnitude of their derivatives.
    turn_change: f64,
    pass_change: f64,
}

/// What the triangles are cut for.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    /// Largest distance of a chord from its curve, px.
    pub(super) chord_px: f64,
    /// Most triangles.
    pub(super) most: usize,
}

/// When they are seen.
pub(super) struct Views<'a> {
    /// In order of time, s.
    pub(super) frames: &'a [(f64, f64)],
    /// At any other time too.
    pub(super) everywhere: bool,
}

/// Cuts the mesh for a readout (s; are its lines rows) so that chords are off by at most what the limits say, or by as
/// little as the triangles that they allow give; also returns what was reached, px.
pub(super) fn cut(
    stage: &Stage,
    groups: &MotionGroups,
    mesh: &Mesh,
    views: &Views<'_>,
    (readout_time_s, lines_are_rows): (f64, bool),
    limits: Limits,
) -> (Mesh, f64) {
    let (times, stride) = sample_times(&stage.trajectory, views);
    let seen: Vec<Vec<Seen>> = (0..groups.count())
        .map(|g| times.iter().filter_map(|&t| see(&stage.trajectory, groups, g, t, readout_time_s)).collect())
        .collect();
    let lens = stage.lens.as_ref().map(|l| &l.extended);
    let mut bound = Bound::new(&stage.intrinsics, lens, readout_time_s, lines_are_rows);
    if stride > 1 && !views.everywhere {
        bound.allow_for_gaps(&seen);
    }
    let mut allowed_px = limits.chord_px;
    loop {
        let long = |a: &Vertex, b: &Vertex| {
            let group = a.object as usize;
            bound.is_long(&seen[group], a, b, allowed_px)
                || stage.lens.as_ref().is_some_and(|l| l.chords.is_long(group, a, b, allowed_px))
        };
        match mesh.split(long, limits.most) {
            Some(cut) => return (cut, allowed_px),
            None => allowed_px *= 2.0,
        }
        if allowed_px > 1e3 {
            return (mesh.clone(), allowed_px);
        }
    }
}

/// How strongly the camera moves in a frame, as the logarithm to base 2 of the chord error of an edge as wide as the
/// picture is far, over `chord_px`; 0 where nothing needs to be cut.
pub(super) fn strength(
    stage: &Stage,
    groups: &MotionGroups,
    (from_s, to_s): (f64, f64),
    readout_s: f64,
    chord_px: f64,
) -> i32 {
    let focal_px = stage.intrinsics.fx.max(stage.intrinsics.fy);
    let mut most = 0.0_f64;
    for group in 0..groups.count() {
        for time_s in [from_s, 0.5 * (from_s + to_s), to_s] {
            let Some(s) = see(&stage.trajectory, groups, group, time_s, readout_s) else { continue };
            let speed = s.turn.length() + s.pass.length();
            let change = (s.turn_change + s.pass_change) * readout_s;
            most = most.max(focal_px * readout_s * (0.25 * speed + 0.125 * change));
        }
    }
    (most / chord_px).max(1.0).log2().min(30.0) as i32
}

/// Three times in each of the frames, or of so many of them that there are not too many, and the span of the
/// trajectory; and how many frames were passed over for each that was not.
fn sample_times(path: &Trajectory, views: &Views<'_>) -> (Vec<f64>, usize) {
    let stride = (3 * views.frames.len()).div_ceil(FRAME_SAMPLES).max(1);
    let sampled = views.frames.iter().step_by(stride);
    let mut times: Vec<f64> = sampled.flat_map(|&(from, to)| [from, 0.5 * (from + to), to]).collect();
    let (from_s, to_s) = path.span_s();
    if views.everywhere && from_s.is_finite() && to_s.is_finite() {
        let step_s = (to_s - from_s) / (PATH_SAMPLES - 1) as f64;
        times.extend((0..PATH_SAMPLES).map(|i| from_s + step_s * i as f64));
    }
    (times, stride)
}

/// Differences over a quarter of the readout; `None` where there are no poses for them.
fn see(path: &Trajectory, groups: &MotionGroups, group: usize, time_s: f64, readout_s: f64) -> Option<Seen> {
    let step_s = 0.25 * readout_s;
    let covered = |t: f64| path.covers(t, t) && groups.covers(group, t);
    // Moved inwards where the trajectory begins or ends.
    let time_s = [time_s, time_s + step_s, time_s - step_s]
        .into_iter()
        .find(|t| covered(t - step_s) && covered(t + step_s))?;
    let pose = |t: f64| groups.world_from_object(group, t).inverse().then_from(&path.pose_at(t));
    let [before, now, after] = [time_s - step_s, time_s, time_s + step_s].map(pose);
    let turn = |a: glam::DQuat, b: glam::DQuat| (a.inverse() * b).to_scaled_axis() / step_s;
    let turns = [turn(before.rotation, now.rotation), turn(now.rotation, after.rotation)];
    let passes = [now.translation_m - before.translation_m, after.translation_m - now.translation_m]
        .map(|way_m| now.rotation.inverse() * way_m / step_s);
    Some(Seen {
        camera_from_object: now.inverse(),
        turn: 0.5 * (turns[0] + turns[1]),
        pass: 0.5 * (passes[0] + passes[1]),
        turn_change: (turns[1] - turns[0]).length() / step_s,
        pass_change: (passes[1] - passes[0]).length() / step_s,
    })
}

struct Bound {
    camera: Intrinsics,
    line_delay_s: f64,
    readout_time_s: f64,
    lines_are_rows: bool,
    cone: Cone,
    widest_rad: f64,
    /// How far the camera moves between one sample and the next, m.
    gap_m: f64,
}

impl Bound {
    /// Widens the cone by what the camera turns and moves from one sample to the next.
    fn allow_for_gaps(&mut self, seen: &[Vec<Seen>]) {
        let mut turn_rad = 0.0_f64;
        for pair in seen.iter().flat_map(|s| s.windows(2)) {
            let step = pair[1].camera_from_object.then_from(&pair[0].camera_from_object.inverse());
            turn_rad = turn_rad.max(step.rotation.to_scaled_axis().length());
            self.gap_m = self.gap_m.max(step.translation_m.length());
        }
        self.cone = Cone::new(self.widest_rad + turn_rad);
    }

    fn new(k: &Intrinsics, lens: Option<&ExtendedLens>, readout_time_s: f64, lines_are_rows: bool) -> Self {
        let (w, h) = (f64::from(k.width), f64::from(k.height));
        let corners = [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)];
        let widest = corners.map(|(x, y)| k.ray(DVec2::new(x, y)).angle_between(DVec3::Z));
        let stretch = lens.map_or(1.0, ExtendedLens::stretch);
        let widest_rad = match lens {
            Some(lens) => lens.radius().atan(),
            None => widest.into_iter().fold(0.0, f64::max) + CONE_GUARD,
        };
        Self {
            camera: Intrinsics { fx: stretch * k.fx, fy: stretch * k.fy, ..*k },
            line_delay_s: readout_time_s / if lines_are_rows { h } else { w },
            readout_time_s,
            lines_are_rows,
            cone: Cone::new(widest_rad),
            widest_rad,
            gap_m: 0.0,
        }
    }

    fn is_long(&self, seen: &[Seen], a: &Vertex, b: &Vertex, allowed_px: f64) -> bool {
        let at_m = |v: &Vertex| Vec3::from(v.position_m).as_dvec3();
        let (a, b) = (at_m(a), at_m(b));
        let length_m = (b - a).length();
        seen.iter().any(|s| {
            let (a, b) = (s.camera_from_object.transform(a), s.camera_from_object.transform(b));
            let middle = 0.5 * (a + b);
            let along = ((-a).dot(b - a) / (length_m * length_m).max(1e-12)).clamp(0.0, 1.0);
            let away_m = (a + along * (b - a)).length();
            if away_m > NEAREST_M && self.cone.misses(middle, 0.5 * length_m + self.gap_m) {
                return false;
            }
            let away_m = away_m.max(NEAREST_M);
            let focal_px = self.camera.fx.max(self.camera.fy);
            let (speed, lines) = if a.z.min(b.z) > NEAREST_M {
                let (va, vb) = (self.velocity_px_per_s(s, a), self.velocity_px_per_s(s, b));
                let way = self.px(a) - self.px(b);
                ((va - vb).length(), if self.lines_are_rows { way.y.abs() } else { way.x.abs() })
            } else {
                let span_px = focal_px * length_m / away_m;
                ((s.turn.length() + s.pass.length() / away_m) * span_px, span_px)
            };
            // The ends also move against each other until their lines are read.
            let lines = lines + 0.5 * speed * self.readout_time_s;
            let span_s = (lines * self.line_delay_s).min(self.readout_time_s);
            let change = (s.turn_change + s.pass_change / away_m) * focal_px;
            span_s * (0.25 * speed + 0.125 * change * span_s) > allowed_px
        })
    }

    fn px(&self, p: DVec3) -> DVec2 {
        DVec2::new(self.camera.fx * p.x / p.z, self.camera.fy * p.y / p.z)
    }

    /// Of a point of the picture, given in the camera's frame.
    fn velocity_px_per_s(&self, s: &Seen, p: DVec3) -> DVec2 {
        let v = -s.turn.cross(p) - s.pass;
        let of = |focal_px: f64, x: f64, vx: f64| focal_px * (vx - x / p.z * v.z) / p.z;
        DVec2::new(of(self.camera.fx, p.x, v.x), of(self.camera.fy, p.y, v.y))
    }
}
