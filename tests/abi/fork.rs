//! Processes that fork, as Python's multiprocessing does: before there is an engine, beside one, while frames are in
//! flight, and while another thread is inside a call. Each child ends by itself; one that hangs is ended by its alarm,
//! which fails the test.
#![cfg(unix)]
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

#[path = "../support/capi/mod.rs"]
mod capi_support;

use std::ffi::{c_int, c_uint};
use std::ptr::null_mut;
use std::sync::atomic::{AtomicBool, Ordering};

use capi_support::{Small, camera, create, engine, error_of, finish, must, options, process, sized, status};
use shutterbug::capi::*;

unsafe extern "C" {
    fn fork() -> c_int;
    fn waitpid(pid: c_int, status: *mut c_int, options: c_int) -> c_int;
    fn _exit(code: c_int) -> !;
    fn alarm(seconds: c_uint) -> c_uint;
}

/// Far more than any call takes that does not hang.
const PATIENCE_S: c_uint = 120;

/// Runs checks in a child: 0 where all hold, else the number of the first that does not.
fn in_child(checks: impl FnOnce() -> i32) -> i32 {
    let child = unsafe { fork() };
    assert!(child >= 0, "fork");
    if child == 0 {
        unsafe { alarm(PATIENCE_S) };
        let code = std::panic::catch_unwind(std::panic::AssertUnwindSafe(checks)).unwrap_or(99);
        unsafe { _exit(code) };
    }
    let mut ended = 0;
    assert_eq!(unsafe { waitpid(child, &mut ended, 0) }, child);
    // The low seven bits are the signal that ended it.
    if ended & 0x7f != 0 { -(ended & 0x7f) } else { ended >> 8 & 0xff }
}

fn first_wrong(checks: &[bool]) -> i32 {
    checks.iter().position(|ok| !ok).map_or(0, |at| at as i32 + 1)
}

fn ready(flags: u32) -> Option<Handle> {
    let engine = engine("capi_fork", options(0, flags))?;
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(64, 48)) }, engine);
    Some(engine)
}

/// An engine of one's own makes a frame.
fn works() -> bool {
    let Ok(engine) = create(options(0, 0)) else { return false };
    let camera = unsafe { shutterbug_engine_set_camera(engine, &camera(64, 48)) };
    let frame = process(engine, &Small::new(64, 48).outside, [64, 48]);
    camera == 0 && frame.is_ok() && shutterbug_engine_destroy(engine) == 0
}

/// An engine of a child's own, beside what its parent has of the driver: a software driver begins anew; that of a GPU
/// is not touched, for the parent's sake.
fn works_or_is_refused(software: bool) -> bool {
    if software {
        return works();
    }
    match create(options(0, 0)) {
        Err((code, text)) => code == status("NO_DEVICE") && text.contains("forked"),
        Ok(_) => false,
    }
}

/// What a child may do with handles of its parent.
fn inherited(engine: Handle, frame: Handle, software: bool) -> i32 {
    let forked = status("FORKED");
    let (mut info, mut done) = (sized::<shutterbug_engine_info>(), 0u32);
    let (outside, mut other) = (Small::new(64, 48), null_mut());
    first_wrong(&[
        unsafe { shutterbug_engine_get_info(engine, &mut info) } == forked,
        error_of(engine).contains("forked"),
        unsafe { shutterbug_engine_set_camera(engine, &camera(64, 48)) } == forked,
        unsafe { shutterbug_engine_submit_outside(engine, &outside.outside, &mut other) } == forked,
        unsafe { shutterbug_frame_poll(frame, &mut done) } == forked,
        shutterbug_frame_wait(frame, -1.0) == forked,
        error_of(frame).contains("forked"),
        shutterbug_frame_destroy(frame) == 0,
        shutterbug_frame_wait(frame, -1.0) == status("HANDLE"),
        shutterbug_engine_destroy(engine) == 0,
        shutterbug_engine_destroy(engine) == status("HANDLE"),
        // What was never anybody's stays what it was.
        shutterbug_engine_destroy(capi_support::made_up(0x1000_0001)) == status("HANDLE"),
        works_or_is_refused(software),
    ])
}

