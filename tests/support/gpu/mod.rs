//! A device for tests, with the validation layer on: any message fails the test.
#![allow(dead_code, clippy::unwrap_used)]

pub mod bench;
pub mod frames;
pub mod scenes;

use std::cell::Cell;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use shutterbug::Error;
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, Validation};

/// A context that fails the test when the validation layer had anything to say meanwhile.
pub struct Watched(pub Arc<Context>, Lent, Turn);

/// Tests that get the same context one after another: what an engine's pipelines take the driver and the layer is more
/// than half of the time of most tests, and a context keeps them. Not more, for only with a device that is destroyed
/// does the layer tell what was left on it.
const TESTS_OF_A_CONTEXT: usize = 16;

/// What the tests have of a context that they share.
pub struct Lent {
    /// Messages before this test.
    messages: usize,
    /// Tests that had it before; none where this test made it for itself.
    uses: Option<usize>,
}

/// The context that waits for the next test.
static KEPT: Mutex<Option<(Arc<Context>, usize)>> = Mutex::new(None);

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
        if std::thread::panicking() {
            return;
        }
        let messages = self.0.validation_messages().split_off(self.1.messages);
        assert!(messages.is_empty(), "the validation layer reports:\n{}", messages.join("\n"));
        if let Some(uses) = self.1.uses.filter(|n| n + 1 < TESTS_OF_A_CONTEXT) {
            *kept() = Some((self.0.clone(), uses + 1));
        }
    }
}

fn kept() -> MutexGuard<'static, Option<(Arc<Context>, usize)>> {
    KEPT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The device that `SHUTTERBUG_DEVICE` names, else the first. Without one the test is skipped by name, or fails where
/// `SHUTTERBUG_REQUIRE_DEVICE` is set.
pub fn device(test: &str) -> Option<Watched> {
    let device = DeviceChoice::from_option_or_environment(None);
    let turn = Turn::take();
    // A test that asks for a second one gets one of its own.
    if turn.0.is_some()
        && let Some((context, uses)) = kept().take()
    {
        let messages = context.validation_messages().len();
        return Some(Watched(context, Lent { messages, uses: Some(uses) }, turn));
    }
    let uses = turn.0.is_some().then_some(0);
    match Context::new(&ContextOptions { device, validation: Validation::Required }) {
        Ok(context) => Some(Watched(context, Lent { messages: 0, uses }, turn)),
        Err(error) if std::env::var_os("SHUTTERBUG_REQUIRE_DEVICE").is_some() => panic!("{test}: {error}"),
        Err(error @ (Error::NoDevice { .. } | Error::NoVulkanLoader { .. } | Error::DeviceLacks { .. })) => {
            eprintln!("SKIPPED {test}: {error}");
            None
        }
        Err(error) => panic!("{test}: {error}"),
    }
}
