//! A host over the C ABI, with pictures of the ray caster.

use std::collections::BTreeMap;
use std::sync::Mutex;

use shutterbug::camera::Pose;
use shutterbug::capi::*;
use shutterbug::plane::PixelFormat;

use super::{K, READOUT_S, Shot, World, camera_motion, shot};
use crate::capi_support::{image, must, outside, process, sized, status, text};

pub const SIZE: [usize; 2] = [K.width as usize, K.height as usize];
/// Poses of a frame: those of a host's physics steps.
pub const POSES: u32 = 13;

pub fn set_camera(engine: Handle, exposure_s: f64, more: &str) {
    let camera = text(&format!(
        "width = {}\nheight = {}\nfx = {:?}\nfy = {:?}\ncx = {:?}\ncy = {:?}\nframe_period_s = 0.04\n\
         [rolling_shutter]\nreadout_time_s = {READOUT_S:?}\n[motion_blur]\nexposure_time_s = {exposure_s:?}\n{more}",
        K.width, K.height, K.fx, K.fy, K.cx, K.cy
    ));
    must(unsafe { shutterbug_engine_set_camera_text(engine, camera.as_ptr()) }, engine);
}

pub fn stamped(time_s: f64, pose: &Pose) -> shutterbug_stamped_pose {
    let (translation_m, rotation_xyzw) = (pose.translation_m.to_array(), pose.rotation.to_array());
    shutterbug_stamped_pose { time_s, world_from_camera: shutterbug_pose { translation_m, rotation_xyzw } }
}

/// `count` poses of a motion over `[0, end_s]`.
pub fn poses(name: &str, end_s: f64, count: u32) -> Vec<shutterbug_stamped_pose> {
    let at = |i: u32| end_s * f64::from(i) / f64::from(count - 1);
    (0..count).map(|i| stamped(at(i), &camera_motion(name, at(i)))).collect()
}

/// Pictures that were rendered, by motion, end of the frame and margin: several frames are made of each.
pub type Shots = BTreeMap<(String, u64, [u32; 2]), Shot>;
static SHOTS: Mutex<Shots> = Mutex::new(BTreeMap::new());

/// The resting world at the frame's middle.
pub fn taken(name: &str, end_s: f64, margin_px: [u32; 2]) -> Shot {
    let motion = |t: f64| vec![camera_motion(name, t), Pose::IDENTITY];
    let of = (name.to_owned(), end_s.to_bits(), margin_px);
    let mut shots = SHOTS.lock().unwrap();
    shots.entry(of).or_insert_with(|| shot(&World::new(false), &motion, 0.5 * end_s, margin_px)).clone()
}

/// A frame of one picture with depth and poses over the frame, or two.
pub fn deliver(
    engine: Handle,
    name: &str,
    (end_s, margin_px): (f64, [u32; 2]),
    poses: &[shutterbug_stamped_pose],
    with_path: bool,
) -> Result<Vec<u8>, (Status, String)> {
    let mut one = Pictures::new([taken(name, end_s, margin_px)], margin_px);
    let mut o = one.outside(&[0.5 * end_s]);
    (o.poses, o.pose_count) = (poses.as_ptr(), if with_path { poses.len() as u32 } else { 0 });
    process(engine, &o, SIZE)
}

/// Pictures of a frame, as C takes them.
pub struct Pictures {
    shots: Vec<Shot>,
    ids: Vec<Vec<u16>>,
    margin_px: [u32; 2],
    images: Vec<[shutterbug_image; 3]>,
    further: Vec<shutterbug_picture>,
    convention: shutterbug_depth_convention,
}

impl Pictures {
    pub fn new(shots: impl IntoIterator<Item = Shot>, margin_px: [u32; 2]) -> Self {
        let shots: Vec<_> = shots.into_iter().collect();
        let numbers = |s: &Shot| s.body.iter().map(|b| 400 + *b as u16).collect();
        let ids = shots.iter().map(numbers).collect();
        Self { shots, ids, margin_px, images: Vec::new(), further: Vec::new(), convention: sized() }
    }

    /// The frame: pictures of these times, the first one first; no poses yet. Points into this.
    pub fn outside(&mut self, times_s: &[f64]) -> shutterbug_outside {
        let images = |(shot, ids): (&mut Shot, &mut Vec<u16>)| {
            let [w, h] = shot.size;
            [
                image(PixelFormat::Rgb8, w, h, &mut shot.rgb),
                image(PixelFormat::R32f, w, h, bytemuck::cast_slice_mut(&mut shot.depth_m)),
                image(PixelFormat::R16u, w, h, bytemuck::cast_slice_mut(ids)),
            ]
        };
        self.images = self.shots.iter_mut().zip(&mut self.ids).map(images).collect();
        let further = |(&time_s, i): (&f64, &[shutterbug_image; 3])| {
            let [color, depth, ids] = i.each_ref().map(std::ptr::from_ref);
            shutterbug_picture { time_s, color, depth, ids }
        };
        self.further = times_s.iter().zip(&self.images).skip(1).map(further).collect();
        let mut o = outside();
        let [color, depth, ids] = self.images[0].each_ref().map(std::ptr::from_ref);
        (o.color_time_s, o.color, o.depth, o.ids) = (times_s[0], color, depth, ids);
        o.depth_convention = &self.convention;
        (o.pictures, o.picture_count) = (self.further.as_ptr(), self.further.len() as u32);
        [o.margin_x_px, o.margin_y_px] = self.margin_px;
        o
    }
}

/// The margin that a motion needs, from the refusal of a frame without one.
pub fn margin_of(engine: Handle, name: &str, end_s: f64, poses: &[shutterbug_stamped_pose]) -> [u32; 2] {
    match deliver(engine, name, (end_s, [0, 0]), poses, true) {
        Ok(_) => [0, 0],
        Err((code, said)) => {
            assert_eq!(code, status("TOO_SMALL"), "{said}");
            let numbers: Vec<u32> =
                said.split(|c: char| !c.is_ascii_digit()).filter_map(|n| n.parse().ok()).collect();
            [numbers[2], numbers[3]]
        }
    }
}

/// A box that flies through and turns, at 2 m.
pub fn flying(t: f64) -> Pose {
    Pose {
        rotation: glam::DQuat::from_euler(glam::EulerRot::YXZ, 3.0 * t + 0.4, 0.5, 6.0 * t),
        translation_m: glam::DVec3::new(-0.2 + 6.0 * t, 0.1 - 1.5 * t + 20.0 * t * t, 2.0),
    }
}

/// [`POSES`] poses of it over `[0, end_s]`.
pub fn flights(end_s: f64) -> Vec<shutterbug_stamped_pose> {
    let at = |i: u32| end_s * f64::from(i) / f64::from(POSES - 1);
    (0..POSES).map(|i| stamped(at(i), &flying(at(i)))).collect()
}
