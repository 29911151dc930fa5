//! Frames from outside, as C gives them.

use std::path::Path;
use std::sync::Arc;

use super::Handle;
use super::convert::{depth_decode, motion_scale};
use super::engine::stamped_poses;
use super::frame::hand_out;
use super::picture::{Kind, Picture};
use super::session::{Session, Submitted};
use super::sharing;
use super::status::{self, Fault, Outcome, Status};
use super::types::*;
use crate::camera::{Pose, Trajectory};
use crate::engine::{
    Delivery, MAX_BODIES, MAX_OUTSIDE_MOTIONS, MAX_PICTURES, OutsideBodies, OutsideFrame, OutsideMotion,
    OutsidePicture, PixelSource,
};
use crate::error::Quoted;
use crate::gpu::Context;
use crate::reference::unpack::Encoding;

/// Flag of a frame: what lies beyond a margin that is too small is the picture's repeated border.
pub const OUTSIDE_REPEAT_BORDER: u32 = 1;
/// Flag of a frame: the radiance before the sensor can be read.
pub const OUTSIDE_RADIANCE: u32 = 2;
/// Flag of a frame: the picture can be read in more than 8 bits.
pub const OUTSIDE_FINE: u32 = 4;
/// Flag of a frame: what the converter delivers can be read.
pub const OUTSIDE_RAW: u32 = 8;
/// All of them.
const OUTSIDE_FLAGS: u32 = OUTSIDE_REPEAT_BORDER | OUTSIDE_RADIANCE | OUTSIDE_FINE | OUTSIDE_RAW;

/// `shutterbug_engine_submit_outside`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_engine_submit_outside(
    engine: Handle,
    outside: *const shutterbug_outside,
    frame: *mut Handle,
) -> Status {
    // SAFETY: the caller's promise, in all of it.
    unsafe { hand_out(engine, frame, |session| submit(session, &read(outside)?)) }
}

/// # Safety
/// The header's promise for all that `o` points to.
unsafe fn submit(session: &mut Session, o: &shutterbug_outside) -> Outcome<Submitted> {
    check_numbers(o)?;
    let mut request = session.outside_request(o.frame_index, o.time_s, o.pose_count > 0)?;
    request.statistics = o.flags & OUTSIDE_RADIANCE != 0;
    let context = session.context().clone();
    let camera = session.camera().expect("the request has one").intrinsics;
    let margin_px = [o.margin_x_px, o.margin_y_px];
    if margin_px[0] > camera.width || margin_px[1] > camera.height {
        return Err(Fault::new(status::LIMIT, "the margin is at most the camera's own width and height"));
    }
    let wider = camera.with_margin(margin_px);
    let size = [wider.width, wider.height];
    // SAFETY: the caller's promise.
    let color = unsafe { Picture::new(o.color, ("color", Kind::Color), size, &context) }?;
    // SAFETY: as above.
    let moving = unsafe { moving(o, size, &context, request.frame_interval_s) }?;
    // SAFETY: as above.
    session.hear_of_depth(|| unsafe { moving.complaint() });
    let path = moving.path(o)?;
    let mut frame = OutsideFrame {
        color_time_s: o.color_time_s,
        // SAFETY: as above.
        color: unsafe { color.pixels() },
        encoding: if o.encoding == 1 { Encoding::Linear } else { Encoding::Srgb },
        margin_px,
        // SAFETY: as above.
        motion: unsafe { moving.motion(o) },
        max_samples: session.settings().max_samples,
        delivery: Delivery {
            to: sharing::picture_memory(o.picture_memory, [camera.width, camera.height], &context)?,
            wait: sharing::semaphore(o.wait, o.wait_value, &context)?,
            signal: sharing::semaphore(o.signal, o.signal_value, &context)?,
            values: o.flags & OUTSIDE_FINE != 0,
            raw: o.flags & OUTSIDE_RAW != 0,
        },
        request,
    };
    frame.sort_pictures();
    session.submit_outside(frame, path)
}

