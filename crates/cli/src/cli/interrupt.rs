//! Ctrl-C and SIGTERM: finish what is in flight, then stop.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

/// Set once the user asks to stop.
#[derive(Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

/// A process can have one handler: whoever listens later listens to the same.
static HEARD: LazyLock<Interrupt> = LazyLock::new(Interrupt::handle);

impl Interrupt {
    /// Listens for the signals. A second signal ends the process at once.
    pub fn listen() -> Self {
        HEARD.clone()
    }

    fn handle() -> Self {
        let interrupt = Self::default();
        let flag = interrupt.0.clone();
        let set = ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::SeqCst) {
                // 130 is what shells report for a process ended by SIGINT.
                std::process::exit(130);
            }
        });
        if let Err(error) = set {
            tracing::warn!("an interruption cannot be caught, it will end the run at once: {error}");
        }
        interrupt
    }

    /// What becomes true.
    pub fn flag(&self) -> Arc<AtomicBool> {
        self.0.clone()
    }

    /// Whether to stop.
    pub fn requested(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}
