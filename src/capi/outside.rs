//! Frames from outside, as C gives them.

use std::path::Path;
use std::sync::Arc;

use super::Handle;
use super::convert::{depth_decode, motion_scale};
use super::engine::stamped_poses;
use super::frame::hand_out;
use super::image::View;
use super::session::{Session, Submitted};
use super::sharing;
use super::status::{self, Fault, Outcome, Status};
use super::types::*;
use crate::camera::{Pose, Trajectory};
use crate::engine::{
    Delivery, MAX_BODIES, MAX_OUTSIDE_MOTIONS, OutsideBodies, OutsideFrame, OutsideMotion, OutsidePixels,
    PixelSource,
};
use crate::gpu::{Context, Shared, SharedFormat, SharedImageSpec};
use crate::plane::PixelFormat;
use crate::reference::unpack::Encoding;

/// Flag of a frame: what lies beyond a margin that is too small is the picture's repeated border.
pub const OUTSIDE_REPEAT_BORDER: u32 = 1;

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

/// A checked picture, with what it lies in if it is shared.
struct Picture {
    view: View,
    shared: Option<Shared>,
}

impl Picture {
    /// # Safety
    /// The header's promise for the image.
    unsafe fn new(
        image: *const shutterbug_image,
        (what, kind): (&str, Kind),
        size: [u32; 2],
        context: &Arc<Context>,
    ) -> Outcome<Self> {
        if image.is_null() {
            return Err(Fault::argument(format!("{what} is null")));
        }
        // SAFETY: the caller's promise.
        let mut image = unsafe { read(image) }?;
        let shared = match image.memory.is_null() {
            true => None,
            false => Some(sharing::shared(image.memory as usize, context)?),
        };
        if let Some(Shared::Image(on_device)) = &shared {
            as_if_packed(&mut image, what, (format_of(on_device.format()), on_device.spec()))?;
        }
        // Before its rows: their least size is that of its format.
        if let Some(format) = PixelFormat::from_code(image.format).filter(|f| !kind.takes(*f)) {
            let text = format!("{what} is {}, not {format:?}", kind.formats());
            return Err(Fault::new(status::FORMAT, text));
        }
        let view = View::new(&image, what)?;
        if view.size != size {
            let [w, h] = view.size;
            let text = format!("{what} is {w}x{h} px; the camera with its margin is {}x{}", size[0], size[1]);
            return Err(Fault::argument(text));
        }
        if let Some(Shared::Buffer(buffer)) = &shared {
            let end = view.memory_offset.checked_add(view.bytes as u64);
            if end.is_none_or(|end| end > buffer.bytes()) {
                let text =
                    format!("{what}: the shared memory has {} bytes, fewer than the picture", buffer.bytes());
                return Err(Fault::new(status::TOO_SMALL, text));
            }
        }
        Ok(Self { view, shared })
    }

    /// # Safety
    /// The header's promise for the image.
    unsafe fn pixels(&self) -> OutsidePixels<'_> {
        let source = match &self.shared {
            Some(Shared::Buffer(buffer)) => PixelSource::Shared(buffer, self.view.memory_offset),
            Some(Shared::Image(image)) => PixelSource::Image(image),
            // SAFETY: the caller's promise.
            None => PixelSource::Host(unsafe { self.view.read() }),
        };
        OutsidePixels { format: self.view.format, stride_bytes: self.view.stride, source }
    }
}

/// What a picture is for.
#[derive(Clone, Copy)]
enum Kind {
    Color,
    Motion,
    Depth,
    Ids,
}

impl Kind {
    fn takes(self, format: PixelFormat) -> bool {
        match self {
            Self::Color => format.is_color(),
            Self::Motion => format.is_motion(),
            Self::Depth => format == PixelFormat::R32f,
            Self::Ids => format.is_ids(),
        }
    }

    fn formats(self) -> &'static str {
        match self {
            Self::Color => "RGB8, RGBA8, BGRA8, RGBA16F or RGBA32F",
            Self::Motion => "RG16F or RG32F",
            Self::Depth => "R32F",
            Self::Ids => "R8U, R16U or R32U",
        }
    }
}

