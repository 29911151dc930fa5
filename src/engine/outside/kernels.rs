//! Pipelines of frames from outside, and their bindings.

use std::sync::{Arc, Weak};

use crate::assert_push_layout;
use crate::engine::outside::frame::{MAX_PLACES, OutsideMotion, OutsidePixels, PixelSource};
use crate::engine::outside::warp::OutsideWarp;
use crate::error::Result;
use crate::gpu::{BindGroup, Bound, Buffer, ComputePipeline, Context, Image, Location, Sampler, Usage};
use crate::kernels::kernel;
use crate::plane::PixelFormat;
use crate::reference::paper_gather::{Push as GatherPush, assert_gather_push};
use crate::reference::unpack::{BodyPush, ColorPush, DepthPush, InverseDepthPush, MotionPush, decode_table};

assert_push_layout!("unpack_color.comp", ColorPush { size, first_byte, stride_bytes, format, codes_from });
assert_push_layout!(
    "unpack_motion.comp",
    MotionPush { size, scale, first_byte, stride_bytes, format, layer }
);
assert_push_layout!(
    "unpack_depth.comp",
    DepthPush { size, first_byte, stride_bytes, metres, numerator, constant, slope }
);
assert_push_layout!(
    "unpack_color_half.comp",
    ColorPush { size, first_byte, stride_bytes, format, codes_from }
);
assert_gather_push!("outside_gather.comp");
assert_push_layout!("unpack_body.comp", BodyPush { size, first_byte, stride_bytes, id_bytes, count });
assert_push_layout!(
    "unpack_inverse_depth.comp",
    InverseDepthPush { size, first_byte, stride_bytes, numerator, constant, slope }
);

/// Colour formats, the first of all formats.
const COLOR_FORMATS: usize = PixelFormat::Rgba32f as usize;

/// The pipelines. A host gives motion or depth, hardly ever both: what only one of them needs is made with its first
/// frame.
pub(super) struct Kernels {
    /// By format, as floats and as halves: made with the first picture of a format.
    colors: [[Option<ComputePipeline>; 2]; COLOR_FORMATS],
    pub(super) gather: ComputePipeline,
    /// Unpacks motion; gathers from several motion images.
    motion: Option<[ComputePipeline; 2]>,
    depth: Option<DepthKernels>,
    path: Option<PathKernels>,
    sampler: Sampler,
    decode: Buffer,
    context: Arc<Context>,
}

/// Pipelines of frames with depth and the camera's path.
pub(super) struct PathKernels {
    pub(super) inverse_depth: ComputePipeline,
    pub(super) body: ComputePipeline,
}

/// Pipelines of frames with depth.
pub(super) struct DepthKernels {
    pub(super) unpack: ComputePipeline,
    pub(super) motion: ComputePipeline,
}

impl Kernels {
    pub(super) fn new(context: &Arc<Context>) -> Result<Self> {
        let table = decode_table();
        let bytes = size_of_val(table.as_slice()) as u64;
        let mut decode = Buffer::new(context, "decode", bytes, Usage::Texels, Location::Upload)?;
        decode.write(0, &table);
        Ok(Self {
            colors: Default::default(),
            gather: ComputePipeline::new(context, const { kernel("paper_gather.comp") })?,
            motion: None,
            depth: None,
            path: None,
            sampler: Sampler::new(context, false)?,
            decode,
            context: context.clone(),
        })
    }

    /// Makes what a frame with this kind of motion needs, if it is not there.
    pub(super) fn fit(&mut self, motion: &OutsideMotion<'_>) -> Result<()> {
        let make = |kernel| ComputePipeline::new(&self.context, kernel);
        match motion {
            OutsideMotion::Images { .. } if self.motion.is_none() => {
                let unpack = make(const { kernel("unpack_motion.comp") })?;
                self.motion = Some([unpack, make(const { kernel("outside_gather.comp") })?]);
            }
            OutsideMotion::Depth { .. } if self.depth.is_none() => {
                let unpack = make(const { kernel("unpack_depth.comp") })?;
                let motion = make(const { kernel("motion_from_depth.comp") })?;
                self.depth = Some(DepthKernels { unpack, motion });
            }
            OutsideMotion::Path { .. } if self.path.is_none() => {
                let inverse_depth = make(const { kernel("unpack_inverse_depth.comp") })?;
                let body = make(const { kernel("unpack_body.comp") })?;
                self.path = Some(PathKernels { inverse_depth, body });
            }
            OutsideMotion::Images { .. } | OutsideMotion::Depth { .. } | OutsideMotion::Path { .. } => {}
        }
        Ok(())
    }

