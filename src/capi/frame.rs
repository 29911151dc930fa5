//! Calls on frames: submit, wait, read, destroy.

use std::ffi::c_char;
use std::slice;
use std::sync::Arc;
use std::time::Duration;

use super::Handle;
use super::finer;
use super::handle::{self, Cell, code, find, with};
use super::image::View;
use super::nv12::Nv12;
use super::session::{Session, Submitted};
use super::sharing;
use super::status::{self, Fault, Outcome, Status};
use super::types::*;
use crate::camera::{ShutterTiming, Trajectory};
use crate::engine::{Delivery, Frame};
use crate::plane::{PixelFormat, Plane};

/// Flag of a request: the sharp planes are wanted too.
pub const REQUEST_PLANES: u32 = 1;
/// Flag of a request: the radiance before the sensor too.
pub const REQUEST_RADIANCE: u32 = 2;
/// Flag of a request: the picture in more than 8 bits too.
pub const REQUEST_FINE: u32 = 4;
/// Flag of a request: what the converter delivers too.
pub const REQUEST_RAW: u32 = 8;
/// All of them.
const REQUEST_FLAGS: u32 = REQUEST_PLANES | REQUEST_RADIANCE | REQUEST_FINE | REQUEST_RAW;

/// What stands behind a frame's handle.
pub struct FrameState {
    engine: Arc<Cell<Session>>,
    stage: Stage,
    shutter: ShutterTiming,
    path: Option<Arc<Trajectory>>,
    index: u32,
    gain: f64,
}

enum Stage {
    Pending(Submitted),
    Done(Box<Frame>),
    /// It failed, for this reason.
    Lost(Status, String),
}

impl FrameState {
    pub(super) fn new(engine: Arc<Cell<Session>>, submitted: Submitted) -> Self {
        let (shutter, index, path) = (submitted.shutter, submitted.index, submitted.path.clone());
        let gain = submitted.gain;
        Self { engine, stage: Stage::Pending(submitted), shutter, path, index, gain }
    }

    fn wait(&mut self, limit: Duration) -> Outcome<()> {
        let Stage::Pending(submitted) = &self.stage else { return self.done().map(drop) };
        let waited = self.engine.run(|session| session.wait(submitted, limit));
        match waited {
            Ok(()) => {}
            Err(fault) if [status::BUSY, status::TIMEOUT].contains(&fault.status) => return Err(fault),
            Err(fault) => {
                self.stage = Stage::Lost(fault.status, fault.text.clone());
                return Err(fault);
            }
        }
        let lost = Stage::Lost(status::BUSY, "another thread took the engine".to_owned());
        let Stage::Pending(submitted) = std::mem::replace(&mut self.stage, lost) else {
            unreachable!("seen above")
        };
        let mut held = Some(submitted);
        let collected = self.engine.run(|session| session.collect(held.take().expect("taken once")));
        match (collected, held) {
            (Ok(frame), _) => {
                self.stage = Stage::Done(Box::new(frame));
                Ok(())
            }
            // The engine was not reached: the frame is still there to be waited for.
            (Err(fault), Some(submitted)) => {
                self.stage = Stage::Pending(submitted);
                Err(fault)
            }
            (Err(fault), None) => {
                self.stage = Stage::Lost(fault.status, fault.text.clone());
                Err(fault)
            }
        }
    }

    /// Before it is destroyed: waits for a frame that is in flight, so that its place is free again.
    fn end(&mut self) -> Outcome<()> {
        match self.wait(Duration::MAX) {
            Err(fault) if fault.status == status::TIMEOUT => {
                let Stage::Pending(submitted) = &self.stage else { return Err(fault) };
                self.engine.run(|session| {
                    session.give_up(submitted);
                    Ok(())
                })
            }
            waited => waited,
        }
    }

    fn done(&self) -> Outcome<&Frame> {
        match &self.stage {
            Stage::Done(frame) => Ok(frame),
            Stage::Pending(_) => Err(Fault::new(status::NOT_READY, "the frame has not been waited for")),
            Stage::Lost(status, text) => Err(Fault::new(*status, text.clone())),
        }
    }

    fn ready(&mut self) -> Outcome<bool> {
        match &self.stage {
            Stage::Pending(submitted) => self.engine.run(|session| session.finished(submitted)),
            _ => self.done().map(|_| true),
        }
    }

