//! Motion of a resting scene from depth and the camera's movement (the reconstruction method of the paper's section
//! 2.3), for frames that bring depth but no motion. Twin of `glsl/motion_from_depth.comp`.

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, Vec2, Vec4};

use crate::camera::{Intrinsics, Pose};
use crate::plane::Plane;

/// The kernel's parameters.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Push {
    /// Width and height of depth and motion, px.
    pub size: [u32; 2],
    /// Layer of the motion images that is written.
    pub layer: u32,
    /// Frame intervals in the span: motion = (to - from) times this.
    pub scale: f32,
    /// fx, fy, cx, cy of the picture with its margin, px.
    pub intrinsics: [f32; 4],
    /// First row of "camera at the start of the span, from the camera of the depth picture".
    pub from_row_0: [f32; 4],
    /// Second row.
    pub from_row_1: [f32; 4],
    /// Third row.
    pub from_row_2: [f32; 4],
    /// The same for the end of the span.
    pub to_row_0: [f32; 4],
    /// Second row.
    pub to_row_1: [f32; 4],
    /// Third row.
    pub to_row_2: [f32; 4],
}

impl Push {
    /// Parameters for a span of `span_frames` frame intervals; both transforms take points of the camera of the depth
    /// picture, at the start and at the end of the span.
    pub fn new(
        intrinsics: &Intrinsics,
        layer: u32,
        span_frames: f64,
        from_camera_from_now: &Pose,
        to_camera_from_now: &Pose,
    ) -> Self {
        let row = |pose: &Pose, i: usize| {
            let r = DMat3::from_quat(pose.rotation).row(i);
            [r.x as f32, r.y as f32, r.z as f32, pose.translation_m[i] as f32]
        };
        let (from, to) = (from_camera_from_now, to_camera_from_now);
        let k = intrinsics;
        Self {
            size: [k.width, k.height],
            layer,
            scale: (1.0 / span_frames) as f32,
            intrinsics: [k.fx as f32, k.fy as f32, k.cx as f32, k.cy as f32],
            from_row_0: row(from, 0),
            from_row_1: row(from, 1),
            from_row_2: row(from, 2),
            to_row_0: row(to, 0),
            to_row_1: row(to, 1),
            to_row_2: row(to, 2),
        }
    }
}

/// Motion, shape `[height, width, 2]`, px per frame interval; 0 where the point is behind one of the two cameras.
///
/// `depth_m`: one channel, metres along the optical axis; infinite, not a number or not above 0 = infinitely far, which
/// only rotation moves.
///
/// # Panics
/// If the depth has another shape than `push.size`.
pub fn motion_from_depth(push: &Push, depth_m: &Plane<f32>) -> Plane<f32> {
    let [width, height] = push.size.map(|side| side as usize);
    assert_eq!((depth_m.width, depth_m.height, depth_m.channels), (width, height, 1), "depth");
    let [fx, fy, cx, cy] = push.intrinsics;
    let (focal, center) = (Vec2::new(fx, fy), Vec2::new(cx, cy));
    Plane::from_fn(width, height, |x, y| {
        let depth_m = depth_m.pixel(x, y)[0];
        // The point over its depth: w = 1/depth goes to 0 for what is infinitely far, with no case of its own.
        let ray = (Vec2::new(x as f32, y as f32) + 0.5 - center) / focal;
        let point = Vec4::new(ray.x, ray.y, 1.0, if depth_m > 0.0 { 1.0 / depth_m } else { 0.0 });
        let project = |rows: [[f32; 4]; 3]| {
            let [x, y, z] = rows.map(|row| dot4(Vec4::from(row), point));
            (z > 0.0).then(|| focal * (Vec2::new(x, y) / z) + center)
        };
        let from = project([push.from_row_0, push.from_row_1, push.from_row_2]);
        let to = project([push.to_row_0, push.to_row_1, push.to_row_2]);
        from.zip(to).map_or([0.0; 2], |(from, to)| ((to - from) * push.scale).to_array())
    })
}

