//! An engine's log function hears it though another engine, without one, passes the same place in the code for the
//! first time while the first is being made. Alone in its file: `tracing` keeps who listens for the whole process.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

#[path = "../support/capi/mod.rs"]
mod capi_support;

use std::ffi::{CStr, c_char, c_void};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, mpsc};
use std::time::Duration;

use capi_support::*;
use shutterbug::capi::*;
use tracing::subscriber::Interest;
use tracing::{Dispatch, Event, Metadata, Subscriber, span};

/// What the log function was told.
static TOLD: Mutex<Vec<String>> = Mutex::new(Vec::new());

unsafe extern "C" fn tell(_: *mut c_void, _: u32, text: *const c_char) {
    TOLD.lock().unwrap().push(unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned());
}

/// Takes nothing, and is slow to say so: once, on the thread that is asked first, until the other has had its time.
struct Slow {
    asked: Mutex<mpsc::Sender<()>>,
    go_on: Mutex<mpsc::Receiver<()>>,
    armed: AtomicBool,
}

impl Subscriber for Slow {
    fn register_callsite(&self, _: &'static Metadata<'static>) -> Interest {
        if self.armed.swap(false, Ordering::SeqCst) {
            self.asked.lock().unwrap().send(()).unwrap();
            // A lock that the other thread waits for must not hold for ever.
            let _ = self.go_on.lock().unwrap().recv_timeout(Duration::from_millis(500));
        }
        Interest::never()
    }
    fn enabled(&self, _: &Metadata<'_>) -> bool {
        false
    }
    fn new_span(&self, _: &span::Attributes<'_>) -> span::Id {
        span::Id::from_u64(1)
    }
    fn record(&self, _: &span::Id, _: &span::Record<'_>) {}
    fn record_follows_from(&self, _: &span::Id, _: &span::Id) {}
    fn event(&self, _: &Event<'_>) {}
    fn enter(&self, _: &span::Id) {}
    fn exit(&self, _: &span::Id) {}
}

/// Sets a camera that the library warns of.
fn set_camera(engine: usize) {
    let mut slow = camera(16, 12);
    slow.readout_time_s = 2.0 * slow.frame_period_s;
    must(unsafe { shutterbug_engine_set_camera(engine as Handle, &slow) }, engine as Handle);
}

#[test]
fn a_log_is_heard_though_another_engine_passes_first_while_it_is_made() {
    let test = "a_log_is_heard_though_another_engine_passes_first_while_it_is_made";
    let ((asked, was_asked), (go, go_on)) = (mpsc::channel(), mpsc::channel());
    let slow = Slow { asked: asked.into(), go_on: go_on.into(), armed: AtomicBool::new(false) };
    // Before any engine: the first subscriber of the process.
    let slow = std::sync::Arc::new(slow);
    let listener = Dispatch::new(slow.clone());
    let Some(silent) = engine(test, options(2, 0)) else { return };
    let silent = silent as usize;
    slow.armed.store(true, Ordering::SeqCst);
    let first =
        std::thread::spawn(move || tracing::dispatcher::with_default(&listener, || set_camera(silent)));
    was_asked.recv_timeout(Duration::from_secs(20)).expect("control: the silent engine has something to say");
    let mut o = options(2, 0);
    o.log = Some(tell);
    let heard = create(o).unwrap() as usize;
    let _ = go.send(());
    first.join().unwrap();
    assert!(TOLD.lock().unwrap().is_empty(), "control: the silent engine's own words are nobody's");
    set_camera(heard);
    let told = TOLD.lock().unwrap().join("\n");
    assert!(told.contains("longer than frame_period_s"), "not heard: `{told}`");
    for engine in [silent, heard] {
        finish(engine as Handle);
    }
}
