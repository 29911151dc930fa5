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
use crate::engine::{Delivery, MAX_OUTSIDE_MOTIONS, OutsideFrame, OutsideMotion, OutsidePixels, PixelSource};
use crate::gpu::{Context, Shared, SharedFormat, SharedImageSpec};
use crate::plane::PixelFormat;
use crate::reference::unpack::Encoding;

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
        what: &str,
        size: [u32; 2],
        context: &Arc<Context>,
    ) -> Outcome<Self> {
        // SAFETY: the caller's promise.
        let mut image = unsafe { read(image) }?;
        let shared = match image.memory.is_null() {
            true => None,
            false => Some(sharing::shared(image.memory as usize, context)?),
        };
        if let Some(Shared::Image(on_device)) = &shared {
            as_if_packed(&mut image, what, (format_of(on_device.format()), on_device.spec()))?;
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

    fn require(&self, what: &str, ok: bool, formats: &str) -> Outcome<()> {
        if ok {
            return Ok(());
        }
        Err(Fault::new(status::FORMAT, format!("{what} is {formats}, not {:?}", self.view.format)))
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
    let request = session.outside_request(o.frame_index, o.time_s)?;
    let context = session.context().clone();
    let camera = session.camera().expect("the request has one").intrinsics;
    let margin_px = [o.margin_x_px, o.margin_y_px];
    if margin_px[0] > camera.width || margin_px[1] > camera.height {
        return Err(Fault::new(status::LIMIT, "the margin is at most the camera's own width and height"));
    }
    let wider = camera.with_margin(margin_px);
    let size = [wider.width, wider.height];
    // SAFETY: the caller's promise.
    let color = unsafe { Picture::new(o.color, "color", size, &context) }?;
    color.require("color", color.view.format.is_color(), "RGB8, RGBA8, BGRA8, RGBA16F or RGBA32F")?;
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
    if o.flags != 0 || o.reserved != 0 || o.encoding > 1 {
        return Err(Fault::argument("shutterbug_outside: unknown flags or encoding, or reserved is not 0"));
    }
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

/// Checked motion or depth.
enum Moving {
    Images(Vec<Picture>, [f32; 2]),
    Depth(Picture, Option<[f32; 3]>, [(f64, Pose); 2]),
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
            let image = unsafe { Picture::new(o.motions.add(k), "motion", size, context) }?;
            image.require("motion", image.view.format.is_motion(), "RG16F or RG32F")?;
            images.push(image);
        }
        return Ok(Moving::Images(images, motion_scale(&convention, size, frame_interval_s)?));
    }
    // SAFETY: the caller's promise.
    let image = unsafe { Picture::new(o.depth, "depth", size, context) }?;
    image.require("depth", image.view.format == PixelFormat::R32f, "R32F")?;
    // SAFETY: as above.
    let decode = depth_decode(&unsafe { read(o.depth_convention) }?)?;
    // SAFETY: as above: two poses.
    let (times_s, poses) = unsafe { stamped_poses(o.poses, 2) }?;
    Ok(Moving::Depth(image, decode, [(times_s[0], poses[0]), (times_s[1], poses[1])]))
}

impl Moving {
    /// Poses between the two that were given; none where there is only motion.
    fn path(&self, o: &shutterbug_outside) -> Outcome<Option<Arc<Trajectory>>> {
        let Self::Depth(_, _, [from, to]) = self else { return Ok(None) };
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
        }
    }
}
