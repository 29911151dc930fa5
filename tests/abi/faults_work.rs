//! What an engine does while calls fail: frames of a scene, from memory that is shared, in more than 8 bits.

use crate::capi_support::*;
use shutterbug::capi::*;
use shutterbug::plane::PixelFormat;

/// A frame of the demo scene: the picture and its motion plane.
pub fn scene_frame(engine: Handle, method_camera: &str) -> Result<Vec<u8>, (Status, String)> {
    let check =
        |code: Status, handle: Handle| if code == OK { Ok(()) } else { Err((code, error_of(handle))) };
    check(unsafe { shutterbug_engine_load_capture(engine, text("demo/capture").as_ptr()) }, engine)?;
    let camera = text(&format!("{CAMERA}{method_camera}"));
    check(unsafe { shutterbug_engine_set_camera_text(engine, camera.as_ptr()) }, engine)?;
    let mut request: shutterbug_request = sized();
    (request.time_s, request.flags) = (10.05, 1);
    let mut frame = std::ptr::null_mut();
    if info(engine).capabilities & 2 != 0 {
        request.picture_memory = exported_image(engine)?;
    }
    let submitted = check(unsafe { shutterbug_engine_submit(engine, &request, &mut frame) }, engine);
    // The frame keeps what it uses.
    assert_eq!(shutterbug_memory_destroy(request.picture_memory), OK);
    submitted?;
    let mut rgb = vec![0; 16 * 12 * 3];
    let to = image(PixelFormat::Rgb8, 16, 12, &mut rgb);
    let done = check(shutterbug_frame_wait(frame, -1.0), frame)
        .and_then(|()| check(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame));
    assert_eq!(shutterbug_frame_destroy(frame), OK);
    done.map(|()| rgb)
}

/// A frame of three pictures: raw numbers, packed, and values of 16 bits.
pub fn finer_frame(engine: Handle) -> Result<Vec<u8>, (Status, String)> {
    let check =
        |code: Status, handle: Handle| if code == OK { Ok(()) } else { Err((code, error_of(handle))) };
    let camera = text(&format!("{CAMERA}{LENS}[bayer_mosaic]\npattern = \"GBRG\"\n"));
    check(unsafe { shutterbug_engine_set_camera_text(engine, camera.as_ptr()) }, engine)?;
    let small = SmallPath::new(16, 12);
    let at = |time_s: f64| {
        let shutterbug_outside { color, depth, ids, .. } = small.outside;
        shutterbug_picture { time_s, color, depth, ids }
    };
    let further = [at(0.001), at(0.027)];
    let o = shutterbug_outside {
        flags: 1 | 4 | 8,
        pictures: further.as_ptr(),
        picture_count: 2,
        ..small.outside
    };
    let mut frame = std::ptr::null_mut();
    check(unsafe { shutterbug_engine_submit_outside(engine, &o, &mut frame) }, engine)?;
    let mut bytes = vec![0u16; 16 * 12 * 3 + 14 * 12];
    let (wide, raw) = bytes.split_at_mut(16 * 12 * 3);
    let mut done = check(shutterbug_frame_wait(frame, -1.0), frame);
    for (plane, format, row, to) in [(1, 13, 96, wide), (6, 21, 28, raw)] {
        let mut image = image(PixelFormat::R8u, 16, 12, bytemuck::cast_slice_mut(to));
        (image.format, image.stride_bytes) = (format, row);
        done = done.and_then(|()| check(unsafe { shutterbug_frame_read(frame, plane, &image) }, frame));
    }
    assert_eq!(shutterbug_frame_destroy(frame), OK);
    done.map(|()| bytemuck::cast_slice(&bytes).to_vec())
}

