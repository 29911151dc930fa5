//! How real and simulated frames lie on each other, measured before anything is compared: displacements of a grid of
//! windows, each with a brightness of its own (Lucas and Kanade 1981, with gain and offset), smooth from window to
//! window, of pictures that are made equally sharp.

use std::sync::Arc;

use rayon::prelude::*;

use super::GoOn;
use super::field::{ACROSS, ALIKE, Field, Window, covariances};
use super::grey::Grey;
use super::sharpness::Blurred;
use shutterbug::error::Result;
use shutterbug::plane::Plane;
use shutterbug::plane::stats::median;

/// Below this frames are compared as they lie, px: reading a picture between its pixels would change it by more.
pub(super) const EXACT_PX: f64 = 0.25;
/// Width of the finer windows by which motion is estimated, px.
const FINE_PX: usize = 10;
/// Width of the smallest picture of a pyramid, px.
const SMALLEST_PX: usize = 48;
/// Rounds on each picture of a pyramid.
const ROUNDS: usize = 6;
/// Pixels that a window looks at, or a few more: in larger ones every second, third ... of a row and column tells as
/// much as noise leaves to be told.
const WINDOW_PX: usize = 1 << 16;

/// How one frame lies on another.
#[derive(Clone)]
pub(crate) struct Lies {
    /// Where the content of each pixel of the real frame is in the simulated one, px from there.
    pub shift: Arc<Plane<f32>>,
    /// Root mean square of it over what can be told, px; nothing where the frames have nothing in common.
    pub rms_px: Option<f64>,
    /// The same of what is left behind it.
    pub left_px: Option<f64>,
    /// 1 where windows are alike and lie on each other, shape `[height, width, 1]`.
    pub alike: Arc<Plane<f32>>,
}

/// What each window of two pictures says of how the second lies beside where `field` has it.
fn windows(a: &Grey, b: &Grey, field: &Field) -> Vec<Window> {
    let size = (a.w, a.h);
    // Nothing is displaced yet: pixels are read as they are.
    let rests = field.at.iter().all(|d| *d == [0.0; 2]);
    let one = |i: usize| {
        let [columns, rows] = field.range(i, size, 0.75);
        let every = (columns.len() * rows.len()).div_ceil(WINDOW_PX).isqrt().max(1);
        let mut seen = Vec::with_capacity(columns.len().div_ceil(every) * rows.len().div_ceil(every));
        let columns: Vec<_> =
            columns.step_by(every).map(|x| (x, Field::place(x as f64, field.nx, a.w))).collect();
        for y in rows.step_by(every) {
            let across = Field::place(y as f64, field.ny, a.h);
            for &(x, along) in &columns {
                let own = f64::from(a.data[y * a.w + x]);
                if rests {
                    let at = |x: usize, y: usize| f64::from(b.data[y * b.w + x]);
                    let (gx, gy) = (0.5 * (at(x + 1, y) - at(x - 1, y)), 0.5 * (at(x, y + 1) - at(x, y - 1)));
                    seen.push([own, at(x, y), gx, gy]);
                    continue;
                }
                let [u, v] = field.between(along, across);
                let (px, py) = (x as f64 + u, y as f64 + v);
                if px < 1.0 || py < 1.0 || px >= a.w as f64 - 2.0 || py >= a.h as f64 - 2.0 {
                    continue;
                }
                let [value, gx, gy] = b.read(px, py).map(f64::from);
                seen.push([own, value, gx, gy]);
            }
        }
        Content::of(&seen)
    };
    let all: Vec<Content> = (0..field.at.len()).into_par_iter().map(one).collect();
    let gains: Vec<(f64, f64)> = all.iter().map(Content::gain).collect();
    all.iter().zip(field.smoothed(&gains)).map(|(content, gain)| content.window(gain)).collect()
}

/// What a window is made of: covariances of the value in the first picture, that in the second one, and its slopes.
#[derive(Clone, Copy, Default)]
struct Content {
    n: f64,
    c: [[f64; 4]; 4],
    alike: f64,
}

impl Content {
    fn of(seen: &[[f64; 4]]) -> Self {
        if seen.len() < 12 {
            return Self::default();
        }
        let (n, c) = (seen.len() as f64, covariances(seen));
        Self { n, c, alike: c[0][1] / (c[0][0] * c[1][1]).sqrt().max(1e-9) }
    }