#[test]
fn children_answer_at_once_and_leave_their_parent_alone() {
    // No engine is alive: the child is like any process, but for what the driver keeps of the probe.
    let Ok(probe) = create(options(0, 0)) else {
        assert!(std::env::var_os("SHUTTERBUG_REQUIRE_DEVICE").is_none(), "no device");
        eprintln!("SKIPPED capi_fork: no device");
        return;
    };
    let mut info = sized::<shutterbug_engine_info>();
    must(unsafe { shutterbug_engine_get_info(probe, &mut info) }, probe);
    let software = info.device_kind == 4;
    assert_eq!(shutterbug_engine_destroy(probe), 0);
    assert_eq!(in_child(|| i32::from(!works_or_is_refused(software))), 0, "beside no engine");
    assert_eq!(in_child(|| 7), 7, "control: what a child finds is seen");

    let engine = ready(1).unwrap();
    let small = Small::new(64, 48);
    let want = process(engine, &small.outside, [64, 48]).unwrap();
    let submit = || {
        let mut frame = null_mut();
        must(unsafe { shutterbug_engine_submit_outside(engine, &small.outside, &mut frame) }, engine);
        frame
    };
    let frame = submit();
    assert_eq!(in_child(|| inherited(engine, frame, software)), 0, "with a frame in flight");
    must(shutterbug_frame_wait(frame, -1.0), frame);
    assert_eq!(in_child(|| inherited(engine, frame, software)), 0, "with a frame that was waited for");
    must(shutterbug_frame_destroy(frame), null_mut());
    assert_eq!(process(engine, &small.outside, [64, 48]).unwrap(), want, "the parent's engine goes on");

    // While another thread is inside calls: its locks are held in the child, for ever.
    let (stop, busy) = (AtomicBool::new(false), ready(0).unwrap() as usize);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let small = Small::new(64, 48);
            while !stop.load(Ordering::Relaxed) {
                process(busy as Handle, &small.outside, [64, 48]).unwrap();
            }
        });
        for _ in 0..20 {
            let forked = status("FORKED");
            let found = in_child(|| {
                let mut info = sized::<shutterbug_engine_info>();
                let busy = busy as Handle;
                first_wrong(&[
                    unsafe { shutterbug_engine_get_info(busy, &mut info) } == forked,
                    shutterbug_engine_destroy(busy) == 0,
                ])
            });
            assert_eq!(found, 0, "while another thread is inside a call");
        }
        stop.store(true, Ordering::Relaxed);
    });
    assert_eq!(shutterbug_engine_destroy(busy as Handle), 0);
    finish(engine);
}

/// A host in Python: the library, the header, and what a child finds.
const HOST: &str = r#"
import os, signal, sys, cffi
text = open(sys.argv[2]).read()
start = text.index('\n', text.index('"END OF PLAIN C"'))
ffi = cffi.FFI()
ffi.cdef(text[start:text.index('/* END OF PLAIN C */')])
lib = ffi.dlopen(sys.argv[1])

def sized(name):
    made = ffi.new(name + ' *')
    made.struct_size = ffi.sizeof(name)
    return made

def create():
    engine = ffi.new('shutterbug_engine **')
    return lib.shutterbug_engine_create(sized('shutterbug_engine_options'), engine), engine[0]

def info(engine):
    return lib.shutterbug_engine_get_info(engine, sized('shutterbug_engine_info'))

signal.alarm(120)
code, engine = create()
if code == lib.SHUTTERBUG_NO_DEVICE:
    sys.exit(77)
assert code == 0 and info(engine) == 0
# What the allocator of Python hands out before, between and after.
junk = [bytes(range(256)) * i for i in range(200)]
child = os.fork()
if child == 0:
    signal.alarm(100)
    found = [info(engine), lib.shutterbug_engine_destroy(engine)]
    junk.clear()
    code, own = create()
    found += [code, info(own), lib.shutterbug_engine_destroy(own)]
    os._exit(0 if found == [lib.SHUTTERBUG_FORKED, 0, 0, 0, 0] else 1)
status = os.waitpid(child, 0)[1]
assert status == 0, status
assert info(engine) == 0 and lib.shutterbug_engine_destroy(engine) == 0
"#;

#[test]
fn a_forked_python_is_answered_at_once() {
    let library = std::env::current_exe().unwrap().with_file_name("libshutterbug.so");
    let ready = std::process::Command::new("python3").args(["-c", "import cffi"]).output();
    if !ready.is_ok_and(|o| o.status.success()) || !library.exists() {
        eprintln!(
            "SKIPPED a_forked_python_is_answered_at_once: python3 with cffi, or the library, is absent"
        );
        return;
    }
    // Under Python's own allocator and under the system's.
    for allocator in ["pymalloc", "malloc"] {
        let mut python = std::process::Command::new("python3");
        python.args(["-c", HOST]).arg(&library).arg("include/shutterbug.h").env("PYTHONMALLOC", allocator);
        let out = python.output().unwrap();
        if out.status.code() == Some(77) {
            eprintln!("SKIPPED a_forked_python_is_answered_at_once: no device");
            return;
        }
        assert!(out.status.success(), "{allocator}: {}", String::from_utf8_lossy(&out.stderr));
    }
}
