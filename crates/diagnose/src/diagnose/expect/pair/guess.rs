//! Motion that the simulator did not deliver: optical flow from each of its frames to the next, where that is good
//! enough and where the real frames lie beside the simulated ones as lines that are read one after another would.
//!
//! A flow is judged by itself (there and back it must end where it began, and the next frame read along it must be
//! this one), and against the real frames: how far content is off must grow with the line and go along the motion.
//! Frames that lie beside each other otherwise are roughly aligned, which [`super::align()`] sees to.

use glam::Vec2;
use rayon::prelude::*;

use super::align::{self, EXACT_PX, lies};
use super::sample::{read, shifted};
use super::{Geometry, GoOn, SimFrames, encoded};
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::linear::solve;
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// There and back a place must be found again to this, px.
const AGAIN_PX: f32 = 0.3;
/// Least share of places that are, and least share of what changed from frame to frame that the flow explains.
const LEAST_SHARE: f64 = 0.5;
const LEAST_EXPLAINED: f64 = 0.6;
/// Least motion that says anything of time, px a frame.
const LEAST_MOTION_PX: f64 = 0.5;
/// Most frames that are looked at beside the real ones, and places across each.
const LOOKED_AT: usize = 12;
const ACROSS: usize = 24;
/// Most that lines read in turn may leave of how far the frames lie apart: of it, and px.
const MOST_LEFT: f64 = 0.5;
const MOST_LEFT_PX: f64 = 0.5;

/// A flow from a frame to the next, and how good it is.
struct Flow {
    motion: Plane<f32>,
    /// 1 where it ends where it began.
    good: Plane<f32>,
    /// Mean difference of the frame from the next one, as it lies and along the flow, DN, where it is good.
    differs_dn: [f64; 2],
    /// Root mean square length, px, and of the way there and back, where it is good.
    length_px: f64,
    again_px: f64,
}

/// Puts flow in the place of motion where it is good enough; says so, or why not.
///
/// # Errors
/// Real frames that cannot be read; no time is left.
pub(super) fn motion(
    sim: &mut SimFrames,
    real_of: &dyn Fn(usize) -> Result<Plane<u8>>,
    go_on: GoOn<'_>,
) -> Result<Option<String>> {
    let count = sim.frames.len();
    let next: Vec<usize> = (0..count.saturating_sub(1)).filter(|i| sim.follows(i + 1)).collect();
    if next.len() < 2 {
        return Ok(None);
    }
    let dn: Vec<Plane<f32>> = sim.frames.iter().map(|f| encoded(&f.radiance)).collect();
    let flows: Vec<Flow> =
        next.par_iter().map(|&i| flow(&dn[i], &dn[i + 1], go_on)).collect::<Result<_>>()?;
    let mean = |of: &dyn Fn(&Flow) -> f64| flows.iter().map(of).sum::<f64>() / flows.len() as f64;
    let share = mean(&|f| share(&f.good));
    let [as_it_lies, along] = [0, 1].map(|k| mean(&|f| f.differs_dn[k]));
    let (length_px, again_px) = (mean(&|f| f.length_px), mean(&|f| f.again_px));
    tracing::info!(
        "flow: {length_px:.2} px, again {again_px:.3} px in {share:.2}, {as_it_lies:.2} to {along:.2} DN"
    );
    let measured = format!(
        "there and back it ends {again_px:.2} px from where it began in {:.0} % of places, and leaves \
        {along:.1} of {as_it_lies:.1} DN",
        100.0 * share
    );
    if length_px < LEAST_MOTION_PX {
        return Ok(None);
    }
    if share < LEAST_SHARE || along > (1.0 - LEAST_EXPLAINED) * as_it_lies {
        return Ok(Some(format!(
            "optical flow between neighbouring simulated frames is not good enough to stand for motion \
            ({measured}): give depth/ \
             with trajectory.tum, or motion/"
        )));
    }
    let left = beside(sim, &dn, (&next, &flows), real_of, go_on)?;
    tracing::info!("beside the real frames: {left:?}");
    let Some([before_px, left_px]) = left else { return Ok(None) };
    if before_px > EXACT_PX && left_px > (MOST_LEFT * before_px).min(MOST_LEFT_PX) {
        return Ok(Some(format!(
            "the real frames lie {before_px:.1} px beside the simulated ones, and lines that are read in turn \
            leave {left_px:.1} px \
             of it: nothing is said of time from optical flow"
        )));
    }
    for (i, flow) in next.into_iter().zip(flows) {
        let frame = &mut sim.frames[i];
        frame.open.data.iter_mut().zip(&flow.good.data).for_each(|(o, g)| *o *= g);
        frame.motion[0] = Some(flow.motion);
    }
    sim.add_backward_motion(go_on)?;
    sim.geometry = Geometry::Motion;
    Ok(Some(format!(
        "motion was estimated by optical flow between neighbouring simulated frames ({measured}): give \
        motion/, or depth/ with \
         trajectory.tum, for narrower answers on shutter and time"
    )))
}