    /// Makes what unpacks colours of a format.
    pub(super) fn fit_color(&mut self, format: PixelFormat, half: bool) -> Result<()> {
        let made = &mut self.colors[format as usize - 1][usize::from(half)];
        if made.is_none() {
            let kernel = match half {
                false => const { kernel("unpack_color.comp") },
                true => const { kernel("unpack_color_half.comp") },
            };
            *made = Some(ComputePipeline::specialized(&self.context, kernel, &[format as u32])?);
        }
        Ok(())
    }

    /// What unpacks them.
    pub(super) fn color(&self, format: PixelFormat, half: bool) -> &ComputePipeline {
        self.colors[format as usize - 1][usize::from(half)].as_ref().expect("made by `fit_color`")
    }

    /// Of frames with motion images.
    pub(super) fn motion(&self) -> &ComputePipeline {
        &self.motion.as_ref().expect("made by `fit`")[0]
    }

    /// Of frames with several.
    pub(super) fn integrated(&self) -> &ComputePipeline {
        &self.motion.as_ref().expect("made by `fit`")[1]
    }

    /// Of frames with depth.
    pub(super) fn depth(&self) -> &DepthKernels {
        self.depth.as_ref().expect("made by `fit`")
    }

    /// Of frames with depth and a path.
    pub(super) fn path(&self) -> &PathKernels {
        self.path.as_ref().expect("made by `fit`")
    }
}

/// What the pipelines are bound to, for images of one size.
pub(super) struct Groups {
    /// Made with the first frame with depth.
    from_depth: Option<BindGroup>,
    gather: BindGroup,
    /// Made with the first frame with several motion images.
    integrated: Option<BindGroup>,
    /// By slot and place (colour, then motion or depth, then those of other pictures).
    sources: Vec<[Option<Source>; MAX_PLACES]>,
}

fn gather_group(
    gather: &ComputePipeline,
    kernels: &Kernels,
    to: Unpacked<'_>,
    radiance: &Image,
) -> Result<BindGroup> {
    gather.bind(&[
        ("color", Bound::Sampled(to.color, &kernels.sampler)),
        ("motion", Bound::Storage(to.motion)),
        ("radiance", Bound::Storage(radiance)),
    ])
}

/// A group that reads a caller's picture.
struct Source {
    /// Which kernel and which picture it is for.
    role: (Role, usize),
    format: PixelFormat,
    /// The buffer that it is bound to, where it is not the slot's own. Not kept alive by this: the host may want it
    /// back once its frames are collected.
    shared: Option<Weak<Buffer>>,
    group: BindGroup,
}

/// What a picture becomes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Color,
    HalfColor,
    Motion,
    Depth,
    InverseDepth,
    Body,
}

impl Role {
    /// Of what lies at a place, and the number of the picture that it belongs to.
    pub(super) fn of(place: usize, motion: &OutsideMotion<'_>, blurs: bool) -> (Self, usize) {
        match motion {
            OutsideMotion::Path { bodies, .. } => {
                let each = 2 + usize::from(bodies.is_some());
                let color = if blurs { Self::HalfColor } else { Self::Color };
                ([color, Self::InverseDepth, Self::Body][place % each], place / each)
            }
            _ if place == 0 => (Self::Color, 0),
            OutsideMotion::Images { .. } => (Self::Motion, 0),
            OutsideMotion::Depth { .. } => (Self::Depth, 0),
        }
    }
}

/// The images that callers' pictures are unpacked into.
#[derive(Clone, Copy)]
pub(super) struct Unpacked<'a> {
    pub(super) color: &'a Image,
    pub(super) motion: &'a Image,
    pub(super) depth: &'a Image,
    /// With the images of each picture, and the numbers of the bodies.
    pub(super) warp: Option<&'a OutsideWarp>,
}

impl Groups {
    pub(super) fn new(kernels: &Kernels, to: Unpacked<'_>, radiance: &Image, slots: usize) -> Result<Self> {
        Ok(Self {
            from_depth: None,
            gather: gather_group(&kernels.gather, kernels, to, radiance)?,
            integrated: None,
            sources: (0..slots).map(|_| Default::default()).collect(),
        })
    }

    /// The warp's images are replaced.
    pub(super) fn forget_warp(&mut self) {
        let of_warp = |s: &Source| {
            matches!(s.role.0, Role::HalfColor | Role::InverseDepth | Role::Body) || s.role.1 > 0
        };
        let all = self.sources.iter_mut().flatten();
        all.filter(|s| s.as_ref().is_some_and(of_warp)).for_each(|s| *s = None);
    }

