//! Motion of a frame from outside, on the device: motion images are unpacked or made from depth; depth and body ids are
//! prepared for the warp.

use crate::camera::NEAR_M;
use crate::engine::outside::frame::{OutsideFrame, OutsideMotion, OutsidePixels, PixelSource};
use crate::engine::outside::kernels::{Groups, Kernels, Role};
use crate::gpu::{Recorder, Shared};
use crate::plane::PixelFormat;
use crate::reference::motion_from_depth::Push as FromDepthPush;
use crate::reference::unpack::{BodyPush, ColorPush, DepthPush, Encoding, InverseDepthPush, MotionPush};

/// The motion images of a frame: unpacked, or made from depth.
pub(super) struct MotionPass<'a> {
    pub(super) kernels: &'a Kernels,
    pub(super) groups: &'a Groups,
    /// The frame's slot.
    pub(super) index: usize,
    pub(super) size: [u32; 2],
    /// First byte and stride of what lies at each place.
    pub(super) placed: &'a [(u32, u32)],
}

/// The colour of a picture.
struct ColorPass {
    place: usize,
    format: PixelFormat,
    encoding: Encoding,
    half: bool,
}

impl MotionPass<'_> {
    pub(super) fn record(
        &self,
        recorder: &mut Recorder<'_>,
        motion: &OutsideMotion<'_>,
        from_depth: Option<FromDepthPush>,
    ) {
        let (kernels, groups, size) = (self.kernels, self.groups, self.size);
        match motion {
            OutsideMotion::Images { images, scale, .. } => {
                for (k, (image, &(first_byte, stride_bytes))) in
                    images.iter().zip(&self.placed[1..]).enumerate()
                {
                    let (format, layer) = (image.format as u32, k as u32);
                    let push = MotionPush { size, scale: *scale, first_byte, stride_bytes, format, layer };
                    recorder.dispatch(kernels.motion(), groups.source(self.index, k + 1), &push, size);
                }
            }
            OutsideMotion::Depth { decode, .. } => {
                let (first_byte, stride_bytes) = self.placed[1];
                let [numerator, constant, slope] = decode.unwrap_or([0.0; 3]);
                let metres = decode.is_none().into();
                let push = DepthPush { size, first_byte, stride_bytes, metres, numerator, constant, slope };
                recorder.dispatch(&kernels.depth().unpack, groups.source(self.index, 1), &push, size);
                recorder.mark("motion");
                let push = from_depth.expect("computed for depth");
                recorder.dispatch(&kernels.depth().motion, groups.depth_group(), &push, size);
            }
            OutsideMotion::Path { .. } => unreachable!("warped, not gathered"),
        }
    }

    /// Colours, and depth and bodies of frames with a path, as the gather or the warp reads them.
    pub(super) fn record_pictures(
        &self,
        recorder: &mut Recorder<'_>,
        frame: &OutsideFrame<'_>,
        pictures: &[OutsidePixels<'_>],
    ) {
        let blurs = frame.request.shutter.exposure_time_s > 0.0;
        for (place, pixels) in pictures.iter().enumerate() {
            match Role::of(place, &frame.motion, blurs) {
                (role @ (Role::Color | Role::HalfColor), _) => {
                    let (format, encoding) = (pixels.format, frame.encoding);
                    let color = ColorPass { place, format, encoding, half: role == Role::HalfColor };
                    self.record_color(recorder, color);
                }
                (Role::InverseDepth, picture) => self.record_inverse_depth(recorder, &frame.motion, picture),
                _ => {}
            }
        }
    }

    /// A colour as the gather or the warp reads it.
    fn record_color(&self, recorder: &mut Recorder<'_>, color: ColorPass) {
        let (first_byte, stride_bytes) = self.placed[color.place];
        let codes_from = if color.encoding == Encoding::Linear { 256 } else { 0 };
        let push =
            ColorPush { size: self.size, first_byte, stride_bytes, format: color.format as u32, codes_from };
        let kernel = self.kernels.color(color.format, color.half);
        recorder.dispatch(kernel, self.groups.source(self.index, color.place), &push, self.size);
    }

    /// The depth of a picture as the warp reads it.
    fn record_inverse_depth(&self, recorder: &mut Recorder<'_>, motion: &OutsideMotion<'_>, picture: usize) {
        let OutsideMotion::Path { decode, bodies, .. } = motion else { unreachable!("gathered, not warped") };
        let place = picture * (2 + usize::from(bodies.is_some())) + 1;
        let (first_byte, stride_bytes) = self.placed[place];
        // metres = n / (c + s value), so near / metres = near c / n + (near s / n) value; at our own near distance
        // exact.
        let [numerator, constant, slope] = match decode {
            None => [NEAR_M as f32, 0.0, 0.0],
            Some([n, c, s]) => [0.0, *c, *s].map(|v| (NEAR_M * f64::from(v) / f64::from(*n)) as f32),
        };
        let push = InverseDepthPush { size: self.size, first_byte, stride_bytes, numerator, constant, slope };
        let kernel = &self.kernels.path().inverse_depth;
        recorder.dispatch(kernel, self.groups.source(self.index, place), &push, self.size);
        if let Some(bodies) = bodies {
            let count = bodies.paths.len() as u32;
            let ((first_byte, stride_bytes), id_bytes) =
                (self.placed[place + 1], bodies.ids.format.bytes() as u32);
            let push = BodyPush { size: self.size, first_byte, stride_bytes, id_bytes, count };
            let kernel = &self.kernels.path().body;
            recorder.dispatch(kernel, self.groups.source(self.index, place + 1), &push, self.size);
        }
    }
}

/// What a picture is read from, if it is the caller's.
pub(super) fn shared(pixels: &OutsidePixels<'_>) -> Option<Shared> {
    match pixels.source {
        PixelSource::Host(_) => None,
        PixelSource::Shared(buffer, _) => Some(Shared::Buffer(buffer.clone())),
        PixelSource::Image(image) => Some(Shared::Image(image.clone())),
    }
}