fn share(good: &Plane<f32>) -> f64 {
    good.data.iter().map(|g| f64::from(*g)).sum::<f64>() / good.data.len() as f64
}

/// Flow from one frame to the next, both DN.
fn flow(a: &Plane<f32>, b: &Plane<f32>, go_on: GoOn<'_>) -> Result<Flow> {
    let (forth, back) = (align::motion(a, b, go_on)?, align::motion(b, a, go_on)?);
    let (w, h) = (a.width, a.height);
    let mut good = Plane::new(w, h, 1);
    let (mut sums, mut count) = ([0.0f64; 4], 0.0f64);
    for i in 0..w * h {
        let at = Vec2::new((i % w) as f32 + 0.5, (i / w) as f32 + 0.5);
        let step = Vec2::new(forth.data[2 * i], forth.data[2 * i + 1]);
        let there = at + step;
        let inside =
            there.x >= 0.5 && there.y >= 0.5 && there.x <= w as f32 - 0.5 && there.y <= h as f32 - 0.5;
        let again = (step + shifted(&back, there)).length();
        if !inside || again > AGAIN_PX {
            continue;
        }
        good.data[i] = 1.0;
        let (now, then, lies) = (&a.data[3 * i..3 * i + 3], read(b, there, Quality::Fit), &b.data[3 * i..]);
        let differ = |other: &[f32]| (0..3).map(|c| f64::from((now[c] - other[c]).abs())).sum::<f64>() / 3.0;
        sums[0] += differ(lies);
        sums[1] += differ(&then);
        sums[2] += f64::from(step.length_squared());
        sums[3] += f64::from(again * again);
        count += 1.0;
    }
    let mean = sums.map(|s| s / count.max(1.0));
    Ok(Flow {
        motion: forth,
        good,
        differs_dn: [mean[0], mean[1]],
        length_px: mean[2].sqrt(),
        again_px: mean[3].sqrt(),
    })
}

/// How far the real frames lie beside the simulated ones where both show the same, px, and what lines that are read
/// one after another leave of it, root mean squares; nothing where they have too little in common.
fn beside(
    sim: &SimFrames,
    dn: &[Plane<f32>],
    (next, flows): (&[usize], &[Flow]),
    real_of: &dyn Fn(usize) -> Result<Plane<u8>>,
    go_on: GoOn<'_>,
) -> Result<Option<[f64; 2]>> {
    // Displacement, motion, and line and column as parts of the picture.
    let mut seen: Vec<([f64; 2], [f64; 2], [f64; 2])> = Vec::new();
    let step = next.len().div_ceil(LOOKED_AT);
    for (&i, flow) in next.iter().zip(flows).step_by(step) {
        let real = real_of(i)?;
        let (w, h) = (dn[i].width, dn[i].height);
        if [real.width, real.height] != [w, h] {
            // That pairs have one size is said where they are compared.
            return Ok(None);
        }
        let lies = lies(&real.to_f32(), &dn[i], go_on)?;
        let places = (0..ACROSS * ACROSS).map(|k| [k % ACROSS, k / ACROSS]);
        for [x, y] in places.map(|[x, y]| [(2 * x + 1) * w / (2 * ACROSS), (2 * y + 1) * h / (2 * ACROSS)]) {
            let k = y * w + x;
            if lies.alike.data[k] > 0.0 && flow.good.data[k] > 0.0 && sim.frames[i].open.data[k] > 0.0 {
                let two = |p: &Plane<f32>| [p.data[2 * k], p.data[2 * k + 1]].map(f64::from);
                let part = [y as f64 / h as f64, x as f64 / w as f64];
                seen.push((two(&lies.shift), two(&flow.motion), part));
            }
        }
    }
    let least = LEAST_SHARE * (ACROSS * ACROSS) as f64 * next.len().div_ceil(step) as f64;
    if (seen.len() as f64) < 0.5 * least {
        return Ok(None);
    }
    Ok(left(&seen))
}

