//! The C ABI as a C program sees it: raw structs, raw handles, statuses. Nothing here checks arguments.
#![allow(dead_code, unsafe_code, clippy::unwrap_used)]
// Every block is a call of the C ABI with arguments that live through it.
#![allow(clippy::undocumented_unsafe_blocks)]

use std::ffi::{CString, c_char, c_void};
use std::ptr::{null, null_mut};

use shutterbug::capi::*;
use shutterbug::plane::{PixelFormat, Plane};

pub const OK: Status = 0;

/// The number of a status by its name.
pub fn status(name: &str) -> Status {
    STATUSES.iter().find(|(_, n, _)| *n == name).unwrap_or_else(|| panic!("no status {name}")).0
}

/// A zeroed struct with its size.
pub fn sized<T: Sized32>() -> T {
    unsafe {
        let mut value: std::mem::MaybeUninit<T> = std::mem::MaybeUninit::zeroed();
        value.as_mut_ptr().cast::<u32>().write(size_of::<T>() as u32);
        value.assume_init()
    }
}

pub fn error_of(handle: Handle) -> String {
    let mut text = vec![0 as c_char; 1024];
    unsafe {
        shutterbug_last_error(handle, text.as_mut_ptr(), text.len());
        std::ffi::CStr::from_ptr(text.as_ptr()).to_string_lossy().into_owned()
    }
}

#[track_caller]
pub fn must(code: Status, handle: Handle) {
    assert_eq!(code, OK, "{}", error_of(handle));
}

/// What engines of the tests are made with: validation where the test asks for it.
pub fn options(method: u32, flags: u32) -> shutterbug_engine_options {
    let mut o: shutterbug_engine_options = sized();
    (o.method, o.flags, o.samples, o.frames_in_flight) = (method, flags, 1, 3);
    o
}

/// Makes an engine, with the error's text on failure. The device is that of `SHUTTERBUG_DEVICE`, as everywhere.
pub fn create(mut o: shutterbug_engine_options) -> Result<Handle, (Status, String)> {
    let named = std::env::var("SHUTTERBUG_DEVICE").ok().filter(|d| !d.is_empty());
    let named = named.map(|d| CString::new(d).unwrap());
    let mut text = vec![0 as c_char; 1024];
    if let Some(named) = &named {
        o.device = named.as_ptr();
    }
    (o.error_text, o.error_capacity) = (text.as_mut_ptr(), text.len() as u64);
    let mut engine = null_mut();
    let code = unsafe { shutterbug_engine_create(&o, &mut engine) };
    if code == OK {
        return Ok(engine);
    }
    Err((code, unsafe { std::ffi::CStr::from_ptr(text.as_ptr()) }.to_string_lossy().into_owned()))
}

/// An engine, or a skipped test where there is no device (a failed one where a device is required).
pub fn engine(test: &str, o: shutterbug_engine_options) -> Option<Handle> {
    match create(o) {
        Ok(engine) => Some(engine),
        Err((code, text)) if [status("NO_DEVICE"), status("UNSUPPORTED")].contains(&code) => {
            assert!(std::env::var_os("SHUTTERBUG_REQUIRE_DEVICE").is_none(), "{test}: {text}");
            eprintln!("SKIPPED {test}: {text}");
            None
        }
        Err((_, text)) => panic!("{test}: {text}"),
    }
}

/// Destroys an engine on which the validation layer had nothing to say.
#[track_caller]
pub fn finish(engine: Handle) {
    let info = info(engine);
    assert_eq!(info.validation_messages, 0, "the validation layer reports");
    assert_eq!(shutterbug_engine_destroy(engine), OK);
}

#[track_caller]
pub fn info(engine: Handle) -> shutterbug_engine_info {
    let mut info = sized::<shutterbug_engine_info>();
    must(unsafe { shutterbug_engine_get_info(engine, &mut info) }, engine);
    info
}

/// A camera of that size: 90 degrees wide, 20 ms readout, 8 ms exposure, 40 ms period.
pub fn camera(width: u32, height: u32) -> shutterbug_camera {
    let mut c: shutterbug_camera = sized();
    (c.width, c.height) = (width, height);
    (c.fx_px, c.fy_px) = (f64::from(width) / 2.0, f64::from(width) / 2.0);
    (c.cx_px, c.cy_px) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
    (c.frame_period_s, c.readout_time_s, c.exposure_time_s) = (0.04, 0.02, 0.008);
    c
}

/// An image in memory, tightly packed.
pub fn image(format: PixelFormat, width: usize, height: usize, bytes: &mut [u8]) -> shutterbug_image {
    let mut i: shutterbug_image = sized();
    (i.format, i.width, i.height) = (format as u32, width as u32, height as u32);
    i.stride_bytes = (width * format.bytes()) as u64;
    i.capacity_bytes = bytes.len() as u64;
    i.pixels = bytes.as_mut_ptr().cast();
    i
}

/// Floats of a plane as bytes aligned for them.
pub struct Floats(pub Vec<f32>, pub [usize; 3]);

impl Floats {
    pub fn of(plane: &Plane<f32>) -> Self {
        Self(plane.data.clone(), [plane.width, plane.height, plane.channels])
    }

