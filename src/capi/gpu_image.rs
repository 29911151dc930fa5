//! Images of the host's GPU, behind handles of shared memory.

use std::sync::Arc;

use super::Handle;
use super::sharing::{check_fd, check_out, make_memory, on_host_device};
use super::status::{self, Fault, Outcome, Status};
use super::types::{read, shutterbug_gpu_image};
use crate::gpu::{Context, Shared, SharedFormat, SharedImage, SharedImageSpec};

/// The caller's description of an image, checked.
///
/// # Safety
/// As for [`read`].
unsafe fn image_spec(
    image: *const shutterbug_gpu_image,
    context: &Context,
) -> Outcome<(SharedImageSpec, shutterbug_gpu_image)> {
    // SAFETY: the caller's promise.
    let image = unsafe { read(image) }?;
    let (size, limit) = ([image.width, image.height], context.info().max_image_side_px);
    if let Some(side) = size.iter().find(|&&s| s == 0 || s > limit) {
        let text =
            format!("shutterbug_gpu_image: a side of {side} px; the device has images of 1 to {limit} px");
        return Err(Fault::new(status::LIMIT, text));
    }
    let after = if image.vk_layout_after == 0 { image.vk_layout } else { image.vk_layout_after };
    if after == 0 {
        let text =
            "shutterbug_gpu_image: vk_layout_after is needed where vk_layout is VK_IMAGE_LAYOUT_UNDEFINED";
        return Err(Fault::argument(text));
    }
    for (name, layout, first) in [("vk_layout", image.vk_layout, true), ("vk_layout_after", after, false)] {
        if !is_layout(layout, first) {
            let text = format!("shutterbug_gpu_image.{name} is {layout}, no layout of an image with colour");
            return Err(Fault::argument(text));
        }
    }
    if image.vk_usage & !USAGES != 0 {
        let text = format!(
            "shutterbug_gpu_image.vk_usage is {:#x}, with bits that no image here has",
            image.vk_usage
        );
        return Err(Fault::argument(text));
    }
    let number = |name: &str, value: u32| {
        i32::try_from(value).map_err(|_| Fault::argument(format!("shutterbug_gpu_image.{name} is {value}")))
    };
    let spec = SharedImageSpec {
        size,
        format: number("vk_format", image.vk_format)?,
        layout: number("vk_layout", image.vk_layout)?,
        layout_after: number("vk_layout_after", after)?,
        tiling: number("vk_tiling", image.vk_tiling)?,
        usage: image.vk_usage,
    };
    if SharedFormat::of(spec.format).is_none() {
        let text = format!("shutterbug_gpu_image.vk_format is {}, none of those in the header", spec.format);
        return Err(Fault::new(status::FORMAT, text));
    }
    Ok((spec, image))
}

/// Transfer, sampled, storage, colour attachment and input attachment.
const USAGES: u32 = 0x9f;

/// Whether an image with colour can be in a layout; `first`: when it is handed over, where it may also be new.
fn is_layout(layout: u32, first: bool) -> bool {
    match layout {
        // VK_IMAGE_LAYOUT_UNDEFINED, _PREINITIALIZED: found so, but never brought to.
        0 | 8 => first,
        // _GENERAL, _COLOR_ATTACHMENT_OPTIMAL, _SHADER_READ_ONLY_OPTIMAL, _TRANSFER_SRC_OPTIMAL, _TRANSFER_DST_OPTIMAL
        1 | 2 | 5 | 6 | 7 => true,
        // _PRESENT_SRC_KHR, _SHARED_PRESENT_KHR, _READ_ONLY_OPTIMAL, _ATTACHMENT_OPTIMAL
        1_000_001_002 | 1_000_111_000 | 1_000_314_000 | 1_000_314_001 => true,
        _ => false,
    }
}

/// What an image that is made here must be: `TRANSFER_SRC` or `TRANSFER_DST` are the copies of a frame.
fn check_made(spec: &SharedImageSpec, image: &shutterbug_gpu_image) -> Outcome<()> {
    if image.vk_image != 0 {
        return Err(Fault::argument("shutterbug_gpu_image.vk_image is for shutterbug_memory_use_image only"));
    }
    if spec.tiling > 1 || spec.usage & 3 == 0 {
        let text = "shutterbug_gpu_image: vk_tiling is optimal (0) or linear (1), vk_usage holds \
                    VK_IMAGE_USAGE_TRANSFER_SRC_BIT for inputs, VK_IMAGE_USAGE_TRANSFER_DST_BIT for outputs";
        return Err(Fault::argument(text));
    }
    Ok(())
}

/// `shutterbug_memory_use_image`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_memory_use_image(
    engine: Handle,
    image: *const shutterbug_gpu_image,
    memory: *mut Handle,
) -> Status {
    // SAFETY: the caller's promise, in all of it.
    unsafe {
        make_memory(engine, memory, |context| {
            let (spec, image) = image_spec(image, context)?;
            if image.vk_image == 0 {
                return Err(Fault::argument("shutterbug_gpu_image.vk_image is null"));
            }
            on_host_device(context, "images")?;
            Ok(Shared::Image(Arc::new(SharedImage::of_host(context, image.vk_image, spec)?)))
        })
    }
}

/// `shutterbug_memory_import_image_fd`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_memory_import_image_fd(
    engine: Handle,
    image: *const shutterbug_gpu_image,
    fd: i32,
    bytes: u64,
    memory: *mut Handle,
) -> Status {
    // SAFETY: the caller's promise, in all of it.
    unsafe {
        make_memory(engine, memory, |context| {
            let (spec, image) = image_spec(image, context)?;
            check_made(&spec, &image)?;
            check_fd(fd)?;
            Ok(Shared::Image(Arc::new(SharedImage::import_fd(context, spec, fd, bytes)?)))
        })
    }
}

/// `shutterbug_memory_export_image_fd`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_memory_export_image_fd(
    engine: Handle,
    image: *const shutterbug_gpu_image,
    memory: *mut Handle,
    fd: *mut i32,
    bytes: *mut u64,
) -> Status {
    // SAFETY: the caller's promise, in all of it.
    unsafe {
        make_memory(engine, memory, |context| {
            let (spec, image) = image_spec(image, context)?;
            check_made(&spec, &image)?;
            check_out(fd, "fd")?;
            check_out(bytes, "bytes")?;
            let made = SharedImage::exportable(context, spec)?;
            let exported = made.export_fd()?;
            // SAFETY: not null and aligned; writable by the caller's promise.
            fd.write(exported.0);
            bytes.write(exported.1);
            Ok(Shared::Image(Arc::new(made)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::is_layout;

    #[test]
    fn layouts_that_no_image_with_colour_can_have_are_told() {
        for layout in [1, 2, 5, 6, 7, 1_000_001_002] {
            assert!(is_layout(layout, true) && is_layout(layout, false), "{layout}");
        }
        assert!(is_layout(8, true) && !is_layout(8, false), "preinitialised is found, never made");
        // Depth and stencil, and numbers of nothing.
        for layout in [3, 4, 9, 77, 1_000_001_003, u32::MAX] {
            assert!(!is_layout(layout, true) && !is_layout(layout, false), "{layout}");
        }
    }
}