/// In the kernel's order of operations, which glam's own may not be.
fn dot4(a: Vec4, b: Vec4) -> f32 {
    a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec2, DVec3};

    use super::*;

    const K: Intrinsics = Intrinsics { width: 33, height: 21, fx: 40.0, fy: 38.0, cx: 15.7, cy: 11.1 };

    /// Motion of a pixel's point in f64, by way of the camera's own projection.
    fn expected(x: usize, y: usize, depth_m: f64, from: &Pose, to: &Pose) -> DVec2 {
        let now = K.ray(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)) * depth_m;
        K.project(to.transform(now)).expect("in front") - K.project(from.transform(now)).expect("in front")
    }

    fn worst_px(push: &Push, depth: &Plane<f32>, from: &Pose, to: &Pose) -> f64 {
        let motion = motion_from_depth(push, depth);
        let mut worst = 0.0_f64;
        for (x, y) in (0..depth.height).flat_map(|y| (0..depth.width).map(move |x| (x, y))) {
            let m = motion.pixel(x, y);
            let want = expected(x, y, f64::from(depth.pixel(x, y)[0]), from, to) / 0.5;
            worst = worst.max((DVec2::new(f64::from(m[0]), f64::from(m[1])) - want).length());
        }
        worst
    }

    #[test]
    fn motion_is_the_difference_of_two_projections() {
        let pose = |v: [f64; 3], t: [f64; 3]| Pose {
            rotation: DQuat::from_scaled_axis(DVec3::from(v)),
            translation_m: DVec3::from(t),
        };
        let (from, to) =
            (pose([0.02, -0.1, 0.05], [0.1, 0.02, -0.2]), pose([-0.03, 0.1, 0.0], [-0.1, 0.05, 0.1]));
        let depth = Plane::from_fn(33, 21, |x, y| [1.0 + 0.3 * ((x * 7 + y * 13) % 11) as f32]);
        let push = Push::new(&K, 0, 0.5, &from, &to);
        assert!(worst_px(&push, &depth, &from, &to) < 1e-3);
        // Controls: the span backwards, and the wrong scale.
        assert!(worst_px(&Push::new(&K, 0, 0.5, &to, &from), &depth, &from, &to) > 1.0);
        assert!(worst_px(&Push { scale: 1.0, ..push }, &depth, &from, &to) > 1.0);
    }

    #[test]
    fn nothing_in_sight_is_moved_by_rotation_only_and_points_behind_by_nothing() {
        let turned = Pose { rotation: DQuat::from_rotation_y(0.1), translation_m: DVec3::new(0.5, 0.0, 0.0) };
        let push = Push::new(&K, 0, 1.0, &Pose::IDENTITY, &turned);
        let rotation = Pose { translation_m: DVec3::ZERO, ..turned };
        for nothing in [f32::INFINITY, 0.0, -1.0, f32::NAN] {
            let m = motion_from_depth(&push, &Plane::from_fn(33, 21, |_, _| [nothing]));
            let want = expected(20, 4, 5.0, &Pose::IDENTITY, &rotation);
            let got = m.pixel(20, 4);
            assert!((f64::from(got[0]) - want.x).abs() < 1e-3 && (f64::from(got[1]) - want.y).abs() < 1e-3);
        }
        let near = motion_from_depth(&push, &Plane::from_fn(33, 21, |_, _| [2.0]));
        let far = motion_from_depth(&push, &Plane::from_fn(33, 21, |_, _| [f32::INFINITY]));
        assert!(
            (near.pixel(20, 4)[0] - far.pixel(20, 4)[0]).abs() > 1.0,
            "control: translation moves what is near"
        );
        let behind = Pose { translation_m: DVec3::new(0.0, 0.0, -3.0), ..Pose::IDENTITY };
        let push = Push::new(&K, 0, 1.0, &Pose::IDENTITY, &behind);
        let m = motion_from_depth(&push, &Plane::from_fn(33, 21, |_, _| [2.0]));
        assert!(m.data.iter().all(|&v| v == 0.0));
    }

    #[test]
    fn the_block_fills_the_128_bytes_that_every_device_has() {
        assert_eq!(size_of::<Push>(), 128);
        assert_eq!(std::mem::offset_of!(Push, intrinsics), 16);
    }
}
