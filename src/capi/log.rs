//! Hands the log messages of one engine's calls to the host's function. Nothing is installed for the process: a
//! subscriber is active only during a call on the engine, on the thread that makes the call.

use std::ffi::{CString, c_char, c_void};
use std::fmt::Write as _;
use std::sync::OnceLock;

use tracing::field::{Field, Visit};
use tracing::subscriber::NoSubscriber;
use tracing::{Dispatch, Event, Level, Metadata, Subscriber, span};

/// `shutterbug_log_fn`: level 1 error, 2 warning, 3 information.
pub type LogFn = unsafe extern "C" fn(user: *mut c_void, level: u32, text: *const c_char);

struct Forward {
    log: LogFn,
    user: *mut c_void,
}

/// Two subscribers that take nothing and stay as long as the process; made before any engine.
///
/// `tracing` keeps, for each place in the code that has something to say, who wants to hear it. While it knows of fewer
/// than two subscribers it asks only that of the thread that passes first, under no lock: a thread of an engine without
/// log could ask, be overtaken by an engine that is made with a log, and then write down that nobody listens, for good.
/// With two that never go, all are asked, under the lock that a new subscriber takes too.
static PERMANENT_SUBSCRIBERS: OnceLock<[Dispatch; 2]> = OnceLock::new();

/// To be called before anything that may have something to say.
pub fn prepare() {
    PERMANENT_SUBSCRIBERS.get_or_init(|| [(); 2].map(|()| Dispatch::new(NoSubscriber::new())));
}

// SAFETY: the header promises the host that the function is called only from threads that call the library, one at a
// time for one engine; the pointer is never read here.
unsafe impl Send for Forward {}
// SAFETY: as above.
unsafe impl Sync for Forward {}

/// A dispatch that calls the host's function.
pub fn dispatch(log: LogFn, user: *mut c_void) -> Dispatch {
    Dispatch::new(Forward { log, user })
}

impl Subscriber for Forward {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.is_event() && *metadata.level() <= Level::INFO
    }

    fn event(&self, event: &Event<'_>) {
        let mut text = Text(String::new());
        event.record(&mut text);
        let level = match *event.metadata().level() {
            Level::ERROR => 1,
            Level::WARN => 2,
            _ => 3,
        };
        let Ok(text) = CString::new(text.0.replace('\0', " ")) else { return };
        // SAFETY: the host's function takes a NUL-terminated text that lives through the call.
        unsafe { (self.log)(self.user, level, text.as_ptr()) };
    }

    fn new_span(&self, _: &span::Attributes<'_>) -> span::Id {
        span::Id::from_u64(1)
    }
    fn record(&self, _: &span::Id, _: &span::Record<'_>) {}
    fn record_follows_from(&self, _: &span::Id, _: &span::Id) {}
    fn enter(&self, _: &span::Id) {}
    fn exit(&self, _: &span::Id) {}
}

struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        let done = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name => write!(self.0, " {name}={value:?}"),
        };
        done.expect("writing to a String cannot fail");
    }
}
