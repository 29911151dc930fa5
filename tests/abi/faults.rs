//! Device lost and out of memory at every Vulkan call in turn, by a dispatch table of this test's own: it is handed to
//! the library as the host's `vkGetInstanceProcAddr`, counts the calls, fails the n-th, and keeps count of what lives.
//! After each failure: the right status, no crash, nothing left behind once the engine is destroyed, and the next
//! engine works.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

#[path = "../support/capi/mod.rs"]
mod capi_support;
#[path = "faults_work.rs"]
mod faults_work;
#[path = "../support/long/mod.rs"]
mod long_support;

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::{CStr, c_char, c_void};
use std::sync::Mutex;
use std::sync::atomic::{AtomicI32, AtomicI64, Ordering};

use ash::vk;
use capi_support::*;
use faults_work::{LENS, Pages, finer_frame, scene_frame, shared_frame};
use shutterbug::capi::*;

/// Calls until one fails; negative: never.
static FUSE: AtomicI64 = AtomicI64::new(-1);
/// What the failing call returns.
static RESULT: AtomicI32 = AtomicI32::new(0);
/// The calls so far, the one that failed, those after which the same engine was used again, how many of each object
/// live, and the real functions.
static STATE: Mutex<State> = Mutex::new(State {
    calls: Vec::new(),
    failed: None,
    survived: BTreeSet::new(),
    live: BTreeMap::new(),
    real: BTreeMap::new(),
});
/// The counters are of the process: one test at a time.
static ONE: Mutex<()> = Mutex::new(());

struct State {
    calls: Vec<&'static str>,
    failed: Option<&'static str>,
    survived: BTreeSet<&'static str>,
    live: BTreeMap<&'static str, i64>,
    real: BTreeMap<&'static str, usize>,
}

fn state() -> std::sync::MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Whether this call is the one that fails.
fn trips(name: &'static str) -> Option<vk::Result> {
    state().calls.push(name);
    if FUSE.load(Ordering::Relaxed) < 0 || FUSE.fetch_sub(1, Ordering::Relaxed) != 0 {
        return None;
    }
    state().failed = Some(name);
    Some(vk::Result::from_raw(RESULT.load(Ordering::Relaxed)))
}

fn real<F: Copy>(name: &'static str) -> F {
    let address = *state().real.get(name).expect("looked up before it is called");
    assert_eq!(size_of::<F>(), size_of::<usize>());
    unsafe { std::mem::transmute_copy(&address) }
}

fn count(object: &'static str, by: i64) {
    if !object.is_empty() {
        *state().live.entry(object).or_default() += by;
    }
}

macro_rules! table {
    (
        may_fail { $($name:ident($($arg:ident: $type:ty),*) makes $made:literal;)* }
        destroy { $($gone:ident($($garg:ident: $gtype:ty),*) ends $ended:literal by $by:ident;)* }
    ) => {
        mod wrapped {
            #![allow(non_snake_case, clippy::too_many_arguments)]
            use super::*;
            $(pub unsafe extern "system" fn $name($($arg: $type),*) -> vk::Result {
                if let Some(result) = trips(stringify!($name)) {
                    return result;
                }
                let call: unsafe extern "system" fn($($type),*) -> vk::Result = real(stringify!($name));
                let done = unsafe { call($($arg),*) };
                if done == vk::Result::SUCCESS {
                    count($made, 1);
                }
                done
            })*
            $(pub unsafe extern "system" fn $gone($($garg: $gtype),*) {
                let call: unsafe extern "system" fn($($gtype),*) = real(stringify!($gone));
                if $by as u64 != 0 {
                    count($ended, -1);
                }
                unsafe { call($($garg),*) }
            })*
        }

        /// The wrapper of a function, if it has one.
        fn wrapper(name: &CStr) -> Option<(&'static str, usize)> {
            match name.to_str().ok()? {
                $(stringify!($name) => Some((stringify!($name), wrapped::$name as *const () as usize)),)*
                $(stringify!($gone) => Some((stringify!($gone), wrapped::$gone as *const () as usize)),)*
                _ => None,
            }
        }
    };
}

