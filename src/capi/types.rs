//! The structs of `include/shutterbug.h`, field by field. `tests/abi/layout.rs` compares sizes and offsets.
#![allow(missing_docs)] // The header is the manual.

use std::ffi::{c_char, c_void};

use super::log::LogFn;
use super::status::{self, Fault, Outcome};

/// A struct whose first field is its size.
///
/// # Safety
/// `repr(C)`, first field `struct_size: u32`, every bit pattern is a value.
pub unsafe trait Sized32: Copy {
    const NAME: &'static str;
    /// Sizes of before it grew at its end. Every one of its versions began like this one; what it lacks is zero.
    const OLD_SIZES: &'static [usize] = &[];
}

macro_rules! structs {
    ($($(#[$doc:meta])* $name:ident { $($field:ident: $type:ty,)+ })+) => {
        $(
            $(#[$doc])*
            #[repr(C)]
            #[derive(Clone, Copy)]
            pub struct $name { $(pub $field: $type,)+ }
        )+

        /// Name, size and (field, offset, size) of every struct, for the comparison with the header.
        pub const LAYOUT: &[(&str, usize, &[(&str, usize, usize)])] = &[
            $((stringify!($name), size_of::<$name>(), &[
                $((stringify!($field), std::mem::offset_of!($name, $field), size_of::<$type>()),)+
            ]),)+
        ];
    };
}

structs! {
    shutterbug_pose { translation_m: [f64; 3], rotation_xyzw: [f64; 4], }

    shutterbug_stamped_pose { time_s: f64, world_from_camera: shutterbug_pose, }

    shutterbug_instant {
        time_s: f64,
        world_from_camera: shutterbug_pose,
        has_pose: u32,
        reserved: u32,
    }

    shutterbug_host_device {
        struct_size: u32,
        queue_family: u32,
        get_instance_proc_addr: *const c_void,
        instance: *mut c_void,
        physical_device: *mut c_void,
        device: *mut c_void,
        queue: *mut c_void,
        extensions: *const *const c_char,
        extension_count: u32,
        reserved: u32,
    }

    shutterbug_engine_options {
        struct_size: u32,
        flags: u32,
        method: u32,
        samples: u32,
        frames_in_flight: u32,
        motion_images: u32,
        max_blur_samples: u32,
        max_side_px: u32,
        time_limit_s: f64,
        seed: u64,
        device: *const c_char,
        log: Option<LogFn>,
        log_user: *mut c_void,
        error_text: *mut c_char,
        error_capacity: u64,
        host: *const shutterbug_host_device,
        get_instance_proc_addr: *const c_void,
    }

    shutterbug_camera {
        struct_size: u32,
        width: u32,
        height: u32,
        scan_order: u32,
        fx_px: f64,
        fy_px: f64,
        cx_px: f64,
        cy_px: f64,
        frame_period_s: f64,
        readout_time_s: f64,
        exposure_time_s: f64,
        flags: u32,
        reserved: u32,
    }

    shutterbug_engine_info {
        struct_size: u32,
        capabilities: u32,
        device_kind: u32,
        frames_in_flight: u32,
        width: u32,
        height: u32,
        capture_frames: u32,
        validation_messages: u32,
        epoch_ns: i64,
        host_alignment_bytes: u64,
        device_name: [c_char; 256],
        driver: [c_char; 256],
        device_uuid: [u8; 16],
    }

    shutterbug_image {
        struct_size: u32,
        format: u32,
        width: u32,
        height: u32,
        stride_bytes: u64,
        capacity_bytes: u64,
        pixels: *mut c_void,
        memory: *mut c_void,
        memory_offset: u64,
    }

    shutterbug_request {
        struct_size: u32,
        frame_index: u32,
        time_s: f64,
        flags: u32,
        reserved: u32,
        wait: *mut c_void,
        signal: *mut c_void,
        wait_value: u64,
        signal_value: u64,
        picture_memory: *mut c_void,
    }

    shutterbug_motion_convention {
        struct_size: u32,
        direction: u32,
        unit: u32,
        y_axis: u32,
        scale_x: f64,
        scale_y: f64,
        interval_s: f64,
    }

    shutterbug_depth_convention {
        struct_size: u32,
        kind: u32,
        near_m: f64,
        far_m: f64,
    }

    shutterbug_outside {
        struct_size: u32,
        frame_index: u32,
        time_s: f64,
        color_time_s: f64,
        first_motion_time_s: f64,
        motion_step_s: f64,
        flags: u32,
        encoding: u32,
        margin_x_px: u32,
        margin_y_px: u32,
        motion_count: u32,
        reserved: u32,
        color: *const shutterbug_image,
        motions: *const shutterbug_image,
        motion_convention: *const shutterbug_motion_convention,
        depth: *const shutterbug_image,
        depth_convention: *const shutterbug_depth_convention,
        poses: *const shutterbug_stamped_pose,
        wait: *mut c_void,
        signal: *mut c_void,
        wait_value: u64,
        signal_value: u64,
        picture_memory: *mut c_void,
        pose_count: u32,
        body_count: u32,
        nearest_m: f64,
        ids: *const shutterbug_image,
        bodies: *const shutterbug_body,
        picture_count: u32,
        reserved_more: u32,
        pictures: *const shutterbug_picture,
    }

    shutterbug_body { id: u32, pose_count: u32, poses: *const shutterbug_stamped_pose, }

    shutterbug_picture {
        time_s: f64,
        color: *const shutterbug_image,
        depth: *const shutterbug_image,
        ids: *const shutterbug_image,
    }

    shutterbug_pose_convention {
        struct_size: u32,
        form: u32,
        axes: u32,
        direction: u32,
        metres: f64,
    }

    shutterbug_view {
        struct_size: u32,
        reserved: u32,
        color: *const shutterbug_image,
        depth: *const shutterbug_image,
        depth_convention: *const shutterbug_depth_convention,
        world_from_camera: shutterbug_pose,
        encoding: u32,
        reserved_more: u32,
    }

    shutterbug_agreement {
        struct_size: u32,
        verdict: u32,
        change: u32,
        reserved: u32,
        as_given: f64,
        best: f64,
    }

    shutterbug_motion_bound {
        struct_size: u32,
        reserved: u32,
        turn_rate_rad_s: f64,
        speed_m_s: f64,
        nearest_m: f64,
        color_delay_s: f64,
    }

    shutterbug_gpu_image {
        struct_size: u32,
        vk_format: u32,
        width: u32,
        height: u32,
        vk_layout: u32,
        vk_layout_after: u32,
        vk_tiling: u32,
        vk_usage: u32,
        vk_image: u64,
    }

    shutterbug_frame_info {
        struct_size: u32,
        frame_index: u32,
        width: u32,
        height: u32,
        first_line_start: shutterbug_instant,
        middle: shutterbug_instant,
        last_line_end: shutterbug_instant,
        host_ms: f64,
        exposure_gain: f64,
    }

    shutterbug_pass_time { name: [c_char; 32], ms: f64, }
}

macro_rules! sized {
    ($($name:ident)+) => {$(
        // SAFETY: declared above as `repr(C)` with `struct_size` first; numbers and raw pointers only.
        unsafe impl Sized32 for $name {
            const NAME: &'static str = stringify!($name);
        }
    )+};
}

sized! {
    shutterbug_host_device shutterbug_engine_options shutterbug_camera shutterbug_engine_info shutterbug_image
    shutterbug_request shutterbug_motion_convention shutterbug_depth_convention shutterbug_motion_bound
    shutterbug_frame_info shutterbug_gpu_image shutterbug_pose_convention shutterbug_agreement
}

// SAFETY: as above.
unsafe impl Sized32 for shutterbug_outside {
    const NAME: &'static str = "shutterbug_outside";
    const OLD_SIZES: &'static [usize] = &[
        std::mem::offset_of!(shutterbug_outside, pose_count),
        std::mem::offset_of!(shutterbug_outside, picture_count),
    ];
}

// SAFETY: as above.
unsafe impl Sized32 for shutterbug_view {
    const NAME: &'static str = "shutterbug_view";
    const OLD_SIZES: &'static [usize] = &[std::mem::offset_of!(shutterbug_view, encoding)];
}

/// Checks a pointer and the size that it says.
///
/// # Safety
/// Null, misaligned, or points to at least 4 readable bytes.
pub(super) unsafe fn check<T: Sized32>(pointer: *const T) -> Outcome<()> {
    if pointer.is_null() {
        return Err(Fault::argument(format!("{} is null", T::NAME)));
    }
    if !pointer.is_aligned() {
        return Err(Fault::argument(format!("{} lies at no multiple of {}", T::NAME, align_of::<T>())));
    }
    // SAFETY: not null and aligned; the first four bytes are readable by the caller's promise.
    let size = unsafe { pointer.cast::<u32>().read() };
    if size as usize == size_of::<T>() || T::OLD_SIZES.contains(&(size as usize)) {
        return Ok(());
    }
    let text = format!("{}.struct_size is {size}; this library knows {}", T::NAME, size_of::<T>());
    Err(Fault::new(status::STRUCT_SIZE, text))
}

/// Reads a struct of the caller.
///
/// # Safety
/// Null, misaligned, or points to as many readable bytes as its first field says.
pub(super) unsafe fn read<T: Sized32>(pointer: *const T) -> Outcome<T> {
    // SAFETY: the caller's promise.
    unsafe { check(pointer) }?;
    let mut value = std::mem::MaybeUninit::<T>::zeroed();
    // SAFETY: not null, aligned; as many bytes as it says are readable, and no more than there is room for. Every bit
    // pattern, zeros among them, is a value.
    unsafe {
        let bytes = pointer.cast::<u32>().read() as usize;
        value.as_mut_ptr().cast::<u8>().copy_from_nonoverlapping(pointer.cast(), bytes.min(size_of::<T>()));
        Ok(value.assume_init())
    }
}

/// An image of the caller, by the name of what points to it.
///
/// # Safety
/// As for [`read`].
pub(super) unsafe fn named(pointer: *const shutterbug_image, what: &str) -> Outcome<shutterbug_image> {
    if pointer.is_null() {
        return Err(Fault::argument(format!("{what} is null")));
    }
    // SAFETY: the caller's promise.
    unsafe { read(pointer) }.map_err(|fault| Fault::new(fault.status, format!("{what}: {}", fault.text)))
}

/// A text of the caller.
///
/// # Safety
/// Null, or NUL-terminated.
pub(super) unsafe fn text(pointer: *const c_char, what: &str) -> Outcome<String> {
    if pointer.is_null() {
        return Err(Fault::argument(format!("{what} is null")));
    }
    // SAFETY: NUL-terminated by the caller's promise.
    let text = unsafe { std::ffi::CStr::from_ptr(pointer) };
    text.to_str().map(str::to_owned).map_err(|_| Fault::argument(format!("{what} is not UTF-8")))
}

/// Copies a text to the caller's buffer, cut to `capacity`; a null buffer takes nothing.
///
/// # Safety
/// Null, or so many writable characters.
pub(super) unsafe fn give_text((to, capacity): (*mut c_char, u64), text: &str) {
    if !to.is_null() && capacity > 0 && capacity <= isize::MAX as u64 {
        // Not as a slice: all of it would have to hold values already, and most of it is never touched.
        let bytes = text.as_bytes()[..fits(text, capacity as usize - 1)].iter().chain(std::iter::once(&0));
        for (i, byte) in bytes.enumerate() {
            // SAFETY: so many writable characters by the caller's promise, and no more than that are written.
            unsafe { to.add(i).write(*byte as c_char) };
        }
    }
}

/// How many bytes of a text fit, cut at a character's border.
fn fits(text: &str, room: usize) -> usize {
    (0..=room.min(text.len())).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0)
}

/// Copies a text into a fixed field, cut where it does not fit (at a character's border), NUL-terminated.
pub(super) fn put_text(field: &mut [c_char], text: &str) {
    let Some(room) = field.len().checked_sub(1) else { return };
    let end = fits(text, room);
    for (to, from) in field.iter_mut().zip(text.as_bytes()[..end].iter().chain(std::iter::once(&0))) {
        *to = *from as c_char;
    }
}
