//! Why a gyro does not explain how frames move: axes that are not the camera's, or rates in another unit. The frames
//! say how the camera turned from one to the next; of all ways to name and point the gyro's axes the best one says the
//! same.

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::input::Footage;
use super::step::Step;

/// Furthest offset of the clocks that is looked for, s, and the step.
pub(super) const FURTHEST_S: f64 = 0.5;
const STEP_S: f64 = 0.004;
/// The gyro explains the footage if it leaves at most so much of how content moves.
pub(super) const MOST_LEFT: f64 = 0.2;
/// By how much the gyro may turn further than the frames show: focal lengths are known so well.
pub(super) const SCALE_OFF: f64 = 0.03;
/// Rounds of the fit of a turn.
const ROUNDS: usize = 4;
/// Another way to name the axes is as good if it leaves less than so many times as much: turns about one axis alone
/// tell nothing of the others.
const AS_GOOD: f64 = 2.0;

/// A camera axis of the gyro: its number, and which way.
type Axis = (usize, f64);

/// Ways to name and point the axes, with what rates are to be multiplied by.
#[derive(Clone, Copy, Debug)]
struct Way {
    axes: [Axis; 3],
    scale: f64,
    /// What it leaves of the frames' turns.
    left: f64,
}

/// What is wrong with the gyro, in a sentence; nothing where no axes and no unit explain the frames either.
pub(super) fn fault(footage: &Footage, steps: &[&Step]) -> Option<String> {
    let times: Vec<[f64; 2]> = steps.iter().map(|s| s.frames.map(|f| footage.frames[f].start_s)).collect();
    let turns: Vec<DVec3> = steps.iter().map(|s| turn_of(s)).collect();
    let way = sorted_ways(&turns, &|late_s| {
        times.iter().map(|[from_s, to_s]| footage.gyro.between(from_s + late_s, to_s + late_s)).collect()
    });
    said(&way, &turns)
}

/// How the camera turned from one frame to the next by where its points went: the later camera's axes in the earlier
/// one's, as axis times angle.
fn turn_of(step: &Step) -> DVec3 {
    let mut turn = DVec3::ZERO;
    for _ in 0..ROUNDS {
        let (mut a, mut b) = (DMat3::ZERO, DVec3::ZERO);
        for [here, there] in step.rays() {
            let then = DQuat::from_scaled_axis(-turn) * here.extend(1.0);
            let p = then.truncate() / then.z;
            // By how much the point goes for a turn about each axis.
            let slopes = [
                DVec2::new(p.x * p.y, 1.0 + p.y * p.y),
                DVec2::new(-1.0 - p.x * p.x, -p.x * p.y),
                DVec2::new(p.y, -p.x),
            ];
            let off = *there - p;
            for (i, s) in slopes.iter().enumerate() {
                b[i] += s.dot(off);
                (0..3).for_each(|j| a.col_mut(j)[i] += s.dot(slopes[j]));
            }
        }
        turn += a.inverse() * b;
    }
    turn
}

/// All ways, each at the offset of the clocks that suits it most, the one that leaves least first.
fn sorted_ways(turns: &[DVec3], gyro_at: &dyn Fn(f64) -> Vec<DVec3>) -> Vec<Way> {
    let mut best: Vec<Way> = ways().map(|axes| Way { axes, scale: 0.0, left: f64::INFINITY }).collect();
    let all: f64 = turns.iter().map(|t| t.length_squared()).sum();
    for late_s in offsets_s() {
        let gyro = gyro_at(late_s);
        let own: f64 = gyro.iter().map(|t| t.length_squared()).sum();
        for way in &mut best {
            let both: f64 = turns.iter().zip(&gyro).map(|(t, g)| t.dot(named(&way.axes, *g))).sum();
            // Negative scales are other ways.
            let scale = (both / own).max(0.0);
            let left = (1.0 - both.max(0.0) * scale / all).max(0.0).sqrt();
            if left < way.left {
                (way.scale, way.left) = (scale, left);
            }
        }
    }
    best.sort_by(|a, b| a.left.total_cmp(&b.left));
    best
}

/// Offsets of the clocks that are looked at, s.
pub(super) fn offsets_s() -> impl Iterator<Item = f64> {
    let count = (2.0 * FURTHEST_S / STEP_S) as i32;
    (0..=count).map(|k| -FURTHEST_S + STEP_S * f64::from(k))
}

/// The 48 ways to name three axes and point each of them.
fn ways() -> impl Iterator<Item = [Axis; 3]> {
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    orders.into_iter().flat_map(|order: [usize; 3]| {
        (0..8).map(move |signs: u32| {
            std::array::from_fn(|k| (order[k], if signs & (1 << k) == 0 { 1.0 } else { -1.0 }))
        })
    })
}