/// Of displacements `d = -v (offset + rows y + columns x)`: root mean square as they are, and what the best three
/// numbers leave.
fn left(seen: &[([f64; 2], [f64; 2], [f64; 2])]) -> Option<[f64; 2]> {
    let (mut a, mut b) = (vec![vec![0.0; 3]; 3], vec![0.0; 3]);
    for (d, v, part) in seen {
        let row = [1.0, part[0], part[1]];
        for k in 0..2 {
            for p in 0..3 {
                (0..3).for_each(|q| a[p][q] += v[k] * v[k] * row[p] * row[q]);
                b[p] -= v[k] * row[p] * d[k];
            }
        }
    }
    let x = solve(&a, &b, 1e-9)?;
    let (mut before, mut after) = (0.0, 0.0);
    for (d, v, part) in seen {
        let late = x[0] + x[1] * part[0] + x[2] * part[1];
        for k in 0..2 {
            before += d[k] * d[k];
            after += (d[k] + v[k] * late).powi(2);
        }
    }
    let rms = |sum: f64| (sum / seen.len() as f64).sqrt();
    Some([rms(before), rms(after)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Soft blobs that move with a field.
    fn picture(shift: [f64; 2]) -> Plane<f32> {
        Plane::from_fn(160, 120, |x, y| {
            let (u, v) = (x as f64 - shift[0] * (1.0 + 0.002 * y as f64), y as f64 - shift[1]);
            let value =
                120.0 + 50.0 * (0.21 * u).sin() * (0.17 * v + 0.9).cos() + 40.0 * (0.11 * u + 0.23 * v).sin();
            [value as f32; 3]
        })
    }

    #[test]
    fn a_flow_is_known_and_known_to_be_good() {
        let found = flow(&picture([0.0, 0.0]), &picture([3.0, -1.0]), &|| Ok(())).expect("in time");
        assert!(share(&found.good) > 0.8, "{}", share(&found.good));
        let at = |x: usize, y: usize| found.motion.pixel(x, y).to_vec();
        for (x, y) in [(40, 30), (80, 60), (110, 90)] {
            let m = at(x, y);
            assert!((f64::from(m[0]) - 3.0 * (1.0 + 0.002 * y as f64)).abs() < 0.15, "{m:?}");
            assert!((m[1] + 1.0).abs() < 0.15, "{m:?}");
        }
        assert!(found.differs_dn[1] < 0.2 * found.differs_dn[0], "{:?}", found.differs_dn);
        // Control: another picture is no place to flow to.
        let other = Plane::from_fn(160, 120, |x, y| [((x * 7919 + y * 104_729) % 251) as f32; 3]);
        let none = flow(&picture([0.0, 0.0]), &other, &|| Ok(())).expect("in time");
        assert!(share(&none.good) < 0.5 || none.differs_dn[1] > 0.5 * none.differs_dn[0]);
    }

    #[test]
    fn lines_in_turn_explain_a_shutter_and_no_wrong_pose() {
        let of = |d: &dyn Fn(f64, f64) -> [f64; 2]| -> Vec<([f64; 2], [f64; 2], [f64; 2])> {
            let place = |k: usize| [(k / 20) as f64 / 20.0, (k % 20) as f64 / 20.0];
            (0..400).map(|k| (d(place(k)[0], place(k)[1]), [4.0 + place(k)[1], 1.0], place(k))).collect()
        };
        let shutter = left(&of(&|y, x| [4.0 + x, 1.0].map(|v| -v * (0.1 + 0.5 * y)))).expect("solved");
        assert!(shutter[0] > 1.0 && shutter[1] < 1e-6, "{shutter:?}");
        let turned = left(&of(&|y, x| [3.0 * (y - 0.5), -3.0 * (x - 0.5)])).expect("solved");
        assert!(turned[1] > 0.5 * turned[0], "{turned:?}");
    }
}