    fn info(&self) -> Outcome<shutterbug_frame_info> {
        let frame = self.done()?;
        let instant = |time_s: f64| {
            let path = self.path.as_ref().filter(|p| p.covers(time_s, time_s));
            let pose = path.map(|p| p.pose_at(time_s));
            let world_from_camera = match pose {
                Some(p) => shutterbug_pose {
                    translation_m: p.translation_m.to_array(),
                    rotation_xyzw: p.rotation.to_array(),
                },
                None => shutterbug_pose { translation_m: [0.0; 3], rotation_xyzw: [0.0, 0.0, 0.0, 1.0] },
            };
            shutterbug_instant { time_s, world_from_camera, has_pose: pose.is_some().into(), reserved: 0 }
        };
        Ok(shutterbug_frame_info {
            struct_size: size_of::<shutterbug_frame_info>() as u32,
            frame_index: self.index,
            width: frame.picture.width as u32,
            height: frame.picture.height as u32,
            first_line_start: instant(self.shutter.start_s),
            middle: instant(self.shutter.middle_s()),
            last_line_end: instant(self.shutter.end_s()),
            host_ms: frame.host_ms,
            exposure_gain: self.gain,
        })
    }

    /// Copies a plane into the caller's memory.
    ///
    /// # Safety
    /// The header's promise for `to`.
    unsafe fn read(&self, plane: u32, to: &View) -> Outcome<()> {
        let frame = self.done()?;
        if plane == 1 {
            // SAFETY: the caller's promise.
            return unsafe { to.put_picture(&frame.picture) };
        }
        if plane == 5 {
            let Some(radiance) = &frame.radiance else {
                let text = "the frame was submitted without SHUTTERBUG_REQUEST_RADIANCE or SHUTTERBUG_OUTSIDE_RADIANCE";
                return Err(Fault::new(status::STATE, text));
            };
            let formats = [PixelFormat::Rgba32f, PixelFormat::Rgba16f];
            // SAFETY: the caller's promise.
            return unsafe { to.put_floats(&opaque(radiance), formats, "radiance") };
        }
        if !(2..=4).contains(&plane) {
            return Err(Fault::argument(format!("there is no plane {plane}")));
        }
        let planes = frame.planes.as_ref();
        let planes = planes.ok_or_else(|| {
            Fault::new(status::STATE, "the frame was submitted without SHUTTERBUG_REQUEST_PLANES")
        })?;
        let (values, formats, what) = match plane {
            2 => (&planes.color, [PixelFormat::Rgba32f, PixelFormat::Rgba16f], "colour"),
            3 => (&planes.motion_px, [PixelFormat::Rg32f, PixelFormat::Rg16f], "motion"),
            _ => (&planes.depth_m, [PixelFormat::R32f; 2], "depth"),
        };
        // SAFETY: the caller's promise.
        unsafe { to.put_floats(values, formats, what) }
    }
}

/// With an alpha of 1: a method's own number means nothing to a host.
fn opaque(radiance: &Plane<f32>) -> Plane<f32> {
    let mut out = radiance.clone();
    out.data.chunks_exact_mut(4).for_each(|p| p[3] = 1.0);
    out
}

/// Gives a frame that was handed to the device its handle.
///
/// # Safety
/// `frame` is writable.
pub(super) unsafe fn hand_out(
    engine: Handle,
    frame: *mut Handle,
    submit: impl FnOnce(&mut Session) -> Outcome<Submitted>,
) -> Status {
    code(find::<Session>(engine as usize).and_then(|cell| {
        let submitted = cell.run(|session| {
            sharing::check_out(frame, "frame")?;
            submit(session)
        })?;
        let handle = handle::insert(FrameState::new(cell, submitted), None);
        // SAFETY: not null and aligned; writable by the caller's promise.
        unsafe { frame.write(handle as Handle) };
        Ok(())
    }))
}