    /// A slot's buffer at this place was replaced.
    pub(super) fn forget(&mut self, slot: usize, place: usize) {
        self.sources[slot][place] = None;
    }

    /// Binds the pictures of a slot that is not in flight; steady while the same buffers come again.
    pub(super) fn bind_sources(
        &mut self,
        kernels: &Kernels,
        slot: usize,
        to: Unpacked<'_>,
        (pictures, role_of): (&[OutsidePixels<'_>], impl Fn(usize) -> (Role, usize)),
        uploads: &[Option<Buffer>],
    ) -> Result<()> {
        for (place, pixels) in pictures.iter().enumerate() {
            let role = role_of(place);
            let (buffer, shared) = match pixels.source {
                PixelSource::Host(_) | PixelSource::Image(_) => {
                    (uploads[place].as_ref().expect("filled by `upload`"), None)
                }
                PixelSource::Shared(buffer, _) => (&**buffer, Some(buffer)),
            };
            // A weak reference keeps its address from being used again.
            let same = |s: &Source| {
                (s.role, s.format) == (role, pixels.format)
                    && s.shared.as_ref().map(Weak::as_ptr) == shared.map(Arc::as_ptr)
            };
            if self.sources[slot][place].as_ref().is_some_and(same) {
                continue;
            }
            let source = ("Source", Bound::Buffer(buffer));
            let decode = ("decode", Bound::Buffer(&kernels.decode));
            let warp = || to.warp.expect("made by `fit_warp`");
            let picture = || &warp().pictures[role.1];
            let group = match role.0 {
                Role::Color => {
                    let own = (role.1 > 0).then(|| picture().color.as_ref()).flatten();
                    let color = ("color", Bound::Storage(own.unwrap_or(to.color)));
                    kernels.color(pixels.format, false).bind(&[source, color, decode])
                }
                Role::HalfColor => {
                    let color = ("color", Bound::Storage(&picture().half));
                    kernels.color(pixels.format, true).bind(&[source, color, decode])
                }
                Role::InverseDepth => {
                    let depth = ("inverse_depth", Bound::Storage(&picture().inverse_depth));
                    kernels.path().inverse_depth.bind(&[source, depth])
                }
                Role::Body => {
                    let numbers = ("BodyIds", Bound::Buffer(&warp().numbers[slot]));
                    let depth = ("inverse_depth", Bound::Storage(&picture().inverse_depth));
                    kernels.path().body.bind(&[source, depth, numbers])
                }
                Role::Motion => kernels.motion().bind(&[source, ("motion", Bound::Storage(to.motion))]),
                Role::Depth => kernels.depth().unpack.bind(&[source, ("depth", Bound::Storage(to.depth))]),
            };
            self.sources[slot][place] = Some(Source {
                role,
                format: pixels.format,
                shared: shared.map(Arc::downgrade),
                group: group?,
            });
        }
        Ok(())
    }

    /// Binds what makes motion from depth, if it is not bound.
    pub(super) fn fit_depth(&mut self, kernels: &Kernels, to: Unpacked<'_>) -> Result<()> {
        if self.from_depth.is_none() {
            let (depth, motion) = (Bound::Storage(to.depth), Bound::Storage(to.motion));
            self.from_depth = Some(kernels.depth().motion.bind(&[("depth", depth), ("motion", motion)])?);
        }
        Ok(())
    }

    /// Binds the gather from several motion images, if it is not bound.
    pub(super) fn fit_integrated(
        &mut self,
        kernels: &Kernels,
        to: Unpacked<'_>,
        radiance: &Image,
    ) -> Result<()> {
        if self.integrated.is_none() {
            self.integrated = Some(gather_group(kernels.integrated(), kernels, to, radiance)?);
        }
        Ok(())
    }

    /// Name, kernel and group of the gather for this number of motion images.
    pub(super) fn gather_of<'a>(
        &'a self,
        kernels: &'a Kernels,
        images: u32,
    ) -> (&'static str, &'a ComputePipeline, &'a BindGroup) {
        match self.integrated.as_ref().filter(|_| images > 1) {
            Some(group) => ("outside_gather", kernels.integrated(), group),
            None => ("paper_gather", &kernels.gather, &self.gather),
        }
    }

    /// Its group.
    pub(super) fn depth_group(&self) -> &BindGroup {
        self.from_depth.as_ref().expect("bound by `fit_depth`")
    }

    /// The group of a slot's picture.
    pub(super) fn source(&self, slot: usize, place: usize) -> &BindGroup {
        &self.sources[slot][place].as_ref().expect("bound by `bind_sources`").group
    }
}