fn check_numbers(o: &shutterbug_outside) -> Outcome<()> {
    let times = [
        ("time_s", o.time_s),
        ("color_time_s", o.color_time_s),
        ("first_motion_time_s", o.first_motion_time_s),
        ("motion_step_s", o.motion_step_s),
    ];
    if let Some((name, value)) = times.iter().find(|(_, v)| !v.is_finite()) {
        return Err(Fault::argument(format!("shutterbug_outside.{name} is {value}")));
    }
    if o.flags & !OUTSIDE_FLAGS != 0 || o.reserved != 0 || o.reserved_more != 0 || o.encoding > 1 {
        return Err(Fault::argument("shutterbug_outside: unknown flags or encoding, or reserved is not 0"));
    }
    check_poses(o)?;
    if o.motion_count as usize > MAX_OUTSIDE_MOTIONS {
        let text = format!("motion_count is {}, at most {MAX_OUTSIDE_MOTIONS}", o.motion_count);
        return Err(Fault::argument(text));
    }
    if (o.motion_count == 0) == o.depth.is_null() {
        return Err(Fault::argument("either motion images or depth are given: one of them, not both"));
    }
    if o.motion_count > 1 && !(o.motion_step_s > 0.0) {
        return Err(Fault::argument(format!(
            "motion_step_s is {}, with several images",
            Quoted(o.motion_step_s)
        )));
    }
    Ok(())
}

fn check_poses(o: &shutterbug_outside) -> Outcome<()> {
    if o.pose_count == 1 {
        return Err(Fault::argument("pose_count is 1: two poses or more, over all of the frame"));
    }
    if o.pose_count > 0 && o.motion_count > 0 {
        return Err(Fault::argument("pose_count poses go with depth, not with motion images"));
    }
    if !(o.nearest_m >= 0.0 && o.nearest_m.is_finite()) {
        return Err(Fault::argument(format!("nearest_m is {}, not 0 or above", Quoted(o.nearest_m))));
    }
    let of_paths = [o.flags & OUTSIDE_REPEAT_BORDER, o.body_count, o.picture_count];
    if o.pose_count == 0 && (of_paths != [0; 3] || o.nearest_m != 0.0) {
        let text = "REPEAT_BORDER, nearest_m, body_count and picture_count are for frames with pose_count poses: 0 \
            without";
        return Err(Fault::argument(text));
    }
    if o.picture_count as usize >= MAX_PICTURES {
        let text = format!("picture_count is {}, at most {}", o.picture_count, MAX_PICTURES - 1);
        return Err(Fault::argument(text));
    }
    if o.body_count as usize > MAX_BODIES {
        return Err(Fault::argument(format!("body_count is {}, at most {MAX_BODIES}", o.body_count)));
    }
    Ok(())
}

/// An image of ids, and the path of each.
type Bodies = (Picture, Vec<(u32, Trajectory)>);

/// Checked motion or depth.
enum Moving {
    Images(Vec<Picture>, [f32; 2]),
    Depth(Picture, Option<[f32; 3]>, [(f64, Pose); 2]),
    Path(Seen),
}

/// Depth with the camera's path.
struct Seen {
    depth: Picture,
    decode: Option<[f32; 3]>,
    path: Arc<Trajectory>,
    bodies: Option<Bodies>,
    further: Vec<Further>,
}

/// A checked picture of another instant.
struct Further {
    time_s: f64,
    color: Picture,
    depth: Picture,
    ids: Option<Picture>,
}