/// A frame whose colour lies in exported memory, polled until it is done; the memory goes last.
pub fn shared_frame(engine: Handle) -> Result<Vec<u8>, (Status, String)> {
    let check =
        |code: Status, handle: Handle| if code == OK { Ok(()) } else { Err((code, error_of(handle))) };
    assert_eq!(unsafe { shutterbug_engine_set_camera(engine, &camera(16, 12)) }, OK, "needs no device");
    let (small, can) = (Small::new(16, 12), info(engine).capabilities);
    let (mut o, mut made) = (small.outside, Vec::new());
    let mut color = unsafe { *small.outside.color };
    let pages = Pages::new(16 * 12 * 16);
    let done = (|| {
        if can & 1 != 0 {
            unsafe { std::ptr::copy_nonoverlapping(color.pixels.cast::<u8>(), pages.0, 16 * 12 * 16) };
            let mut memory = std::ptr::null_mut();
            let code = unsafe {
                shutterbug_memory_import_host(engine, pages.0.cast(), pages.1.size() as u64, &mut memory)
            };
            check(code, engine)?;
            made.push((memory, shutterbug_memory_destroy as extern "C" fn(Handle) -> Status));
            (color.pixels, color.memory) = (std::ptr::null_mut(), memory);
            o.color = &color;
        }
        let mut fd = -1;
        if can & 2 != 0 {
            o.picture_memory = exported_image(engine)?;
            made.push((o.picture_memory, shutterbug_memory_destroy));
        }
        if can & 4 != 0 {
            check(unsafe { shutterbug_semaphore_export_fd(engine, 0, &mut o.signal, &mut fd) }, engine)?;
            made.push((o.signal, shutterbug_semaphore_destroy));
            close(fd);
        }
        let (mut frame, mut ready) = (std::ptr::null_mut(), 0);
        check(unsafe { shutterbug_engine_submit_outside(engine, &o, &mut frame) }, engine)?;
        let mut rgb = vec![0; 16 * 12 * 3];
        let to = image(PixelFormat::Rgb8, 16, 12, &mut rgb);
        // A few polls only: how many there are until it is done is chance, and calls are counted.
        let done = (0..3)
            .try_for_each(|_| check(unsafe { shutterbug_frame_poll(frame, &mut ready) }, frame))
            .and_then(|()| check(shutterbug_frame_wait(frame, -1.0), frame))
            .and_then(|()| check(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame));
        assert_eq!(shutterbug_frame_destroy(frame), OK);
        done.map(|()| rgb)
    })();
    for (handle, destroy) in made {
        assert_eq!(destroy(handle), OK);
    }
    done
}

/// An image of 16x12 px that takes pictures, and that can be shared.
fn exported_image(engine: Handle) -> Result<Handle, (Status, String)> {
    let mut d: shutterbug_gpu_image = sized();
    (d.vk_format, d.width, d.height, d.vk_layout, d.vk_usage) = (37, 16, 12, 1, 3);
    let (mut memory, mut fd, mut bytes) = (std::ptr::null_mut(), -1, 0);
    match unsafe { shutterbug_memory_export_image_fd(engine, &d, &mut memory, &mut fd, &mut bytes) } {
        OK => {}
        code => return Err((code, error_of(engine))),
    }
    // What comes in by descriptor takes it on success; on failure it is still the host's.
    let file = |fd: i32| std::fs::read_link(format!("/proc/self/fd/{fd}")).ok();
    let (mut again, was) = (std::ptr::null_mut(), file(fd));
    match unsafe { shutterbug_memory_import_image_fd(engine, &d, fd, bytes, &mut again) } {
        OK => {
            assert_eq!(shutterbug_memory_destroy(again), OK);
            Ok(memory)
        }
        code => {
            let why = error_of(engine);
            assert!(was.is_some() && file(fd) == was, "the descriptor was closed: {why}");
            close(fd);
            assert_eq!(shutterbug_memory_destroy(memory), OK);
            Err((code, why))
        }
    }
}

fn close(fd: i32) {
    use std::os::fd::FromRawFd as _;
    drop(unsafe { std::os::fd::OwnedFd::from_raw_fd(fd) });
}

/// Whole pages.
pub struct Pages(pub *mut u8, pub std::alloc::Layout);

impl Pages {
    pub fn new(bytes: usize) -> Self {
        let layout = std::alloc::Layout::from_size_align(bytes.next_multiple_of(4096), 4096).unwrap();
        Self(unsafe { std::alloc::alloc_zeroed(layout) }, layout)
    }
}

impl Drop for Pages {
    fn drop(&mut self) {
        unsafe { std::alloc::dealloc(self.0, self.1) };
    }
}

pub const LENS: &str =
    "[lens_distortion]\nk1 = 0.05\n[chromatic_aberration]\nscale_r = 1.01\nscale_b = 0.99\n";

const CAMERA: &str = "width = 16\nheight = 12\nfx = 8\nfy = 8\ncx = 8\ncy = 6\nframe_period_s = 0.04\n\
                      [rolling_shutter]\nreadout_time_s = 0.02\n[motion_blur]\nexposure_time_s = 0.008\n";
