//! A device for tests, with the validation layer on: any message fails the test.
#![allow(dead_code, clippy::unwrap_used)]

pub mod bench;
pub mod frames;
pub mod scenes;

use std::cell::Cell;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use shutterbug::Error;
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, Validation};

/// A context that fails the test when the validation layer had anything to say.
pub struct Watched(pub Arc<Context>, Turn);

/// The right to use the validation layer. The layer (seen with 1.3.239) finds a device's data in a table without a
/// lock: where one thread makes or destroys a device while another calls, about one run in a hundred crashes inside the
/// layer. Tests of one process therefore take turns. Without the layer they need not.
pub struct Turn(Option<MutexGuard<'static, ()>>);

thread_local! { static HAS_TURN: Cell<bool> = const { Cell::new(false) }; }

impl Turn {
    /// Waits for the other threads; a thread that has its turn already keeps it.
    pub fn take() -> Self {
        static LAYER: Mutex<()> = Mutex::new(());
        let has_turn = HAS_TURN.replace(true);
        Self((!has_turn).then(|| LAYER.lock().unwrap_or_else(PoisonError::into_inner)))
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        if self.0.is_some() {
            HAS_TURN.set(false);
        }
    }
}

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
    let turn = Turn::take();
    match Context::new(&ContextOptions { device, validation: Validation::Required }) {
        Ok(context) => Some(Watched(context, turn)),
        Err(error) if std::env::var_os("SHUTTERBUG_REQUIRE_DEVICE").is_some() => panic!("{test}: {error}"),
        Err(error @ (Error::NoDevice { .. } | Error::NoVulkanLoader { .. } | Error::DeviceLacks { .. })) => {
            eprintln!("SKIPPED {test}: {error}");
            None
        }
        Err(error) => panic!("{test}: {error}"),
    }
}