    /// Whether it says where it lies.
    fn tells(&self) -> bool {
        self.alike > 0.3 && self.c[1][1] >= 0.25
    }

    /// The gain that fits it best, and how well it is known.
    fn gain(&self) -> (f64, f64) {
        let c = &self.c;
        let gain = c[0][1] / c[1][1].max(1e-9);
        let noise = (c[0][0] - gain * c[0][1]).max(0.1);
        (gain, if self.tells() { self.n * c[1][1] / noise } else { 0.0 })
    }

    /// Normal equations: `a = gain (b + slope . d) + offset`, with an offset from the window itself.
    fn window(&self, gain: f64) -> Window {
        let (c, alike) = (&self.c, self.alike);
        if !self.tells() {
            return Window { alike, ..Window::default() };
        }
        // What a gain could do is taken out of the slopes.
        let beside = |i: usize, j: usize| c[i][j] - c[i][1] * c[1][j] / c[1][1];
        let noise = (c[0][0] - 2.0 * gain * c[0][1] + gain * gain * c[1][1]).max(0.1);
        let weight = self.n * alike.powi(4) / noise;
        let a = [beside(2, 2), beside(2, 3), beside(3, 3)].map(|v| weight * gain * gain * v);
        let b = [beside(2, 0), beside(3, 0)].map(|v| weight * gain * v);
        Window { a, b, alike }
    }
}

/// How the simulated frame lies on the real one (both DN, shape `[height, width, 3]`).
///
/// # Errors
/// No time is left.
pub(crate) fn lies(real: &Plane<f32>, sim: &Plane<f32>, go_on: GoOn<'_>) -> Result<Lies> {
    let (field, seen, left) = displacements(&Grey::of(real), &Grey::of(sim), go_on)?;
    let (w, h) = (real.width, real.height);
    let shift = Plane::from_fn(w, h, |x, y| field.read(x as f64, y as f64, (w, h)).map(|v| v as f32));
    let good = |i: usize| {
        let rest = left.at[i][0].hypot(left.at[i][1]);
        seen[i].alike > ALIKE && rest < EXACT_PX
    };
    let open: Vec<bool> = (0..seen.len()).map(good).collect();
    let alike = Plane::from_fn(w, h, |x, y| {
        let cell = (y * field.ny / h).min(field.ny - 1) * field.nx + (x * field.nx / w).min(field.nx - 1);
        [f32::from(u8::from(open[cell]))]
    });
    let (shift, alike) = (Arc::new(shift), Arc::new(alike));
    Ok(Lies { rms_px: field.rms(&seen), left_px: left.rms(&seen), shift, alike })
}

/// Median over windows of how far the content of two pictures lies apart (both DN, shape `[height, width, 3]`), px;
/// nothing where they have nothing in common.
///
/// # Errors
/// No time is left.
pub(super) fn apart_px(a: &Plane<f32>, b: &Plane<f32>, go_on: GoOn<'_>) -> Result<Option<f64>> {
    let (field, seen, _) = displacements(&Grey::of(a), &Grey::of(b), go_on)?;
    let alike =
        (0..seen.len()).filter(|&i| seen[i].alike > ALIKE).map(|i| field.at[i][0].hypot(field.at[i][1]));
    Ok(field.rms(&seen).map(|_| median(alike)))
}

