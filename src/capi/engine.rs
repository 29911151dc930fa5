//! Calls on engines: create, set up, query, destroy.

use std::ffi::{CStr, c_char};
use std::path::Path;
use std::slice;

use glam::{DQuat, DVec3};
use tracing::Dispatch;

use super::Handle;
use super::handle::{self, code, guarded, with};
use super::options::{ENGINE_VALIDATION, settings};
use super::session::Session;
use super::sharing::check_out;
use super::status::{self, Fault, Outcome, Status};
use super::types::*;
use super::{camera, log};
use crate::camera::Pose;
use crate::error::Quoted;
use crate::files::Limit;
use crate::gpu::{
    Context, ContextOptions, DeviceChoice, DeviceKind, HostDevice, HostHandles, Loader, Validation,
};

/// `shutterbug_engine_create`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_engine_create(
    options: *const shutterbug_engine_options,
    engine: *mut Handle,
) -> Status {
    // SAFETY: the caller's promise.
    let options = match unsafe { read(options) } {
        Ok(options) => options,
        Err(fault) => return fault.status,
    };
    log::prepare();
    let log = options.log.map(|function| log::dispatch(function, options.log_user));
    let make = || {
        guarded(|| {
            check_out(engine, "engine")?;
            // SAFETY: the caller's promise.
            unsafe { create(&options) }
        })
    };
    let made = match &log {
        Some(log) => tracing::dispatcher::with_default(log, make),
        None => make(),
    };
    match made {
        Ok(session) => {
            // SAFETY: not null and aligned; writable by the caller's promise.
            unsafe { engine.write(handle::insert(session, log) as Handle) };
            status::OK
        }
        Err(fault) => {
            // SAFETY: the caller's promise.
            unsafe { report(&options, &log, &fault) };
            fault.status
        }
    }
}

/// There is no handle to ask for the text yet, so it goes where the options say.
unsafe fn report(options: &shutterbug_engine_options, log: &Option<Dispatch>, fault: &Fault) {
    // SAFETY: `error_capacity` writable characters by the caller's promise.
    unsafe { give_text((options.error_text, options.error_capacity), &fault.text) };
    if let Some(log) = log {
        tracing::dispatcher::with_default(log, || tracing::error!("{}", fault.text));
    }
}

unsafe fn create(o: &shutterbug_engine_options) -> Outcome<Session> {
    let settings = settings(o)?;
    let validation = if o.flags & ENGINE_VALIDATION != 0 { Validation::Required } else { Validation::Off };
    let device = if o.device.is_null() {
        DeviceChoice::First
    } else {
        // SAFETY: the caller's promise.
        DeviceChoice::Named(unsafe { text(o.device, "device") }?)
    };
    let options = ContextOptions { device, validation };
    let context = if !o.host.is_null() {
        // SAFETY: the caller's promise.
        Context::on_host_device(&unsafe { host_device(o.host) }?)?
    } else if !o.get_instance_proc_addr.is_null() {
        // SAFETY: the caller's promise: it is a `vkGetInstanceProcAddr`.
        Context::with_loader(unsafe { Loader::from_raw(o.get_instance_proc_addr) }, &options)?
    } else {
        Context::new(&options)?
    };
    Ok(Session::new(context, settings))
}

unsafe fn host_device(host: *const shutterbug_host_device) -> Outcome<HostDevice> {
    // SAFETY: the caller's promise.
    let host = unsafe { read(host) }?;
    let handles = [
        ("get_instance_proc_addr", host.get_instance_proc_addr.cast_mut()),
        ("instance", host.instance),
        ("physical_device", host.physical_device),
        ("device", host.device),
        ("queue", host.queue),
    ];
    if let Some((name, _)) = handles.iter().find(|(_, h)| h.is_null()) {
        return Err(Fault::argument(format!("shutterbug_host_device.{name} is null")));
    }
    if host.extension_count > 0 && host.extensions.is_null() {
        return Err(Fault::argument("shutterbug_host_device.extensions is null"));
    }
    if !host.extensions.is_aligned() {
        return Err(Fault::argument("shutterbug_host_device.extensions is misaligned"));
    }
    if host.extension_count > 4096 {
        return Err(Fault::argument("shutterbug_host_device.extension_count is above 4096"));
    }
    let mut extensions = Vec::new();
    for i in 0..host.extension_count as usize {
        // SAFETY: `extension_count` NUL-terminated texts by the caller's promise.
        extensions.push(unsafe { text(host.extensions.add(i).read(), "an extension's name") }?);
    }
    let number = |handle: Handle| handle as u64;
    let handles = HostHandles {
        instance: number(host.instance),
        physical: number(host.physical_device),
        device: number(host.device),
        queue: number(host.queue),
        queue_family: host.queue_family,
    };
    // SAFETY: the caller's promise of the header is that of `HostDevice::new` and `Loader::from_raw`.
    Ok(unsafe { HostDevice::new(Loader::from_raw(host.get_instance_proc_addr), handles, &extensions) })
}