type P = *const c_void;
type H = u64;

table! {
    may_fail {
        vkCreateInstance(info: P, alloc: P, out: P) makes "instance";
        vkEnumeratePhysicalDevices(instance: H, count: P, out: P) makes "";
        vkEnumerateDeviceExtensionProperties(device: H, layer: P, count: P, out: P) makes "";
        vkCreateDevice(physical: H, info: P, alloc: P, out: P) makes "device";
        vkCreatePipelineCache(device: H, info: P, alloc: P, out: P) makes "pipeline cache";
        vkCreateBuffer(device: H, info: P, alloc: P, out: P) makes "buffer";
        vkCreateImage(device: H, info: P, alloc: P, out: P) makes "image";
        vkCreateImageView(device: H, info: P, alloc: P, out: P) makes "image view";
        vkCreateSampler(device: H, info: P, alloc: P, out: P) makes "sampler";
        vkAllocateMemory(device: H, info: P, alloc: P, out: P) makes "memory";
        vkMapMemory(device: H, memory: H, offset: u64, size: u64, flags: u32, out: P) makes "";
        vkBindBufferMemory(device: H, buffer: H, memory: H, offset: u64) makes "";
        vkBindImageMemory(device: H, image: H, memory: H, offset: u64) makes "";
        vkCreateShaderModule(device: H, info: P, alloc: P, out: P) makes "shader module";
        vkCreateDescriptorSetLayout(device: H, info: P, alloc: P, out: P) makes "set layout";
        vkCreatePipelineLayout(device: H, info: P, alloc: P, out: P) makes "pipeline layout";
        vkCreateComputePipelines(device: H, cache: H, count: u32, info: P, alloc: P, out: P) makes "pipeline";
        vkCreateGraphicsPipelines(device: H, cache: H, count: u32, info: P, alloc: P, out: P) makes "pipeline";
        vkCreateRenderPass(device: H, info: P, alloc: P, out: P) makes "render pass";
        vkCreateFramebuffer(device: H, info: P, alloc: P, out: P) makes "framebuffer";
        vkCreateDescriptorPool(device: H, info: P, alloc: P, out: P) makes "descriptor pool";
        vkAllocateDescriptorSets(device: H, info: P, out: P) makes "";
        vkCreateCommandPool(device: H, info: P, alloc: P, out: P) makes "command pool";
        vkAllocateCommandBuffers(device: H, info: P, out: P) makes "";
        vkCreateFence(device: H, info: P, alloc: P, out: P) makes "fence";
        vkCreateQueryPool(device: H, info: P, alloc: P, out: P) makes "query pool";
        vkGetFenceStatus(device: H, fence: H) makes "";
        vkCreateSemaphore(device: H, info: P, alloc: P, out: P) makes "semaphore";
        vkGetMemoryFdKHR(device: H, info: P, out: P) makes "";
        vkGetSemaphoreFdKHR(device: H, info: P, out: P) makes "";
        vkGetPhysicalDeviceImageFormatProperties2(physical: H, info: P, out: P) makes "";
        vkGetMemoryHostPointerPropertiesEXT(device: H, kind: u32, pointer: P, out: P) makes "";
        vkBeginCommandBuffer(commands: H, info: P) makes "";
        vkEndCommandBuffer(commands: H) makes "";
        vkResetFences(device: H, count: u32, fences: P) makes "";
        vkQueueSubmit(queue: H, count: u32, submits: P, fence: H) makes "";
        vkWaitForFences(device: H, count: u32, fences: P, all: u32, limit: u64) makes "";
        vkGetQueryPoolResults(d: H, p: H, first: u32, count: u32, size: usize, to: P, stride: u64, flags: u32) makes "";
    }
    destroy {
        vkDestroyInstance(instance: H, alloc: P) ends "instance" by instance;
        vkDestroyDevice(device: H, alloc: P) ends "device" by device;
        vkDestroyPipelineCache(device: H, it: H, alloc: P) ends "pipeline cache" by it;
        vkDestroyBuffer(device: H, it: H, alloc: P) ends "buffer" by it;
        vkDestroyImage(device: H, it: H, alloc: P) ends "image" by it;
        vkDestroyImageView(device: H, it: H, alloc: P) ends "image view" by it;
        vkDestroySampler(device: H, it: H, alloc: P) ends "sampler" by it;
        vkFreeMemory(device: H, it: H, alloc: P) ends "memory" by it;
        vkDestroyShaderModule(device: H, it: H, alloc: P) ends "shader module" by it;
        vkDestroyDescriptorSetLayout(device: H, it: H, alloc: P) ends "set layout" by it;
        vkDestroyPipelineLayout(device: H, it: H, alloc: P) ends "pipeline layout" by it;
        vkDestroyPipeline(device: H, it: H, alloc: P) ends "pipeline" by it;
        vkDestroyRenderPass(device: H, it: H, alloc: P) ends "render pass" by it;
        vkDestroyFramebuffer(device: H, it: H, alloc: P) ends "framebuffer" by it;
        vkDestroyDescriptorPool(device: H, it: H, alloc: P) ends "descriptor pool" by it;
        vkDestroyCommandPool(device: H, it: H, alloc: P) ends "command pool" by it;
        vkDestroyFence(device: H, it: H, alloc: P) ends "fence" by it;
        vkDestroyQueryPool(device: H, it: H, alloc: P) ends "query pool" by it;
        vkDestroySemaphore(device: H, it: H, alloc: P) ends "semaphore" by it;
    }
}