/// `shutterbug_engine_submit`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_engine_submit(
    engine: Handle,
    request: *const shutterbug_request,
    frame: *mut Handle,
) -> Status {
    // SAFETY: the caller's promise, here and below.
    unsafe {
        hand_out(engine, frame, |session| {
            let request = read(request)?;
            if !request.time_s.is_finite() {
                return Err(Fault::argument(format!("time_s is {}", request.time_s)));
            }
            if request.flags & !REQUEST_FLAGS != 0 || request.reserved != 0 {
                return Err(Fault::argument("unknown flags, or reserved is not 0"));
            }
            let context = session.context().clone();
            let size = session.camera().map_or([0, 0], |c| [c.intrinsics.width, c.intrinsics.height]);
            let delivery = Delivery {
                to: sharing::picture_memory(request.picture_memory, size, &context)?,
                wait: sharing::semaphore(request.wait, request.wait_value, &context)?,
                signal: sharing::semaphore(request.signal, request.signal_value, &context)?,
                values: request.flags & REQUEST_FINE != 0,
                raw: request.flags & REQUEST_RAW != 0,
            };
            let wanted = [REQUEST_PLANES, REQUEST_RADIANCE].map(|flag| request.flags & flag != 0);
            session.submit(request.frame_index, request.time_s, wanted, &delivery)
        })
    }
}

fn on_frame(frame: Handle, f: impl FnOnce(&mut FrameState) -> Outcome<()>) -> Status {
    code(with(frame as usize, f))
}

/// `shutterbug_frame_poll`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_frame_poll(frame: Handle, ready: *mut u32) -> Status {
    on_frame(frame, |state| {
        if ready.is_null() || !ready.is_aligned() {
            return Err(Fault::argument("ready is null or misaligned"));
        }
        let value = state.ready()?;
        // SAFETY: not null and aligned; writable by the caller's promise.
        unsafe { ready.write(value.into()) };
        Ok(())
    })
}

/// `shutterbug_frame_wait`.
#[unsafe(no_mangle)]
pub extern "C" fn shutterbug_frame_wait(frame: Handle, limit_s: f64) -> Status {
    on_frame(frame, |state| {
        let limit = match limit_s {
            s if s.is_nan() => return Err(Fault::argument("limit_s is not a number")),
            s if !(0.0..=1e9).contains(&s) => Duration::MAX,
            s => Duration::from_secs_f64(s),
        };
        state.wait(limit)
    })
}

/// `shutterbug_frame_read`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_frame_read(
    frame: Handle,
    plane: u32,
    to: *const shutterbug_image,
) -> Status {
    // SAFETY: the caller's promise, in all of it.
    on_frame(frame, |state| unsafe {
        let image = named(to, "image")?;
        if plane == 1 && Nv12::wanted(&image) {
            return Nv12::new(&image)?.put(&state.done()?.picture);
        }
        if plane == 1 && finer::wanted(&image) {
            return finer::put_picture(&image, state.done()?);
        }
        if plane == 6 {
            return finer::put_raw(&image, state.done()?);
        }
        state.read(plane, &View::new(&image, "image")?)
    })
}

/// `shutterbug_frame_get_info`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_frame_get_info(
    frame: Handle,
    info: *mut shutterbug_frame_info,
) -> Status {
    on_frame(frame, |state| {
        // SAFETY: the caller's promise.
        unsafe { check(info) }?;
        let value = state.info()?;
        // SAFETY: checked above; writable by the caller's promise.
        unsafe { info.write(value) };
        Ok(())
    })
}

/// `shutterbug_frame_get_times`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_frame_get_times(
    frame: Handle,
    times: *mut shutterbug_pass_time,
    capacity: usize,
    count: *mut usize,
) -> Status {
    on_frame(frame, |state| {
        if count.is_null() || !count.is_aligned() || (!times.is_null() && !times.is_aligned()) {
            return Err(Fault::argument("count is null, or count or times is misaligned"));
        }
        let passes = &state.done()?.times;
        if !times.is_null() {
            if capacity < passes.len() {
                let text = format!("room for {capacity} passes, there are {}", passes.len());
                return Err(Fault::new(status::TOO_SMALL, text));
            }
            // SAFETY: not null, aligned; `capacity` writable by the caller's promise.
            let to = unsafe { slice::from_raw_parts_mut(times, passes.len()) };
            for (to, pass) in to.iter_mut().zip(passes) {
                let mut name: [c_char; 32] = [0; 32];
                put_text(&mut name, pass.name);
                *to = shutterbug_pass_time { name, ms: pass.ms };
            }
        }
        // SAFETY: not null and aligned; writable by the caller's promise.
        unsafe { count.write(passes.len()) };
        Ok(())
    })
}

/// `shutterbug_frame_destroy`.
#[unsafe(no_mangle)]
pub extern "C" fn shutterbug_frame_destroy(frame: Handle) -> Status {
    match with(frame as usize, FrameState::end) {
        Err(fault) if fault.status == status::BUSY => status::BUSY,
        _ => handle::destroy::<FrameState>(frame as usize),
    }
}