    pub fn image(&mut self) -> shutterbug_image {
        let format = match self.1[2] {
            1 => PixelFormat::R32f,
            2 => PixelFormat::Rg32f,
            _ => PixelFormat::Rgba32f,
        };
        image(format, self.1[0], self.1[1], bytemuck::cast_slice_mut(&mut self.0))
    }
}

/// A frame from outside with everything that is not in its pictures.
pub fn outside() -> shutterbug_outside {
    sized()
}

/// Submits, waits, reads RGB8, destroys.
pub fn process(
    engine: Handle,
    o: &shutterbug_outside,
    size: [usize; 2],
) -> Result<Vec<u8>, (Status, String)> {
    let mut frame = null_mut();
    let code = unsafe { shutterbug_engine_submit_outside(engine, o, &mut frame) };
    if code != OK {
        return Err((code, error_of(engine)));
    }
    let code = shutterbug_frame_wait(frame, -1.0);
    if code != OK {
        let text = error_of(frame);
        shutterbug_frame_destroy(frame);
        return Err((code, text));
    }
    let mut rgb = vec![0; size[0] * size[1] * 3];
    let to = image(PixelFormat::Rgb8, size[0], size[1], &mut rgb);
    must(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame);
    must(shutterbug_frame_destroy(frame), null_mut());
    Ok(rgb)
}

/// A small frame from outside that owns all it points to: noise that moves by (3, -2) px a frame.
pub struct Small {
    color: Vec<f32>,
    motion: Vec<f32>,
    images: Box<[shutterbug_image; 2]>,
    convention: Box<shutterbug_motion_convention>,
    pub size: [u32; 2],
    pub outside: shutterbug_outside,
}

impl Small {
    pub fn new(width: u32, height: u32) -> Self {
        let pixels = (width * height) as usize;
        let mut seed = 9u32;
        let mut number = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / 16_777_216.0
        };
        let mut color: Vec<f32> = (0..4 * pixels).map(|_| number()).collect();
        let mut motion: Vec<f32> = (0..pixels).flat_map(|_| [3.0, -2.0]).collect();
        let (w, h) = (width as usize, height as usize);
        let images = Box::new([
            image(PixelFormat::Rgba32f, w, h, bytemuck::cast_slice_mut(&mut color)),
            image(PixelFormat::Rg32f, w, h, bytemuck::cast_slice_mut(&mut motion)),
        ]);
        let mut convention = Box::new(sized::<shutterbug_motion_convention>());
        (convention.scale_x, convention.scale_y) = (1.0, 1.0);
        let mut o = outside();
        (o.motion_count, o.color_time_s, o.time_s) = (1, 0.014, 0.0);
        (o.color, o.motions, o.motion_convention) = (&images[0], &images[1], &*convention);
        Self { color, motion, images, convention, size: [width, height], outside: o }
    }
}

/// A small frame from outside with depth, poses over it and a body, that owns all it points to.
pub struct SmallPath {
    color: Vec<f32>,
    depth: Vec<f32>,
    ids: Vec<u8>,
    images: Box<[shutterbug_image; 3]>,
    convention: Box<shutterbug_depth_convention>,
    pub poses: Box<[shutterbug_stamped_pose; 2]>,
    pub bodies: Box<[shutterbug_body; 1]>,
    pub outside: shutterbug_outside,
}

impl SmallPath {
    pub fn new(width: u32, height: u32) -> Self {
        let (w, h) = (width as usize, height as usize);
        let number = |i: usize| ((i * 7919) % 1009) as f32 / 1009.0;
        let mut color: Vec<f32> = (0..4 * w * h).map(number).collect();
        let mut depth: Vec<f32> = (0..w * h).map(|i| 1.0 + number(i)).collect();
        let mut ids: Vec<u8> = (0..w * h).map(|i| if i % w > w / 2 { 5 } else { 0 }).collect();
        let images = Box::new([
            image(PixelFormat::Rgba32f, w, h, bytemuck::cast_slice_mut(&mut color)),
            image(PixelFormat::R32f, w, h, bytemuck::cast_slice_mut(&mut depth)),
            image(PixelFormat::R8u, w, h, &mut ids),
        ]);
        let convention = Box::new(sized::<shutterbug_depth_convention>());
        let pose = |time_s: f64, x: f64| shutterbug_stamped_pose {
            time_s,
            world_from_camera: shutterbug_pose {
                translation_m: [x, 0.0, 0.0],
                rotation_xyzw: [0.0, 0.0, 0.0, 1.0],
            },
        };
        let poses = Box::new([pose(0.0, 0.0), pose(1.0, 1.0)]);
        let bodies = Box::new([shutterbug_body { id: 5, pose_count: 2, poses: poses.as_ptr() }]);
        let mut o = outside();
        o.color_time_s = 0.014;
        (o.color, o.depth, o.depth_convention) = (&images[0], &images[1], &*convention);
        (o.poses, o.pose_count, o.ids) = (poses.as_ptr(), 2, &images[2]);
        (o.bodies, o.body_count) = (bodies.as_ptr(), 1);
        Self { color, depth, ids, images, convention, poses, bodies, outside: o }
    }
}

pub fn no_image() -> *const shutterbug_image {
    null()
}

pub fn text(text: &str) -> CString {
    CString::new(text).unwrap()
}

pub fn made_up(number: usize) -> Handle {
    number as *mut c_void
}
