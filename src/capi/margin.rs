//! The margin that a host's renderer must add around the camera's picture.

use super::Handle;
use super::handle::{code, with};
use super::session::Session;
use super::status::{Fault, Outcome, Status};
use super::types::*;
use crate::engine::{BorderRays, MarginNeed, OutsideLens};
use crate::error::Quoted;

/// `shutterbug_engine_margin`.
///
/// # Safety
/// As the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn shutterbug_engine_margin(
    engine: Handle,
    bound: *const shutterbug_motion_bound,
    margin_x_px: *mut u32,
    margin_y_px: *mut u32,
) -> Status {
    let ask = |session: &mut Session| {
        // SAFETY: the caller's promise.
        let bound = unsafe { read(bound) }?;
        if [margin_x_px, margin_y_px].iter().any(|p| p.is_null() || !p.is_aligned()) {
            return Err(Fault::argument("margin_x_px or margin_y_px is null or misaligned"));
        }
        let [x, y] = margin(session, &bound)?;
        // SAFETY: not null and aligned; writable by the caller's promise.
        unsafe {
            margin_x_px.write(x);
            margin_y_px.write(y);
        }
        Ok(())
    };
    code(with(engine as usize, ask))
}

fn margin(session: &Session, bound: &shutterbug_motion_bound) -> Outcome<[u32; 2]> {
    let numbers = [
        ("turn_rate_rad_s", bound.turn_rate_rad_s),
        ("speed_m_s", bound.speed_m_s),
        ("nearest_m", bound.nearest_m),
    ];
    if let Some((name, value)) = numbers.iter().find(|(_, v)| !(*v >= 0.0 && v.is_finite())) {
        return Err(Fault::argument(format!(
            "shutterbug_motion_bound.{name} is {}, not 0 or above",
            Quoted(*value)
        )));
    }
    if !bound.color_delay_s.is_finite() || bound.reserved != 0 {
        return Err(Fault::argument(
            "shutterbug_motion_bound: color_delay_s is no number, or reserved is not 0",
        ));
    }
    if bound.speed_m_s > 0.0 && bound.nearest_m == 0.0 {
        return Err(Fault::argument("shutterbug_motion_bound: a speed needs nearest_m, what is nearest"));
    }
    let request = session.outside_request(0, 0.0, true)?;
    let nominal = session.camera().expect("the request has one").intrinsics;
    let shutter = &request.shutter;
    // From the colour to the line that is furthest from it in time.
    let (before_s, after_s) = (bound.color_delay_s - shutter.start_s, shutter.end_s() - bound.color_delay_s);
    let span_s = before_s.max(after_s).max(0.0);
    let lens = OutsideLens::of(&request.settings, &nominal);
    let nearest_m = if bound.nearest_m > 0.0 { bound.nearest_m } else { f64::INFINITY };
    let need = MarginNeed { border: &BorderRays::new(&nominal, lens.as_ref())?, nearest_m };
    Ok(need.of_bound(bound.turn_rate_rad_s * span_s, bound.speed_m_s * span_s))
}