/// Remembers the real function and gives out its wrapper, if it has one.
fn wrap(name: *const c_char, found: vk::PFN_vkVoidFunction) -> vk::PFN_vkVoidFunction {
    let address = found? as usize;
    match wrapper(unsafe { CStr::from_ptr(name) }) {
        None => found,
        Some((name, wrapper)) => {
            state().real.insert(name, address);
            Some(unsafe { std::mem::transmute::<usize, unsafe extern "system" fn()>(wrapper) })
        }
    }
}

unsafe extern "system" fn instance_proc(
    instance: vk::Instance,
    name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    if unsafe { CStr::from_ptr(name) } == c"vkGetDeviceProcAddr" {
        let found = unsafe { loader()(instance, name) };
        state().real.insert("vkGetDeviceProcAddr", found? as usize);
        let mine =
            device_proc as unsafe extern "system" fn(vk::Device, *const c_char) -> vk::PFN_vkVoidFunction;
        return Some(unsafe {
            std::mem::transmute::<*const (), unsafe extern "system" fn()>(mine as *const ())
        });
    }
    wrap(name, unsafe { loader()(instance, name) })
}

unsafe extern "system" fn device_proc(device: vk::Device, name: *const c_char) -> vk::PFN_vkVoidFunction {
    let call: vk::PFN_vkGetDeviceProcAddr = real("vkGetDeviceProcAddr");
    wrap(name, unsafe { call(device, name) })
}

/// The system's loader, opened once. As in a host that draws, an instance of its own is alive meanwhile: NVIDIA's
/// driver does not survive hundreds of instances that come and go while there is no other.
fn loader() -> vk::PFN_vkGetInstanceProcAddr {
    static ENTRY: std::sync::OnceLock<Option<(ash::Entry, Option<ash::Instance>)>> =
        std::sync::OnceLock::new();
    let entry = ENTRY.get_or_init(|| {
        let entry = unsafe { ash::Entry::load() }.ok()?;
        let hosts = unsafe { entry.create_instance(&vk::InstanceCreateInfo::default(), None) }.ok();
        Some((entry, hosts))
    });
    entry.as_ref().expect("checked by the test").0.static_fn().get_instance_proc_addr
}