/// `shutterbug_engine_destroy`.
#[unsafe(no_mangle)]
pub extern "C" fn shutterbug_engine_destroy(engine: Handle) -> Status {
    handle::destroy::<Session>(engine as usize)
}

fn on_engine(engine: Handle, f: impl FnOnce(&mut Session) -> Outcome<()>) -> Status {
    code(with(engine as usize, f))
}

/// `shutterbug_engine_set_camera`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_engine_set_camera(
    engine: Handle,
    camera: *const shutterbug_camera,
) -> Status {
    on_engine(engine, |session| {
        // SAFETY: the caller's promise.
        let camera = unsafe { read(camera) }?;
        session.set_camera(camera::from_struct(&camera)?)
    })
}

/// `shutterbug_engine_set_camera_text`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_engine_set_camera_text(engine: Handle, camera: *const c_char) -> Status {
    on_engine(engine, |session| {
        // SAFETY: the caller's promise.
        let text = unsafe { text(camera, "the camera's text") }?;
        session.set_camera(camera::from_text(&text)?)
    })
}

/// `shutterbug_engine_load_capture`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_engine_load_capture(engine: Handle, folder: *const c_char) -> Status {
    on_engine(engine, |session| {
        // SAFETY: the caller's promise.
        let folder = unsafe { text(folder, "the capture's folder") }?;
        session.load_capture(Path::new(&folder))
    })
}

/// `shutterbug_engine_load_scene`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_engine_load_scene(engine: Handle, obj_file: *const c_char) -> Status {
    on_engine(engine, |session| {
        // SAFETY: the caller's promise.
        let file = unsafe { text(obj_file, "the scene's file") }?;
        session.load_scene(Path::new(&file))
    })
}

/// `shutterbug_engine_reset_exposure`.
#[unsafe(no_mangle)]
pub extern "C" fn shutterbug_engine_reset_exposure(engine: Handle) -> Status {
    on_engine(engine, |session| {
        session.reset_exposure();
        Ok(())
    })
}

/// `shutterbug_engine_set_trajectory`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_engine_set_trajectory(
    engine: Handle,
    poses: *const shutterbug_stamped_pose,
    count: usize,
) -> Status {
    on_engine(engine, |session| {
        // SAFETY: the caller's promise.
        let (times_s, poses) = unsafe { stamped_poses(poses, count) }?;
        session.set_trajectory(times_s, poses)
    })
}

/// Most poses of a path: as many as a file of them can hold, with eight numbers of a digit each in a line. What a count
/// that was never set asks for is no memory's size.
const MOST_POSES: usize = (Limit::TABLE.bytes() / 16) as usize;

/// Checked poses of the caller.
///
/// # Safety
/// `count` readable poses, or null.
pub(super) unsafe fn stamped_poses(
    poses: *const shutterbug_stamped_pose,
    count: usize,
) -> Outcome<(Vec<f64>, Vec<Pose>)> {
    let too_many = count > MOST_POSES;
    if poses.is_null() || !poses.is_aligned() || count == 0 || too_many {
        return Err(Fault::argument("poses is null, misaligned, or their count is 0 or absurd"));
    }
    // SAFETY: not null, aligned, `count` readable by the caller's promise.
    let poses = unsafe { slice::from_raw_parts(poses, count) };
    let mut times_s = Vec::with_capacity(count);
    let mut checked = Vec::with_capacity(count);
    for (i, pose) in poses.iter().enumerate() {
        if !pose.time_s.is_finite() {
            return Err(Fault::argument(format!("pose {i}: time_s is {}", pose.time_s)));
        }
        times_s.push(pose.time_s);
        checked.push(pose_of(&pose.world_from_camera, i)?);
    }
    Ok((times_s, checked))
}

