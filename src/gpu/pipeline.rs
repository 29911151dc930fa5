//! A pipeline in use.

use std::ops::Deref;
use std::sync::Arc;

use ash::vk;

use super::context::Context;
use super::interface::Interface;
use super::pipelines::{Key, Made};
use crate::error::Result;
use crate::kernels::Kernel;

/// A user's hold on a pipeline, which others may use as well.
pub(super) struct Pipeline {
    made: Arc<Made>,
    key: Key,
    pub(super) context: Arc<Context>,
}

impl Pipeline {
    /// The pipeline of these kernels and of all else it depends on. Where the device has none yet, `make` makes it for
    /// a layout of what the kernels bind.
    ///
    /// # Errors
    /// Out of memory; those of `make`.
    pub(super) fn of(
        context: &Arc<Context>,
        (kernels, stages): (&[&'static Kernel], vk::ShaderStageFlags),
        state: Vec<u32>,
        make: impl FnOnce(vk::PipelineLayout) -> Result<vk::Pipeline>,
    ) -> Result<Self> {
        let (context, key) = (context.clone(), Key::new(kernels, state));
        if let Some(made) = context.pipelines.find(&key) {
            return Ok(Self { made, key, context });
        }
        context.count_allocation();
        let interface = Interface::new(&context.device, kernels, stages)?;
        let made = Made::with(&context.device, interface, make)?;
        let (made, late) = context.pipelines.insert(&key, made);
        if let Some(late) = late {
            // SAFETY: nobody but this thread knows of it.
            unsafe { late.destroy(&context.device) };
        }
        Ok(Self { made, key, context })
    }
}

impl Deref for Pipeline {
    type Target = Made;

    fn deref(&self) -> &Made {
        &self.made
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        let idle = self.context.pipelines.release(&self.key);
        if let Some(made) = idle.filter(|_| self.context.alive()) {
            // SAFETY: slots wait for their work before pipelines are dropped, and this one had no user left.
            unsafe { made.destroy(&self.context.device) };
        }
    }
}