/// What a host does with one engine.
#[derive(Clone, Copy)]
enum Work {
    /// Two frames from outside.
    Outside,
    /// A frame from outside of three pictures with bodies and poses, read in more than 8 bits.
    Finer,
    /// One frame of the demo scene by a method of the header, with sharp planes, and these effects besides the shutter.
    Scene(u32, &'static str),
    /// Frames from memory that is shared with the device, polled, with depth; semaphores where there are any.
    Shared,
}

/// Whether a call has failed whose kind did not before: after one of each, the engine is used again.
fn first_of_its_kind() -> bool {
    let mut state = state();
    state.failed.is_some_and(|name| state.survived.insert(name))
}

/// Makes an engine, uses it, destroys it.
fn use_an_engine(work: Work) -> Result<Vec<u8>, (Status, String)> {
    let mut o = match work {
        Work::Outside | Work::Shared | Work::Finer => options(0, 0),
        Work::Scene(method, _) => options(method, 2),
    };
    o.get_instance_proc_addr = instance_proc as *const c_void;
    o.frames_in_flight = 1;
    let engine = create(o)?;
    let frames = || match work {
        Work::Scene(_, effects) => scene_frame(engine, effects),
        Work::Shared => shared_frame(engine),
        Work::Finer => finer_frame(engine),
        Work::Outside => {
            let code = unsafe { shutterbug_engine_set_camera(engine, &camera(16, 12)) };
            assert_eq!(code, OK, "needs no device");
            let small = Small::new(16, 12);
            let mut picture = process(engine, &small.outside, [16, 12])?;
            picture.extend(process(engine, &small.outside, [16, 12])?);
            picture.extend(process(engine, &SmallPath::new(16, 12).outside, [16, 12])?);
            Ok(picture)
        }
    };
    let done = frames();
    match &done {
        Err((code, _)) if *code == status("DEVICE_LOST") => {
            let again = process(engine, &Small::new(16, 12).outside, [16, 12]).unwrap_err();
            assert_eq!(again.0, status("DEVICE_LOST"), "a lost device stays lost: {}", again.1);
        }
        // Any other failure costs its frame alone, not its place in flight: there is but one.
        Err((_, why)) if first_of_its_kind() => {
            let limit = std::time::Instant::now() + std::time::Duration::from_secs(60);
            let again = loop {
                match frames() {
                    // The device is still at work on the frame that failed.
                    Err((code, _)) if code == status("FULL") && std::time::Instant::now() < limit => {
                        std::thread::yield_now();
                    }
                    again => break again,
                }
            };
            assert!(again.is_ok(), "after `{why}` the same engine: {again:?}");
        }
        _ => {}
    }
    assert_eq!(shutterbug_engine_destroy(engine), OK);
    done
}

fn nothing_is_left(after: &str) {
    let left: Vec<_> =
        state().live.iter().filter(|(_, n)| **n != 0).map(|(o, n)| format!("{n} {o}")).collect();
    assert!(left.is_empty(), "after {after}: left behind: {}", left.join(", "));
}

/// Whether Vulkan allows this result of this call.
fn can_return(name: &str, result: vk::Result) -> bool {
    let may_lose_the_device =
        ["vkCreateDevice", "vkQueueSubmit", "vkWaitForFences", "vkGetFenceStatus", "vkGetQueryPoolResults"];
    // The allocator tells only whether memory ran out; other results of its calls are lost in it.
    result != vk::Result::ERROR_DEVICE_LOST || may_lose_the_device.contains(&name)
}

/// A result to inject, and the status that must come of it.
type Fault = (vk::Result, &'static str);
const LOST: Fault = (vk::Result::ERROR_DEVICE_LOST, "DEVICE_LOST");
const DEVICE_MEMORY: Fault = (vk::Result::ERROR_OUT_OF_DEVICE_MEMORY, "OUT_OF_MEMORY");
const HOST_MEMORY: Fault = (vk::Result::ERROR_OUT_OF_HOST_MEMORY, "OUT_OF_MEMORY");

/// Fails each call in turn, or the first of each kind and one of every `stride`, the n-th with the n-th of `faults`
/// (around and around); `want` is the picture without failure, `calls` what it took. Returns how many calls there were
/// and the names of those that failed.
fn fail_each(
    work: Work,
    want: &[u8],
    calls: &[&str],
    faults: &[Fault],
    stride: usize,
) -> (usize, Vec<&'static str>) {
    let mut names = Vec::new();
    let chosen =
        |n: &usize| n.is_multiple_of(stride) || *n >= calls.len() || !calls[..*n].contains(&calls[*n]);
    for n in (0..).filter(chosen) {
        let (result, expected) = faults[n % faults.len()];
        RESULT.store(result.as_raw(), Ordering::Relaxed);
        state().failed = None;
        FUSE.store(n as i64, Ordering::Relaxed);
        let done = use_an_engine(work);
        FUSE.store(-1, Ordering::Relaxed);
        let failed = state().failed;
        let Some(name) = failed else {
            assert!(done.is_ok(), "nothing failed, but: {done:?}");
            return (n, names);
        };
        check(done, want, (n, name, result), expected);
        nothing_is_left(name);
        if !names.contains(&name) {
            names.push(name);
            // The next engine in the process works.
            assert!(use_an_engine(Work::Outside).is_ok(), "the engine after a failed {name}");
            nothing_is_left("the next engine");
        }
    }
    unreachable!("a run has an end")
}

/// What came of a call that failed.
fn check(
    done: Result<Vec<u8>, (Status, String)>,
    want: &[u8],
    (n, name, result): (usize, &str, vk::Result),
    expected: &str,
) {
    match done {
        Err((code, text)) if can_return(name, result) => {
            assert_eq!(code, status(expected), "call {n}, {name}: {text}");
        }
        // Vulkan does not allow this result of this call; any error will do.
        Err((code, text)) => {
            assert!(code != status("PANIC") && !text.is_empty(), "call {n}, {name}: {text}")
        }
        // The allocator tries other kinds of memory when one runs out.
        Ok(picture) => {
            let tried_again = ["vkAllocateMemory", "vkMapMemory"].contains(&name);
            assert!(tried_again, "call {n}, {name}, failed and nobody noticed");
            assert!(picture == want, "call {n}, {name}: another picture");
        }
    }
}

/// Whether there is a device; clears what a failed test has left in the counters.
fn ready(test: &str) -> bool {
    if unsafe { ash::Entry::load() }.is_err() {
        eprintln!("SKIPPED {test}: no Vulkan loader");
        return false;
    }
    FUSE.store(-1, Ordering::Relaxed);
    state().live.clear();
    let Some(engine) = engine(test, options(2, 0)) else { return false };
    shutterbug_engine_destroy(engine) == OK
}

/// One call in so many of some work fails in turn, and the first of each kind, with the device lost at one call and
/// memory out at the next; under SHUTTERBUG_LONG=1, every call with each of three results.
fn fail_all(test: &str, work: Work, kinds: &[&str]) {
    let _one = ONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if !ready(test) {
        return;
    }
    state().calls.clear();
    let first = use_an_engine(work).unwrap();
    let calls = std::mem::take(&mut state().calls);
    assert!(first.iter().any(|v| *v != first[0]), "control: a picture of something");
    nothing_is_left("a run without failure");
    // Renders take most of the time. Odd strides: each result comes at every second call.
    let (rounds, stride): (&[&[Fault]], usize) = match (long_support::long(), work) {
        (true, _) => (&[&[LOST], &[DEVICE_MEMORY], &[HOST_MEMORY]], 1),
        (false, Work::Scene(..)) => (&[&[LOST, DEVICE_MEMORY]], 29),
        (false, _) => (&[&[LOST, DEVICE_MEMORY]], 5),
    };
    if stride > 1 {
        long_support::left_out(test, &format!("all but one call in {stride} and the first of each kind"));
    }
    for faults in rounds {
        let (calls, names) = fail_each(work, &first, &calls, faults, stride);
        let survived = std::mem::take(&mut state().survived).len();
        eprintln!(
            "{test}, {faults:?}: {calls} calls, {} kinds, {survived} outlived: {}",
            names.len(),
            names.join(" ")
        );
        assert!(survived > 5 || *faults == [LOST], "control: engines are used after a failure");
        assert!(calls > 100 && names.len() > 20, "control: the table wraps what is called");
        for kind in kinds {
            assert!(names.contains(kind), "control: {kind} is called");
        }
    }
    assert!(use_an_engine(work).unwrap() == first, "after all that, the same picture");
}

macro_rules! every_call {
    ($($(#[$long:meta])* $name:ident: $work:expr, $kinds:expr;)+) => {$(
        #[test]
        $(#[$long])*
        fn $name() {
            fail_all(stringify!($name), $work, &$kinds);
        }
    )+};
}

const DRAWN: [&str; 2] = ["vkCreateGraphicsPipelines", "vkCreateFramebuffer"];

every_call! {
    device_lost_and_out_of_memory_at_every_call_of_an_outside_frame: Work::Outside, ["vkCreateComputePipelines"];
    #[ignore = "long: a minute"]
    device_lost_and_out_of_memory_at_every_call_of_method_accumulation: Work::Scene(1, ""), DRAWN;
    #[ignore = "long: a minute"]
    device_lost_and_out_of_memory_at_every_call_of_method_paper: Work::Scene(2, ""), DRAWN;
    #[ignore = "long: a minute"]
    device_lost_and_out_of_memory_at_every_call_of_method_exact: Work::Scene(3, ""), DRAWN;
    #[ignore = "long: a minute"]
    device_lost_and_out_of_memory_at_every_call_of_method_fast: Work::Scene(4, ""), DRAWN;
    #[ignore = "long: half a minute"]
    device_lost_and_out_of_memory_at_every_call_with_a_lens: Work::Scene(3, LENS), DRAWN;
    #[ignore = "long: a minute"]
    device_lost_and_out_of_memory_at_every_call_of_pictures_in_more_than_8_bits:
        Work::Finer, ["vkCreateComputePipelines"];
    #[ignore = "long: a minute"]
    device_lost_and_out_of_memory_at_every_call_of_shared_memory: Work::Shared, ["vkGetFenceStatus"];
}

#[test]
fn memory_that_the_host_destroys_is_given_back_though_its_engine_lives() {
    let test = "memory_that_the_host_destroys_is_given_back_though_its_engine_lives";
    let _one = ONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if !ready(test) {
        return;
    }
    let mut o = options(2, 0);
    o.get_instance_proc_addr = instance_proc as *const c_void;
    let engine = create(o).unwrap();
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(16, 12)) }, engine);
    let small = Small::new(16, 12);
    // Each of the three places of frames in flight makes what it needs with its first frame.
    for _ in 0..3 {
        process(engine, &small.outside, [16, 12]).unwrap();
    }
    let living = |what: &str| state().live.get(what).copied().unwrap_or(0);
    let before = (living("memory"), living("buffer"));
    if info(engine).capabilities & 1 != 0 {
        let pages = Pages::new(16 * 12 * 16);
        let mut memory = std::ptr::null_mut();
        let bytes = pages.1.size() as u64;
        must(unsafe { shutterbug_memory_import_host(engine, pages.0.cast(), bytes, &mut memory) }, engine);
        let mut color = unsafe { *small.outside.color };
        (color.pixels, color.memory) = (std::ptr::null_mut(), memory);
        let mut o = small.outside;
        o.color = &color;
        process(engine, &o, [16, 12]).unwrap();
        assert_eq!(living("memory"), before.0 + 1, "control: it is counted");
        assert_eq!(shutterbug_memory_destroy(memory), OK);
        // Now the host may free its pages.
        assert_eq!((living("memory"), living("buffer")), before, "kept by the engine");
    } else {
        eprintln!("SKIPPED {test}: the device cannot import host memory");
    }
    // Another buffer in its place.
    process(engine, &small.outside, [16, 12]).unwrap();
    assert_eq!(shutterbug_engine_destroy(engine), OK);
    nothing_is_left(test);
}
