//! A device for tests, with the validation layer on: any message fails the test.
#![allow(dead_code, clippy::unwrap_used)]

pub mod bench;
pub mod frames;
pub mod scenes;

use std::sync::Arc;

use shutterbug::Error;
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, Validation};

/// A context that fails the test when the validation layer had anything to say.
pub struct Watched(pub Arc<Context>);

impl Drop for Watched {
    fn drop(&mut self) {
        let messages = self.0.validation_messages();
        if !std::thread::panicking() {
            assert!(messages.is_empty(), "the validation layer reports:\n{}", messages.join("\n"));
        }
    }
}

/// The device that `SHUTTERBUG_DEVICE` names, else the first. Without one the test is skipped by name, or fails where
/// `SHUTTERBUG_REQUIRE_DEVICE` is set.
pub fn device(test: &str) -> Option<Watched> {
    let device = DeviceChoice::from_option_or_environment(None);
    match Context::new(&ContextOptions { device, validation: Validation::Required }) {
        Ok(context) => Some(Watched(context)),
        Err(error) if std::env::var_os("SHUTTERBUG_REQUIRE_DEVICE").is_some() => panic!("{test}: {error}"),
        Err(error @ (Error::NoDevice { .. } | Error::NoVulkanLoader { .. } | Error::DeviceLacks { .. })) => {
            eprintln!("SKIPPED {test}: {error}");
            None
        }
        Err(error) => panic!("{test}: {error}"),
    }
}
