//! Whether a picture is, in part, another one again: then their difference says nothing of the noise there.

use std::collections::HashMap;

use shutterbug::plane::Plane;

/// How often rows may be taken for copies where they are none.
const ALPHA: f64 = 0.01;

/// A row of two pictures.
#[derive(Clone, Copy)]
struct Row {
    /// Share of the values that differ by what most differ by.
    alike: f64,
    /// Whether it may be a copy: all differ by the same, and not because they are cut off.
    same: bool,
}

/// Number of rows of two encoded pictures of one size that differ by one amount everywhere, where chance does not make
/// such rows: as often as values of the rows beside them agree, a whole row would not. `step`: of the values.
pub(super) fn rows(a: &Plane<f32>, b: &Plane<f32>, step: f32) -> usize {
    let all: Vec<Row> = (0..a.height).map(|y| row(a.row(y), b.row(y), step)).collect();
    let width = (a.width * a.channels) as i32;
    let by_chance = |r: &Row| all.len() as f64 * r.alike.powi(width);
    let (mut count, mut from) = (0, 0);
    while from < all.len() {
        let length = all[from..].iter().take_while(|r| r.same).count();
        let beside = [from.checked_sub(1), Some(from + length)];
        let beside = beside.into_iter().flatten().filter_map(|y| all.get(y)).map(by_chance);
        // Where no other row is there, all of it is a copy.
        let is_all = length == all.len();
        if length > 0 && (is_all || beside.fold(f64::INFINITY, f64::min) < ALPHA) {
            count += length;
        }
        from += length + 1;
    }
    count
}

fn row(a: &[f32], b: &[f32], step: f32) -> Row {
    let mut by: HashMap<i64, usize> = HashMap::new();
    let mut cut_off = 0;
    for (a, b) in a.iter().zip(b) {
        *by.entry((f64::from(a - b) / f64::from(step)).round() as i64).or_default() += 1;
        cut_off += usize::from(a.min(*b) <= 0.0 || a.max(*b) >= 1.0);
    }
    let most = by.values().max().copied().unwrap_or(0);
    Row { alike: most as f64 / a.len().max(1) as f64, same: most == a.len() && 2 * cut_off < a.len() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of so many grey levels of noise.
    fn noisy(seed: u32, levels: u32, at: f32) -> Plane<f32> {
        Plane::from_fn(64, 48, |x, y| {
            let mut v = seed ^ (x as u32).wrapping_mul(0x9E37_79B9) ^ (y as u32).wrapping_mul(0x85EB_CA6B);
            for _ in 0..3 {
                v = (v ^ (v >> 15)).wrapping_mul(0x2C1B_3C6D);
            }
            [(((v >> 8) % levels) as f32 / 255.0 + at).clamp(0.0, 1.0); 3]
        })
    }

    fn with_rows_of(a: &Plane<f32>, b: &Plane<f32>, from: usize, brighter: f32) -> Plane<f32> {
        let mut out = b.clone();
        let at = from * a.width * a.channels;
        out.data[at..].iter_mut().zip(&a.data[at..]).for_each(|(o, v)| *o = v + brighter);
        out
    }

    #[test]
    fn repeated_rows_are_counted_and_rows_that_are_alike_are_not() {
        let step = 1.0 / 255.0;
        let (a, b) = (noisy(1, 8, 0.4), noisy(2, 8, 0.4));
        assert_eq!(rows(&a, &b, step), 0, "control");
        assert_eq!(rows(&a, &with_rows_of(&a, &b, 40, 0.0), step), 8);
        assert_eq!(rows(&a, &with_rows_of(&a, &b, 5, 0.0), step), 43);
        assert_eq!(rows(&a, &with_rows_of(&a, &b, 0, step), step), 48, "another brightness alone");
        // Without noise all rows are alike, in the dark they are cut off.
        let still = noisy(1, 1, 0.4);
        let mut nearly = still.clone();
        (0..48).for_each(|y| nearly.data[(64 * y + 7) * 3] += if y % 3 == 0 { step } else { 0.0 });
        assert_eq!(rows(&still, &nearly, step), 0);
        assert_eq!(rows(&noisy(1, 8, -1.0), &noisy(2, 8, -1.0), step), 0);
    }
}
