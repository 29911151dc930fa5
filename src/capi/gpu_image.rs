//! Images of the host's GPU, behind handles of shared memory.

use std::sync::Arc;

use super::Handle;
use super::sharing::{check_fd, check_out, make_memory};
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

pub(super) fn on_host_device(context: &Context, what: &str) -> Outcome<()> {
    if context.is_host_device() {
        return Ok(());
    }
    let text = format!(
        "the engine has a device of its own: {what} of another one are shared by file descriptor, or create the engine \
         on your device (shutterbug_engine_options.host)"
    );
    Err(Fault::new(status::UNSUPPORTED, text))
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
