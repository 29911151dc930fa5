//! Pictures of a frame from outside: checks of each against its use and the camera.

use std::sync::Arc;

use super::image::{BOTTOM_UP, View};
use super::sharing;
use super::status::{self, Fault, Outcome};
use super::types::*;
use crate::engine::{OutsidePixels, PixelSource};
use crate::gpu::{Context, Shared, SharedFormat, SharedImageSpec};
use crate::plane::PixelFormat;

/// A checked picture, with what it lies in if it is shared.
pub(super) struct Picture {
    view: View,
    shared: Option<Shared>,
}

impl Picture {
    /// # Safety
    /// The header's promise for the image.
    pub(super) unsafe fn new(
        image: *const shutterbug_image,
        (what, kind): (&str, Kind),
        size: [u32; 2],
        context: &Arc<Context>,
    ) -> Outcome<Self> {
        // SAFETY: the caller's promise.
        let mut image = unsafe { named(image, what) }?;
        let shared = match image.memory.is_null() {
            true => None,
            false => Some(sharing::shared(image.memory as usize, context)?),
        };
        if let Some(Shared::Image(on_device)) = &shared {
            as_if_packed(&mut image, what, (format_of(on_device.format()), on_device.spec()))?;
        }
        // Before its rows: their least size is that of its format.
        if let Some(format) = PixelFormat::from_code(image.format & !BOTTOM_UP).filter(|f| !kind.takes(*f)) {
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

    /// Width and height, px.
    pub(super) fn size(&self) -> [u32; 2] {
        self.view.size
    }

    /// # Safety
    /// The header's promise for the image.
    pub(super) unsafe fn pixels(&self) -> OutsidePixels<'_> {
        let source = match &self.shared {
            Some(Shared::Buffer(buffer)) => PixelSource::Shared(buffer, self.view.memory_offset),
            Some(Shared::Image(image)) => PixelSource::Image(image),
            // SAFETY: the caller's promise.
            None => PixelSource::Host(unsafe { self.view.read() }),
        };
        let (format, stride_bytes, bottom_up) = (self.view.format, self.view.stride, self.view.bottom_up);
        OutsidePixels { format, stride_bytes, bottom_up, source }
    }
}

/// What a picture is for.
#[derive(Clone, Copy)]
pub(super) enum Kind {
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
    let flipped = image.format & BOTTOM_UP;
    if image.format != flipped && image.format != format as u32 | flipped {
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
    image.format = format as u32 | flipped;
    image.stride_bytes = u64::from(image.width) * format.bytes() as u64;
    Ok(())
}