/// Furthest coordinate, m: that of trajectory files.
const MAX_COORDINATE_M: f64 = 1e9;

fn pose_of(pose: &shutterbug_pose, index: usize) -> Outcome<Pose> {
    let far = pose.translation_m.iter().find(|v| !(v.abs() <= MAX_COORDINATE_M));
    if let Some(far) = far {
        return Err(Fault::argument(format!("pose {index}: a coordinate of {} m", Quoted(*far))));
    }
    let rotation = DQuat::from_array(pose.rotation_xyzw);
    let length = rotation.length();
    if !((length - 1.0).abs() <= 1e-3) {
        return Err(Fault::argument(format!(
            "pose {index}: a quaternion of length {}, not 1 within 1e-3",
            Quoted(length)
        )));
    }
    Ok(Pose { rotation: rotation.normalize(), translation_m: DVec3::from(pose.translation_m) })
}

/// `shutterbug_engine_get_info`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_engine_get_info(
    engine: Handle,
    info: *mut shutterbug_engine_info,
) -> Status {
    on_engine(engine, |session| {
        // SAFETY: the caller's promise.
        unsafe { check(info) }?;
        // SAFETY: checked above; writable by the caller's promise.
        unsafe { info.write(engine_info(session)) };
        Ok(())
    })
}

fn engine_info(session: &Session) -> shutterbug_engine_info {
    let (device, sharing) = (session.context().info(), session.context().sharing());
    let (times, epoch_ns) = session.capture_times();
    let size = session.camera().map_or([0, 0], |c| [c.intrinsics.width, c.intrinsics.height]);
    let bits =
        [sharing.host_alignment_bytes > 0, sharing.memory_fd, sharing.semaphore_fd, sharing.timeline_fd];
    let mut info = shutterbug_engine_info {
        struct_size: size_of::<shutterbug_engine_info>() as u32,
        capabilities: (0..4).filter(|&i| bits[i]).map(|i| 1 << i).sum(),
        device_kind: match device.kind {
            DeviceKind::DiscreteGpu => 1,
            DeviceKind::IntegratedGpu => 2,
            DeviceKind::VirtualGpu => 3,
            DeviceKind::Cpu => 4,
            DeviceKind::Other => 0,
        },
        frames_in_flight: session.settings().frames_in_flight,
        width: size[0],
        height: size[1],
        capture_frames: times.len() as u32,
        validation_messages: session.context().validation_messages().len() as u32,
        epoch_ns,
        host_alignment_bytes: sharing.host_alignment_bytes,
        device_name: [0; 256],
        driver: [0; 256],
        device_uuid: [0; 16],
    };
    put_text(&mut info.device_name, &device.name);
    put_text(&mut info.driver, &device.driver);
    for (i, byte) in info.device_uuid.iter_mut().enumerate() {
        *byte = device.uuid.get(2 * i..2 * i + 2).and_then(|h| u8::from_str_radix(h, 16).ok()).unwrap_or(0);
    }
    info
}

/// `shutterbug_engine_get_frame_times`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_engine_get_frame_times(
    engine: Handle,
    times_s: *mut f64,
    capacity: usize,
) -> Status {
    on_engine(engine, |session| {
        let (times, _) = session.capture_times();
        if times_s.is_null() || !times_s.is_aligned() {
            return Err(Fault::argument("times_s is null or misaligned"));
        }
        if capacity < times.len() {
            let text = format!("room for {capacity} times, there are {}", times.len());
            return Err(Fault::new(status::TOO_SMALL, text));
        }
        // SAFETY: not null, aligned; `capacity` writable by the caller's promise.
        unsafe { slice::from_raw_parts_mut(times_s, times.len()) }.copy_from_slice(times);
        Ok(())
    })
}

/// `shutterbug_version_text`.
#[unsafe(no_mangle)]
pub extern "C" fn shutterbug_version_text() -> *const c_char {
    const TEXT: &CStr = match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
        Ok(text) => text,
        Err(_) => c"",
    };
    TEXT.as_ptr()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_that_was_never_set_is_refused_before_anything_is_read() {
        let pose = std::ptr::NonNull::<shutterbug_stamped_pose>::dangling().as_ptr();
        for count in [0, MOST_POSES + 1, 0xffff_ffff, usize::MAX] {
            // SAFETY: refused by its count; no pose is read.
            assert!(unsafe { stamped_poses(pose, count) }.is_err(), "{count}");
        }
    }
}