impl Further {
    /// All of a frame.
    ///
    /// # Safety
    /// The header's promise for all that `o` points to.
    unsafe fn all(o: &shutterbug_outside, size: [u32; 2], context: &Arc<Context>) -> Outcome<Vec<Self>> {
        if o.picture_count > 0 && (o.pictures.is_null() || !o.pictures.is_aligned()) {
            return Err(Fault::argument("pictures is null or misaligned"));
        }
        let mut all = Vec::new();
        for k in 0..o.picture_count as usize {
            // SAFETY: the caller's promise: `picture_count` pictures.
            let given = unsafe { o.pictures.add(k).read() };
            if !given.time_s.is_finite() {
                return Err(Fault::argument(format!("pictures[{k}].time_s is {}", given.time_s)));
            }
            // SAFETY: as above, for the images that they point to.
            let one = |image, what: &str, kind| unsafe {
                Picture::new(image, (&format!("pictures[{k}].{what}"), kind), size, context)
            };
            all.push(Self {
                time_s: given.time_s,
                color: one(given.color, "color", Kind::Color)?,
                depth: one(given.depth, "depth", Kind::Depth)?,
                ids: (o.body_count > 0).then(|| one(given.ids, "ids", Kind::Ids)).transpose()?,
            });
        }
        let mut times_s: Vec<_> = all.iter().map(|p| p.time_s).chain([o.color_time_s]).collect();
        times_s.sort_by(f64::total_cmp);
        match times_s.windows(2).find(|pair| pair[0] == pair[1]) {
            Some(pair) => Err(Fault::argument(format!("two pictures are of {} s", pair[0]))),
            None => Ok(all),
        }
    }

    /// # Safety
    /// The header's promise for its images.
    unsafe fn picture(&self) -> OutsidePicture<'_> {
        // SAFETY: the caller's promise.
        unsafe {
            OutsidePicture {
                time_s: self.time_s,
                color: self.color.pixels(),
                depth: self.depth.pixels(),
                ids: self.ids.as_ref().map(|i| i.pixels()),
            }
        }
    }
}

/// The bodies of a frame, in rising order of their ids.
///
/// # Safety
/// The header's promise for all that `o` points to.
unsafe fn bodies(o: &shutterbug_outside, size: [u32; 2], context: &Arc<Context>) -> Outcome<Option<Bodies>> {
    if o.body_count == 0 {
        return Ok(None);
    }
    if o.bodies.is_null() || !o.bodies.is_aligned() {
        return Err(Fault::argument("bodies is null or misaligned"));
    }
    // SAFETY: the caller's promise.
    let ids = unsafe { Picture::new(o.ids, ("ids", Kind::Ids), size, context) }?;
    let mut paths = Vec::new();
    for i in 0..o.body_count as usize {
        // SAFETY: as above: `body_count` bodies, each with its poses.
        let (body, poses) = unsafe {
            let body = o.bodies.add(i).read();
            (body, stamped_poses(body.poses, body.pose_count as usize)?)
        };
        if body.pose_count < 2 {
            return Err(Fault::argument(format!("body {}: pose_count is {}", body.id, body.pose_count)));
        }
        let of = format!("poses of body {}", body.id);
        paths.push((body.id, Trajectory::new(Path::new(&of), poses.0, poses.1)?.smoothed()));
    }
    paths.sort_by_key(|(id, _)| *id);
    match paths.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some(pair) => Err(Fault::argument(format!("two bodies have the id {}", pair[0].0))),
        None => Ok(Some((ids, paths))),
    }
}