/// The gyro's turn with its axes named otherwise.
fn named(axes: &[Axis; 3], gyro: DVec3) -> DVec3 {
    DVec3::from(axes.map(|(axis, sign)| sign * gyro[axis]))
}

fn said(ways: &[Way], turns: &[DVec3]) -> Option<String> {
    let best = ways.iter().find(|w| w.left <= MOST_LEFT && !turns.is_empty())?;
    let rivals = || ways.iter().filter(|w| w.left <= AS_GOOD * best.left);
    let unit = unit(best.scale);
    let as_given = |w: &Way| w.axes.iter().enumerate().all(|(k, (axis, sign))| k == *axis && *sign > 0.0);
    let opposite = |w: &Way| w.axes.iter().enumerate().all(|(k, (axis, sign))| k == *axis && *sign < 0.0);
    // The simplest of those that explain alike.
    if rivals().any(as_given) {
        return unit.map(|unit| format!("the gyro turns as the frames do, in another unit: {unit}"));
    }
    let of_unit = unit.map_or_else(String::new, |unit| format!("; {unit}"));
    if rivals().any(opposite) {
        return Some(format!(
            "the frames turn the other way than the gyro: its rates have the opposite sign of the camera's turn in \
             its own axes (x right, y down, z forward){of_unit}"
        ));
    }
    let names = ["wx", "wy", "wz"];
    let list = best.axes.map(|(axis, sign)| format!("{}{}", if sign < 0.0 { "-" } else { "" }, names[axis]));
    let perhaps =
        if rivals().count() > 1 { ", or others that these turns do not tell from them" } else { "" };
    Some(format!(
        "the frames turn as the gyro would if its rates about the camera's axes (x right, y down, z forward) were \
         ({}){perhaps}: imu.csv has to hold them so{of_unit}",
        list.join(", ")
    ))
}

/// What rates that are to be multiplied by so much are; nothing for rad/s.
fn unit(scale: f64) -> Option<String> {
    let is = |factor: f64| (scale / factor - 1.0).abs() <= SCALE_OFF;
    if is(1.0) {
        None
    } else if is(1f64.to_radians()) {
        Some("its rates are in degrees/s, expected rad/s".to_owned())
    } else {
        Some(format!("its rates have to be multiplied by {scale:.4} to be rad/s"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turns of a hand at 30 frames a second, about all axes.
    fn turn(time_s: f64) -> DVec3 {
        0.02 * DVec3::new((7.0 * time_s).sin(), (5.0 * time_s + 1.0).cos(), 0.6 * (9.0 * time_s).sin())
    }

    fn hint(gyro: impl Fn(DVec3) -> DVec3, late_s: f64) -> Option<String> {
        let times: Vec<f64> = (0..30).map(|k| f64::from(k) / 30.0).collect();
        let turns: Vec<DVec3> = times.iter().map(|t| turn(*t)).collect();
        said(
            &sorted_ways(&turns, &|late| times.iter().map(|t| gyro(turn(t + late - late_s))).collect()),
            &turns,
        )
    }

    #[test]
    fn axes_and_units_are_named() {
        let says = |hint: Option<String>, text: &str| {
            let hint = hint.unwrap_or_default();
            assert!(hint.contains(text), "{hint}");
        };
        says(hint(|t| DVec3::new(t.y, t.x, t.z), 0.04), "(wy, wx, wz)");
        says(hint(|t| DVec3::new(t.x, -t.y, -t.z), -0.1), "(wx, -wy, -wz)");
        says(hint(|t| -t, 0.0), "opposite sign");
        says(hint(|t| t.map(f64::to_degrees), 0.02), "in degrees/s");
        says(hint(|t| DVec3::new(-t.z, t.x, t.y).map(f64::to_degrees), 0.0), "(wy, wz, -wx)");
        says(hint(|t| DVec3::new(-t.z, t.x, t.y).map(f64::to_degrees), 0.0), "in degrees/s");
        says(hint(|t| 0.001 * t, 0.0), "multiplied by 1000");
        // Controls: what is right has no fault, and rates of something else none that can be named.
        assert_eq!(hint(|t| t, 0.1), None);
        assert_eq!(hint(|t| DVec3::new(t.x * t.x, t.y * t.z, t.x) * 30.0, 0.0), None);
        assert_eq!(hint(|_| DVec3::ZERO, 0.0), None);
    }

    #[test]
    fn the_turn_of_points_is_found() {
        let is = DVec3::new(0.03, -0.05, 0.02);
        let rays = (0..20).map(|k| DVec2::new(f64::from(k % 5) * 0.2 - 0.4, f64::from(k / 5) * 0.2 - 0.3));
        let pairs = rays.map(|ray| {
            let then = DQuat::from_scaled_axis(-is) * ray.extend(1.0);
            [ray, then.truncate() / then.z]
        });
        let found = turn_of(&Step::of_rays(pairs.collect()));
        assert!((found - is).length() < 1e-6, "{found}");
    }
}