/// Displacements, what windows see at their end, and what single windows would still move by.
fn displacements(real: &Grey, sim: &Grey, go_on: GoOn<'_>) -> Result<(Field, Vec<Window>, Field)> {
    let mut levels = vec![(real.soft(), sim.soft())];
    while levels.last().is_some_and(|(a, _)| a.w >= 2 * SMALLEST_PX) {
        let (a, b) = levels.last().expect("not empty");
        levels.push((a.half(), b.half()));
    }
    let (a, b) = levels.last().expect("not empty");
    go_on()?;
    let mut field = Field::zero(a.w, a.h);
    let whole = whole_shift(a, b);
    field.at.fill(whole);
    let mut finest = None;
    for (k, (a, b)) in levels.iter().enumerate().rev() {
        let blurred = finest.insert(Blurred::of(b));
        for _ in 0..ROUNDS {
            go_on()?;
            let seen = windows(a, &blurred.as_sharp_as(a, &field), &field);
            field.step(&seen);
        }
        if k > 0 {
            field.at.iter_mut().for_each(|d| *d = d.map(|v| 2.0 * v));
        }
    }
    let (a, finest) = (&levels[0].0, finest.expect("there is a level"));
    let seen = windows(a, &finest.as_sharp_as(a, &field), &field);
    let alone = |w: &Window| {
        let d = w.a[0] * w.a[2] - w.a[1] * w.a[1];
        if d > 1e-9 {
            [(w.a[2] * w.b[0] - w.a[1] * w.b[1]) / d, (w.a[0] * w.b[1] - w.a[1] * w.b[0]) / d]
        } else {
            [0.0; 2]
        }
    };
    let left = Field { at: seen.iter().map(alone).collect(), ..field };
    Ok((field, seen, left))
}

/// Where the content of each pixel of one picture is in another one, px from there (both DN, shape `[height, width,
/// 3]`): as [`lies`] has it, and from there on in windows of [`FINE_PX`].
///
/// # Errors
/// No time is left.
pub(super) fn motion(from: &Plane<f32>, to: &Plane<f32>, go_on: GoOn<'_>) -> Result<Plane<f32>> {
    let (a, b) = (Grey::of(from), Grey::of(to));
    let (coarse, ..) = displacements(&a, &b, go_on)?;
    let (w, h) = (a.w, a.h);
    let mut field = Field::across((w / FINE_PX).max(ACROSS), w, h);
    for i in 0..field.at.len() {
        let [x, y] = field.middle(i, (w, h));
        field.at[i] = coarse.read(x, y, (w, h));
    }
    let (a, b) = (a.soft(), b.soft());
    for _ in 0..ROUNDS {
        go_on()?;
        let seen = windows(&a, &b, &field);
        field.step(&seen);
    }
    Ok(Plane::from_fn(w, h, |x, y| field.read(x as f64, y as f64, (w, h)).map(|v| v as f32)))
}

/// Windows of two pictures that lie on each other but for little: middle (px), and the normal equations of how the
/// second lies beside the first.
pub(crate) fn slopes_to(a: &Plane<f32>, b: &Plane<f32>) -> Vec<([f64; 2], [f64; 3], [f64; 2])> {
    let (a, b) = (Grey::of(a).soft(), Grey::of(b).soft());
    let field = Field::zero(a.w, a.h);
    let seen = windows(&a, &Blurred::of(&b).as_sharp_as(&a, &field), &field);
    let middle = |i: usize| field.middle(i, (a.w, a.h)).map(|v| v + 0.5);
    seen.iter().enumerate().map(|(i, w)| (middle(i), w.a, w.b)).collect()
}

/// The shift of the whole picture that makes two small ones most alike, up to a fifth of their sides.
fn whole_shift(a: &Grey, b: &Grey) -> [f64; 2] {
    let (rx, ry) = ((a.w / 5) as isize, (a.h / 5) as isize);
    // What of a side lies in both pictures, in the first one and in the second.
    let both = |d: isize, side: usize| {
        let from = (-d).max(0);
        (from as usize, (from + d) as usize, side - d.unsigned_abs())
    };
    let alike = |dx: isize, dy: isize| {
        let ((xa, xb, columns), (ya, yb, rows)) = (both(dx, a.w), both(dy, a.h));
        let row = |g: &'_ Grey, x: usize, y: usize| g.data[y * g.w + x..][..columns].to_vec();
        let pairs = (0..rows).flat_map(|k| row(a, xa, ya + k).into_iter().zip(row(b, xb, yb + k)));
        correlation(&pairs.map(|(a, b)| [f64::from(a), f64::from(b)]).collect::<Vec<_>>())
    };
    let all: Vec<(isize, isize)> = (-ry..=ry).flat_map(|y| (-rx..=rx).map(move |x| (x, y))).collect();
    let best = all.into_par_iter().map(|(x, y)| (alike(x, y), x, y)).max_by(|a, b| a.0.total_cmp(&b.0));
    best.map_or([0.0; 2], |(_, x, y)| [x as f64, y as f64])
}