/// # Safety
/// The header's promise for all that `o` points to.
unsafe fn moving(
    o: &shutterbug_outside,
    size: [u32; 2],
    context: &Arc<Context>,
    frame_interval_s: f64,
) -> Outcome<Moving> {
    if o.motion_count > 0 {
        // SAFETY: the caller's promise.
        let convention = unsafe { read(o.motion_convention) }?;
        if o.motions.is_null() || !o.motions.is_aligned() {
            return Err(Fault::argument("motions is null or misaligned"));
        }
        let mut images = Vec::new();
        for k in 0..o.motion_count as usize {
            // SAFETY: the caller's promise: `motion_count` images.
            let image = unsafe { Picture::new(o.motions.add(k), ("motion", Kind::Motion), size, context) }?;
            images.push(image);
        }
        return Ok(Moving::Images(images, motion_scale(&convention, size, frame_interval_s)?));
    }
    // SAFETY: the caller's promise.
    let image = unsafe { Picture::new(o.depth, ("depth", Kind::Depth), size, context) }?;
    // SAFETY: as above.
    let decode = depth_decode(&unsafe { read(o.depth_convention) }?)?;
    if o.pose_count > 0 {
        // SAFETY: as above: `pose_count` poses.
        let (times_s, poses) = unsafe { stamped_poses(o.poses, o.pose_count as usize) }?;
        let path = Trajectory::new(Path::new("poses"), times_s, poses)?.smoothed();
        // SAFETY: as above.
        let (bodies, further) = unsafe { (bodies(o, size, context)?, Further::all(o, size, context)?) };
        return Ok(Moving::Path(Seen { depth: image, decode, path: Arc::new(path), bodies, further }));
    }
    // SAFETY: as above: two poses.
    let (times_s, poses) = unsafe { stamped_poses(o.poses, 2) }?;
    Ok(Moving::Depth(image, decode, [(times_s[0], poses[0]), (times_s[1], poses[1])]))
}

impl Moving {
    /// What is odd about a depth in host memory.
    ///
    /// # Safety
    /// The header's promise for the image.
    unsafe fn complaint(&self) -> Option<String> {
        let (depth, decode) = match self {
            Self::Images(..) => return None,
            Self::Depth(depth, decode, _) => (depth, decode),
            Self::Path(seen) => (&seen.depth, &seen.decode),
        };
        // SAFETY: the caller's promise.
        let pixels = unsafe { depth.pixels() };
        match pixels.source {
            PixelSource::Host(bytes) => super::depth::complaint(bytes, &pixels, depth.size(), *decode),
            PixelSource::Shared(..) | PixelSource::Image(_) => None,
        }
    }

    /// Poses between those that were given; none where there is only motion.
    fn path(&self, o: &shutterbug_outside) -> Outcome<Option<Arc<Trajectory>>> {
        let [from, to] = match self {
            Self::Images(..) => return Ok(None),
            Self::Path(seen) => return Ok(Some(seen.path.clone())),
            Self::Depth(_, _, poses) => poses,
        };
        let path = Trajectory::new(Path::new("the two poses"), vec![from.0, to.0], vec![from.1, to.1])?;
        path.require(o.color_time_s, o.color_time_s, &format!("frame {}", o.frame_index))?;
        Ok(Some(Arc::new(path)))
    }

    /// # Safety
    /// The header's promise for the images.
    unsafe fn motion(&self, o: &shutterbug_outside) -> OutsideMotion<'_> {
        match self {
            Self::Images(images, scale) => OutsideMotion::Images {
                // SAFETY: the caller's promise.
                images: images.iter().map(|i| unsafe { i.pixels() }).collect(),
                scale: *scale,
                first_time_s: o.first_motion_time_s,
                step_s: o.motion_step_s,
            },
            Self::Depth(image, decode, poses) => OutsideMotion::Depth {
                // SAFETY: the caller's promise.
                image: unsafe { image.pixels() },
                decode: *decode,
                poses: *poses,
            },
            Self::Path(seen) => OutsideMotion::Path {
                // SAFETY: the caller's promise.
                image: unsafe { seen.depth.pixels() },
                decode: seen.decode,
                path: seen.path.clone(),
                bodies: seen.bodies.as_ref().map(|(ids, paths)| OutsideBodies {
                    // SAFETY: the caller's promise.
                    ids: unsafe { ids.pixels() },
                    paths: paths.clone(),
                }),
                // SAFETY: the caller's promise.
                further: seen.further.iter().map(|f| unsafe { f.picture() }).collect(),
                nearest_m: if o.nearest_m > 0.0 { o.nearest_m } else { f64::INFINITY },
                repeat_border: o.flags & OUTSIDE_REPEAT_BORDER != 0,
            },
        }
    }
}
