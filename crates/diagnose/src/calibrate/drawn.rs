//! What is drawn on pictures of a flat field, or lies on the sensor: a date, a logo, dust. It is the same in every
//! picture, as a sensor's pattern is, but no pattern of single pixels.

use shutterbug::plane::Plane;

/// Standard deviations beyond which no pixel of a pattern lies by chance: one of 24 million does in 20 pictures.
const FAR: f32 = 6.0;
/// Longest side of what a demosaicking makes of one pixel of another gain, px.
const FILLED_IN_PX: usize = 5;
/// Beside what is drawn: filters and compression reach as far, px.
const BESIDE_PX: usize = 2;
/// Share of pixels that a normal variable's 1.96 standard deviations hold. What is drawn covers less than the rest, or
/// it is what the pictures show.
const MOST: f64 = 0.95;

/// Something drawn: its pixels, in order.
pub(super) type Drawn = Vec<usize>;

/// What is drawn on a pattern: pixels far off that touch each other over more than a demosaicking reaches, and what is
/// beside them. `lit`: the pixels that count.
pub(super) fn drawn(pattern: &Plane<f32>, lit: &[bool]) -> Vec<Drawn> {
    let (w, h) = (pattern.width, pattern.height);
    let mut sizes: Vec<f32> =
        pattern.data.iter().zip(lit).filter(|(_, lit)| **lit).map(|(v, _)| v.abs()).collect();
    if sizes.is_empty() {
        return Vec::new();
    }
    let at = ((sizes.len() - 1) as f64 * MOST) as usize;
    let far = FAR / 1.96 * *sizes.select_nth_unstable_by(at, f32::total_cmp).1;
    let mut open: Vec<bool> = pattern.data.iter().zip(lit).map(|(v, lit)| *lit && v.abs() > far).collect();
    let mut taken = vec![false; w * h];
    let mut found = Vec::new();
    for first in 0..w * h {
        if !std::mem::take(&mut open[first]) {
            continue;
        }
        let mut part = vec![first];
        let mut next = 0;
        while let Some(&i) = part.get(next) {
            next += 1;
            part.extend(around(i, 1, [w, h]).filter(|j| std::mem::take(&mut open[*j])));
        }
        let [left, top, right, bottom] = frame_of(&part, w);
        // Dark corners and frames reach the border, and are no drawing.
        let inside = left > 0 && top > 0 && right + 1 < w && bottom + 1 < h;
        if inside && (right - left).max(bottom - top) >= FILLED_IN_PX {
            let beside = part.iter().flat_map(|&i| around(i, BESIDE_PX, [w, h]));
            let mut whole: Drawn =
                beside.filter(|&i| lit[i] && !std::mem::replace(&mut taken[i], true)).collect();
            whole.sort_unstable();
            found.push(whole);
        }
    }
    found.retain(|drawn| !drawn.is_empty());
    found
}

/// Puts in the place of what is drawn what lies to both sides of it in the row.
pub(super) fn fill(light: &mut Plane<f32>, drawn: &[usize]) {
    let (w, mut rest) = (light.width, drawn);
    while let Some(&first) = rest.first() {
        let count =
            (0..rest.len()).take_while(|k| rest[*k] == first + k && (first + k) / w == first / w).count();
        let last = first + count - 1;
        let left = (first % w > 0).then(|| light.data[first - 1]);
        let right = (last % w + 1 < w).then(|| light.data[last + 1]);
        if let (Some(a), Some(b)) = (left.or(right), right.or(left)) {
            let part = |k: usize| (k as f32 + 1.0) / (count as f32 + 1.0);
            (0..count).for_each(|k| light.data[first + k] = a + (b - a) * part(k));
        }
        rest = &rest[count..];
    }
}

/// The pixels of the square about one, up to the border.
fn around(i: usize, radius: usize, [w, h]: [usize; 2]) -> impl Iterator<Item = usize> {
    let span = move |at: usize, side: usize| at.saturating_sub(radius)..(at + radius + 1).min(side);
    let (x, y) = (i % w, i / w);
    span(y, h).flat_map(move |y| span(x, w).map(move |x| y * w + x))
}

/// Columns and rows that hold some pixels, px: left, top, right, bottom, both ends in it.
pub(super) fn frame_of(pixels: &[usize], width: usize) -> [usize; 4] {
    let places = pixels.iter().map(|i| [i % width, i / width]);
    places.fold([usize::MAX, usize::MAX, 0, 0], |[left, top, right, bottom], [x, y]| {
        [left.min(x), top.min(y), right.max(x), bottom.max(y)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::dice::Dice;

    #[test]
    fn a_date_is_drawn_and_single_pixels_and_what_fills_in_about_them_are_not() {
        let (w, h) = (320, 240);
        let mut dice = Dice(4);
        let plain = Plane::from_fn(w, h, |_, _| [0.01 * dice.normal() as f32]);
        let lit = vec![true; w * h];
        let with = |value: &dyn Fn(usize, usize) -> Option<f32>| {
            let data = plain.data.iter().enumerate().map(|(i, v)| value(i % w, i / w).unwrap_or(*v));
            drawn(&Plane { data: data.collect(), ..plain.clone() }, &lit)
        };
        assert!(with(&|_, _| None).is_empty());
        let one = with(&|x, y| (x.abs_diff(100) <= 2 && y.abs_diff(50) <= 2).then_some(-0.2));
        assert!(one.is_empty(), "5x5 px about a bad one");
        // Letters: lines two pixels wide.
        let letter = |x: usize, y: usize| (x % 12 < 2 || y % 10 < 2).then_some(0.4);
        let in_it = |x: usize, y: usize| (200..300).contains(&x) && (210..230).contains(&y);
        let date = with(&|x, y| letter(x, y).filter(|_| in_it(x, y)));
        assert_eq!(date.len(), 1, "letters touch");
        let [left, top, right, bottom] = frame_of(&date[0], w);
        let mut filled = Plane::from_fn(w, h, |x, y| [if in_it(x, y) { 9.0 } else { x as f32 }]);
        fill(&mut filled, &(0..w * h).filter(|i| in_it(i % w, i / w)).collect::<Vec<_>>());
        assert!(filled.data.iter().enumerate().all(|(i, v)| (v - (i % w) as f32).abs() < 1e-3));
        assert!(left <= 204 && top == 208 && right == 301 && bottom <= 231, "{left} {top} {right} {bottom}");
    }
}
