//! What the library asks of the device that it makes: an index from the input that is wrong must not reach another
//! buffer.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use std::ffi::{CStr, CString, c_char, c_void};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};

use ash::vk;

use crate::capi_support::*;
use shutterbug::capi::*;

static REAL: AtomicUsize = AtomicUsize::new(0);
/// `robustBufferAccess` of the device that was made, and how many were.
static ROBUST: AtomicU32 = AtomicU32::new(0);
static MADE: AtomicU32 = AtomicU32::new(0);
/// Whether the next device is made without it.
static WITHOUT: AtomicBool = AtomicBool::new(false);

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
    let mut info = unsafe { *info };
    let mut features = unsafe { *info.p_enabled_features };
    ROBUST.store(features.robust_buffer_access, Ordering::SeqCst);
    MADE.fetch_add(1, Ordering::SeqCst);
    if WITHOUT.load(Ordering::SeqCst) {
        features.robust_buffer_access = vk::FALSE;
        info.p_enabled_features = &features;
    }
    let real: vk::PFN_vkCreateDevice = unsafe { std::mem::transmute(REAL.load(Ordering::SeqCst)) };
    unsafe { real(physical, &info, allocator, device) }
}

const CAMERA: &str = "width = 32\nheight = 24\nfx = 30\nfy = 30\ncx = 16\ncy = 12\nframe_period_s = 0.04\n\
    [rolling_shutter]\nreadout_time_s = 0.03\n[motion_blur]\nexposure_time_s = 0.01\n[defocus]\nsigma_px = 0.8\n\
    [glare]\nveil = 0.1\nlevel = 0.2\n[vignetting]\na1 = -0.3\n\
    [bayer_mosaic]\npattern = \"GBRG\"\n[shot_noise]\nfull_well_e = 4000.0\n[read_noise]\nsigma = 0.01\n[row_noise]\n\
    sigma = 0.003\n\
    [noise_reduction]\nluma_sigma_px = 0.8\n[sharpening]\namount = 0.5\nradius_px = 1.0\n[jpeg]\nquality = 90\n";

/// What needs to know where a pixel looks.
const LENS: &str = "[lens_distortion]\nk1 = 0.1\n[chromatic_aberration]\nscale_r = 1.002\nscale_b = 0.999\n";

/// Pictures of an engine whose device this makes: from motion, and from depth along a path.
fn pictures(method: u32) -> Vec<Vec<u8>> {
    let mut o = options(method, 1);
    o.get_instance_proc_addr = instance_proc as *const c_void;
    let engine = create(o).unwrap();
    let (small, path) = (Small::new(32, 24), SmallPath::new(32, 24));
    // The paper's method takes motion alone.
    let kinds = [(&small.outside, ""), (&path.outside, LENS)];
    let kinds = &kinds[..if method == 0 { 2 } else { 1 }];
    let taken = kinds.iter().map(|(outside, lens)| {
        let camera = CString::new(format!("{CAMERA}{lens}")).unwrap();
        must(unsafe { shutterbug_engine_set_camera_text(engine, camera.as_ptr()) }, engine);
        process(engine, outside, [32, 24]).unwrap()
    });
    let taken = taken.collect();
    finish(engine);
    taken
}

/// The device is asked for it, and what kernels make is the same to the bit with and without: no index leaves its
/// buffer.
#[test]
fn the_device_catches_indices_beyond_a_buffer() {
    let test = "the_device_catches_indices_beyond_a_buffer";
    let Some(usual) = engine(test, options(2, 1)) else { return };
    finish(usual);
    for method in [0, 2] {
        WITHOUT.store(false, Ordering::SeqCst);
        let with = pictures(method);
        assert_eq!(ROBUST.load(Ordering::SeqCst), vk::TRUE);
        WITHOUT.store(true, Ordering::SeqCst);
        assert!(with == pictures(method), "method {method}");
        assert!(with[0].iter().any(|v| *v != with[0][0]), "control: there is a picture");
    }
    assert_eq!(MADE.load(Ordering::SeqCst), 4);
}
