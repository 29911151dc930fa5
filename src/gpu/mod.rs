//! Explicit Vulkan, kept small: the only module that names `ash`.
//!
//! [`Context`] is the only holder of instance, device, queue and allocator. Every wrapper holds an `Arc` of it and
//! frees its own handle in `Drop`. Storage images stay in layout `VK_IMAGE_LAYOUT_GENERAL`; one global memory barrier
//! stands between dependent commands (`commands.rs`, the only file with barriers).
#![allow(unsafe_code)]

mod bind;
mod commands;
mod context;
mod graphics;
mod instance;
mod interface;
mod kernel;
mod memory;
mod open;
mod pipeline;
mod pipelines;
mod select;
mod shared;
mod shared_image;
mod slot;
mod validation;

pub use bind::{BindGroup, Bound};
pub use commands::{DrawBatch, DrawCall, Recorder, RenderArea};
pub use context::{Context, ContextOptions};
pub use graphics::{Attachments, GraphicsPipeline, GraphicsSpec, VertexFormat};
pub use instance::devices;
pub use kernel::ComputePipeline;
pub use memory::{Buffer, Format, Image, ImageSpec, Location, Sampler, Usage};
pub use open::{HostDevice, HostHandles, Loader};
pub use select::{DeviceChoice, DeviceInfo, DeviceKind};
pub use shared::{Semaphore, SemaphoreKind, Sharing, SignalAt};
pub use shared_image::{Shared, SharedFormat, SharedImage, SharedImageSpec};
pub use slot::{PassTime, Slot};
pub use validation::Validation;

use ash::vk;

use crate::error::Error;

/// Maps a Vulkan result to the error that tells a person what to do.
pub(crate) fn failed(call: &'static str) -> impl Fn(vk::Result) -> Error {
    move |result| match result {
        vk::Result::ERROR_DEVICE_LOST => Error::DeviceLost { call },
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => Error::OutOfMemory { pool: "device", call },
        vk::Result::ERROR_OUT_OF_HOST_MEMORY => Error::OutOfMemory { pool: "host", call },
        // Drivers report these where the system gave them no memory or thread, and say no more.
        vague @ (vk::Result::ERROR_INITIALIZATION_FAILED | vk::Result::ERROR_UNKNOWN) => {
            let result = format!(
                "{vague:?}; a limit of memory (ulimit -v) or of threads (ulimit -u) that is too low ends like this"
            );
            Error::Vulkan { call, result }
        }
        other => Error::Vulkan { call, result: format!("{other:?}") },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_become_errors_that_say_what_to_do() {
        let text = |result| failed("vkQueueSubmit")(result).to_string();
        assert!(matches!(
            failed("vkQueueSubmit")(vk::Result::ERROR_DEVICE_LOST),
            Error::DeviceLost { call: "vkQueueSubmit" }
        ));
        assert!(text(vk::Result::ERROR_DEVICE_LOST).contains("frames already written are complete"));
        for (result, pool) in [
            (vk::Result::ERROR_OUT_OF_DEVICE_MEMORY, "device"),
            (vk::Result::ERROR_OUT_OF_HOST_MEMORY, "host"),
        ] {
            let text = text(result);
            assert!(text.starts_with(&format!("out of {pool} memory in vkQueueSubmit: reduce")), "{text}");
        }
        assert!(text(vk::Result::ERROR_UNKNOWN).contains("memory (ulimit -v)"));
        let other = text(vk::Result::ERROR_FORMAT_NOT_SUPPORTED);
        assert_eq!(other, "vkQueueSubmit failed: ERROR_FORMAT_NOT_SUPPORTED");
    }
}
