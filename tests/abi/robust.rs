//! What the library asks of the device that it makes: an index from the input that is wrong must not reach another buffer.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use std::ffi::{CStr, c_char, c_void};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};

use ash::vk;

use crate::capi_support::*;
use shutterbug::capi::*;

static REAL: AtomicUsize = AtomicUsize::new(0);
/// `robustBufferAccess` of the device that was made, and how many were.
static ROBUST: AtomicU32 = AtomicU32::new(0);
static MADE: AtomicU32 = AtomicU32::new(0);

fn loader() -> vk::PFN_vkGetInstanceProcAddr {
    static ENTRY: OnceLock<ash::Entry> = OnceLock::new();
    ENTRY.get_or_init(|| unsafe { ash::Entry::load() }.unwrap()).static_fn().get_instance_proc_addr
}

unsafe extern "system" fn instance_proc(
    instance: vk::Instance,
    name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    let found = unsafe { loader()(instance, name) }?;
    if unsafe { CStr::from_ptr(name) } != c"vkCreateDevice" {
        return Some(found);
    }
    REAL.store(found as usize, Ordering::SeqCst);
    let mine: vk::PFN_vkCreateDevice = create_device;
    Some(unsafe { std::mem::transmute::<vk::PFN_vkCreateDevice, unsafe extern "system" fn()>(mine) })
}

unsafe extern "system" fn create_device(
    physical: vk::PhysicalDevice,
    info: *const vk::DeviceCreateInfo<'_>,
    allocator: *const vk::AllocationCallbacks<'_>,
    device: *mut vk::Device,
) -> vk::Result {
    let features = unsafe { (*info).p_enabled_features.as_ref() };
    ROBUST.store(features.map_or(0, |f| f.robust_buffer_access), Ordering::SeqCst);
    MADE.fetch_add(1, Ordering::SeqCst);
    let real: vk::PFN_vkCreateDevice = unsafe { std::mem::transmute(REAL.load(Ordering::SeqCst)) };
    unsafe { real(physical, info, allocator, device) }
}

#[test]
fn the_device_catches_indices_beyond_a_buffer() {
    let test = "the_device_catches_indices_beyond_a_buffer";
    let Some(usual) = engine(test, options(2, 1)) else { return };
    finish(usual);
    let mut o = options(2, 1);
    o.get_instance_proc_addr = instance_proc as *const c_void;
    let Some(engine) = engine(test, o) else { return };
    assert_eq!(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, OK);
    assert!(process(engine, &Small::new(32, 24).outside, [32, 24]).is_ok());
    finish(engine);
    assert_eq!((MADE.load(Ordering::SeqCst), ROBUST.load(Ordering::SeqCst)), (1, vk::TRUE));
}