/// How alike the values of two pictures are at the same places: 1 where one is the other by a gain and an offset.
fn correlation(pairs: &[[f64; 2]]) -> f64 {
    let mean = [0, 1].map(|k| pairs.iter().map(|p| p[k]).sum::<f64>() / pairs.len() as f64);
    let mut sums = [0.0; 3];
    for p in pairs {
        let d = [p[0] - mean[0], p[1] - mean[1]];
        sums[0] += d[0] * d[0];
        sums[1] += d[0] * d[1];
        sums[2] += d[1] * d[1];
    }
    sums[1] / (sums[0] * sums[2]).sqrt().max(1e-9)
}

/// Root mean square over windows of how far two pictures that are compared lie beside each other, px; nothing where
/// they have nothing in common.
pub(crate) fn residual_px(real: &Plane<f32>, sim: &Plane<f32>) -> Option<f64> {
    let (a, b) = (Grey::of(real).soft(), Grey::of(sim).soft());
    let mut field = Field::zero(a.w, a.h);
    let blurred = Blurred::of(&b);
    let mut seen = Vec::new();
    for _ in 0..ROUNDS {
        seen = windows(&a, &blurred.as_sharp_as(&a, &field), &field);
        field.step(&seen);
    }
    field.rms(&seen)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Smooth noise without a period.
    pub(in crate::diagnose::expect::pair) fn texture(x: f64, y: f64) -> f32 {
        let lattice = |i: i64, j: i64| {
            let bits = shutterbug::chain::rng::random_bits([i as u32, j as u32], 0, 9, [1, 2])[0];
            f64::from(bits) / f64::from(u32::MAX)
        };
        let (u, v) = (x / 12.0, y / 12.0);
        let (i, j) = (u.floor(), v.floor());
        let soft = |f: f64| f * f * (3.0 - 2.0 * f);
        let (fx, fy) = (soft(u - i), soft(v - j));
        let at = |di: f64, dj: f64| lattice((i + di) as i64, (j + dj) as i64);
        let row = |dj: f64| at(0.0, dj) * (1.0 - fx) + at(1.0, dj) * fx;
        (60.0 + 130.0 * (row(0.0) * (1.0 - fy) + row(1.0) * fy)) as f32
    }

    fn picture(f: impl Fn(f64, f64) -> f32) -> Plane<f32> {
        Plane::from_fn(320, 240, |x, y| [f(x as f64, y as f64); 3])
    }

    #[test]
    fn a_turned_and_darkened_picture_is_found_and_one_of_something_else_is_not() {
        let turn = |x: f64, y: f64| (x + 4.0 + 0.01 * (y - 120.0), y - 3.0 - 0.01 * (x - 160.0));
        let sim = picture(texture);
        let real = picture(|x, y| {
            let (u, v) = turn(x, y);
            20.0 + 0.7 * texture(u, v)
        });
        let lies = |a: &Plane<f32>, b: &Plane<f32>| super::lies(a, b, &|| Ok(())).expect("in time");
        let found = lies(&real, &sim);
        let (mut off, mut count) = (0.0, 0.0);
        for (x, y) in (20..300).step_by(20).flat_map(|x| (20..220).step_by(20).map(move |y| (x, y))) {
            let (u, v) = turn(x as f64, y as f64);
            let s = found.shift.pixel(x, y);
            off += (u - x as f64 - f64::from(s[0])).powi(2) + (v - y as f64 - f64::from(s[1])).powi(2);
            count += 1.0;
        }
        assert!((off / count).sqrt() < 0.1, "{} px", (off / count).sqrt());
        assert!(
            found.left_px.is_some_and(|l| l < 0.1) && found.rms_px.is_some_and(|r| r > 4.0),
            "{:?}",
            found.rms_px
        );
        let other = picture(|x, y| texture(1.7 * y + 40.0, 1.3 * x));
        assert!(
            lies(&other, &sim).left_px.is_none_or(|l| l > 0.2),
            "control: {:?}",
            lies(&other, &sim).left_px
        );
        let same = lies(&sim, &sim);
        assert!(same.rms_px.is_some_and(|r| r < 0.02), "{:?}", same.rms_px);
    }

    /// Whoever says that there is no time is asked soon, and again and again.
    #[test]
    fn an_alignment_ends_when_its_time_does() {
        use shutterbug::error::Error;
        use std::sync::atomic::{AtomicUsize, Ordering};
        let (a, b) = (picture(texture), picture(|x, y| texture(x + 2.0, y)));
        for most in [0, 5, 15] {
            let asked = AtomicUsize::new(0);
            let go_on = || match asked.fetch_add(1, Ordering::SeqCst) {
                n if n < most => Ok(()),
                _ => Err(Error::OutOfTime { limit_s: 1.0 }),
            };
            let ended = |e: Error| matches!(e, Error::OutOfTime { .. });
            assert!(lies(&a, &b, &go_on).is_err_and(ended), "{most}");
            assert_eq!(asked.swap(0, Ordering::SeqCst), most + 1);
            assert!(motion(&a, &b, &go_on).is_err_and(ended), "{most}");
            assert_eq!(asked.load(Ordering::SeqCst), most + 1);
        }
    }

    const SIZE: [usize; 2] = [320, 240];

    /// Light of random rectangles one over another, the picture moved along its rows, px.
    fn cards(moved: f64) -> Vec<f64> {
        let card = |i: u32| {
            let bits = shutterbug::chain::rng::random_bits([i, 0], 0, 21, [4, 2]);
            bits.map(|b| f64::from(b) / f64::from(u32::MAX))
        };
        let cards: Vec<[f64; 4]> = (0..900).map(card).collect();
        // Share of a pixel that lies beyond an edge.
        let beyond = |at: f64, edge: f64| (at + 0.5 - edge).clamp(0.0, 1.0);
        let inside = |at: f64, from: f64, side: f64| beyond(at, from) - beyond(at, from + side);
        let light = |i: usize| {
            let (x, y) = ((i % SIZE[0]) as f64 + moved, (i / SIZE[0]) as f64);
            cards.iter().fold(0.3, |light, [a, b, c, d]| {
                let part =
                    inside(x, 340.0 * a - 20.0, 8.0 + 24.0 * d) * inside(y, 260.0 * b - 20.0, 8.0 + 20.0 * c);
                light + part * (0.02 + 0.9 * (a * 97.0 + b * 31.0).fract() - light)
            })
        };
        (0..SIZE[0] * SIZE[1]).map(light).collect()
    }

    /// Blurred along rows (1) or columns (the width) by a standard deviation, px.
    fn blurred(light: &[f64], along: usize, sigma: f64) -> Vec<f64> {
        let [at_of, side] = if along == 1 { [1, SIZE[0]] } else { [SIZE[0], SIZE[1]] };
        let taps: Vec<f64> = (-8..=8).map(|k| (-0.5 * (f64::from(k) / sigma).powi(2)).exp()).collect();
        let all: f64 = taps.iter().sum();
        let one = |i: usize| {
            let at = i / at_of % side;
            let near = |k: usize| light[i - at * along + (at + k).saturating_sub(8).min(side - 1) * along];
            taps.iter().enumerate().map(|(k, t)| t * near(k)).sum::<f64>() / all
        };
        (0..light.len()).map(one).collect()
    }

    fn shown(light: &[f64]) -> Plane<f32> {
        Plane::from_fn(SIZE[0], SIZE[1], |x, y| {
            [255.0 * shutterbug::plane::srgb_encode(light[y * SIZE[0] + x] as f32); 3]
        })
    }

    #[test]
    fn a_blur_moves_nothing_and_what_moved_is_found_behind_it() {
        let [sharp, beside] = [0.0, 0.6].map(cards);
        for (across, down) in [(2.0, 0.1), (2.0, 2.0), (0.1, 1.5)] {
            let found = |light: &[f64]| {
                let soft = blurred(&blurred(light, 1, across), SIZE[0], down);
                lies(&shown(&soft), &shown(&sharp), &|| Ok(())).expect("in time").rms_px.expect("alike")
            };
            let (rests, moved) = (found(&sharp), found(&beside));
            assert!(rests < 0.1, "{across}, {down}: {rests} px");
            assert!((moved - 0.6).abs() < 0.05, "{across}, {down}: {moved} px for 0.6");
        }
        let plain = lies(&shown(&sharp), &shown(&sharp), &|| Ok(())).expect("in time").rms_px;
        assert!(plain.is_some_and(|px| px < 0.02), "control: {plain:?}");
    }
}
