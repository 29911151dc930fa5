//! A pipeline in use.

use std::ops::Deref;
use std::sync::Arc;

use super::context::Context;
use super::pipelines::{Key, Made};
use crate::error::Result;

/// A user's hold on a pipeline, which others may use as well.
pub(super) struct Pipeline {
    made: Arc<Made>,
    key: Key,
    pub(super) context: Arc<Context>,
}

impl Pipeline {
    /// The pipeline of `key`, made by `make` where the device has none yet.
    ///
    /// # Errors
    /// Those of `make`.
    pub(super) fn of(context: &Arc<Context>, key: Key, make: impl FnOnce() -> Result<Made>) -> Result<Self> {
        let context = context.clone();
        if let Some(made) = context.pipelines.find(&key) {
            return Ok(Self { made, key, context });
        }
        context.count_allocation();
        let (made, late) = context.pipelines.insert(&key, make()?);
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