fn format_of(format: SharedFormat) -> PixelFormat {
    match format {
        SharedFormat::Rgba8 => PixelFormat::Rgba8,
        SharedFormat::Bgra8 => PixelFormat::Bgra8,
        SharedFormat::Rgba16f => PixelFormat::Rgba16f,
        SharedFormat::Rgba32f => PixelFormat::Rgba32f,
        SharedFormat::R32f => PixelFormat::R32f,
        SharedFormat::Rg16f => PixelFormat::Rg16f,
        SharedFormat::Rg32f => PixelFormat::Rg32f,
    }
}

/// A GPU image's picture, as it lies once the device has copied it: nothing but its size is the caller's to say.
fn as_if_packed(
    image: &mut shutterbug_image,
    what: &str,
    (format, on_device): (PixelFormat, &SharedImageSpec),
) -> Outcome<()> {
    if [image.width, image.height] != on_device.size {
        let [w, h] = on_device.size;
        let text = format!("{what} is {}x{} px, its GPU image {w}x{h}", image.width, image.height);
        return Err(Fault::argument(text));
    }
    if image.format != 0 && image.format != format as u32 {
        let text =
            format!("{what}: the GPU image holds {format:?}; format is that or 0, not {}", image.format);
        return Err(Fault::new(status::FORMAT, text));
    }
    if on_device.layout == 0 {
        return Err(Fault::argument(format!("{what}: a GPU image in an undefined layout has no content")));
    }
    if image.memory_offset != 0 {
        return Err(Fault::argument(format!("{what}: memory_offset is 0 with a GPU image")));
    }
    image.format = format as u32;
    image.stride_bytes = u64::from(image.width) * format.bytes() as u64;
    Ok(())
}

/// # Safety
/// The header's promise for all that `o` points to.
unsafe fn submit(session: &mut Session, o: &shutterbug_outside) -> Outcome<Submitted> {
    check_numbers(o)?;
    let request = session.outside_request(o.frame_index, o.time_s, o.pose_count > 0)?;
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
    let path = moving.path(o)?;
    let frame = OutsideFrame {
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
        },
        request,
    };
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
    if o.flags & !OUTSIDE_REPEAT_BORDER != 0 || o.reserved != 0 || o.encoding > 1 {
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
        return Err(Fault::argument(format!("motion_step_s is {}, with several images", o.motion_step_s)));
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
        return Err(Fault::argument(format!("nearest_m is {}, not 0 or above", o.nearest_m)));
    }
    if o.pose_count == 0 && (o.flags != 0 || o.nearest_m != 0.0 || o.body_count != 0) {
        let text = "flags, nearest_m and body_count are for frames with pose_count poses: 0 without";
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
    Path(Picture, Option<[f32; 3]>, Arc<Trajectory>, Option<Bodies>),
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
        let bodies = unsafe { bodies(o, size, context) }?;
        return Ok(Moving::Path(image, decode, Arc::new(path), bodies));
    }
    // SAFETY: as above: two poses.
    let (times_s, poses) = unsafe { stamped_poses(o.poses, 2) }?;
    Ok(Moving::Depth(image, decode, [(times_s[0], poses[0]), (times_s[1], poses[1])]))
}

impl Moving {
    /// Poses between those that were given; none where there is only motion.
    fn path(&self, o: &shutterbug_outside) -> Outcome<Option<Arc<Trajectory>>> {
        let [from, to] = match self {
            Self::Images(..) => return Ok(None),
            Self::Path(_, _, path, _) => return Ok(Some(path.clone())),
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
            Self::Path(image, decode, path, bodies) => OutsideMotion::Path {
                // SAFETY: the caller's promise.
                image: unsafe { image.pixels() },
                decode: *decode,
                path: path.clone(),
                bodies: bodies.as_ref().map(|(ids, paths)| OutsideBodies {
                    // SAFETY: the caller's promise.
                    ids: unsafe { ids.pixels() },
                    paths: paths.clone(),
                }),
                nearest_m: if o.nearest_m > 0.0 { o.nearest_m } else { f64::INFINITY },
                repeat_border: o.flags & OUTSIDE_REPEAT_BORDER != 0,
            },
        }
    }
}
