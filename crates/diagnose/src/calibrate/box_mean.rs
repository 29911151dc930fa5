//! Means over squares.

use shutterbug::plane::Plane;

/// Means over squares of `2 radius + 1` px, cut off at the border.
pub(super) fn box_mean(plane: &Plane<f32>, radius: usize) -> Plane<f32> {
    let (w, h) = (plane.width, plane.height);
    let mut across: Plane<f32> = Plane::new(w, h, 1);
    for y in 0..h {
        let row = plane.row(y);
        let mut sum: f64 = row[..radius.min(w)].iter().map(|v| f64::from(*v)).sum();
        for x in 0..w {
            if x + radius < w {
                sum += f64::from(row[x + radius]);
            }
            if x > radius {
                sum -= f64::from(row[x - radius - 1]);
            }
            let count = (x + radius + 1).min(w) - x.saturating_sub(radius);
            across.data[y * w + x] = (sum / count as f64) as f32;
        }
    }
    let mut out: Plane<f32> = Plane::new(w, h, 1);
    let mut sums: Vec<f64> = vec![0.0; w];
    for y in 0..radius.min(h) {
        sums.iter_mut().zip(across.row(y)).for_each(|(s, v)| *s += f64::from(*v));
    }
    for y in 0..h {
        if y + radius < h {
            sums.iter_mut().zip(across.row(y + radius)).for_each(|(s, v)| *s += f64::from(*v));
        }
        if y > radius {
            sums.iter_mut().zip(across.row(y - radius - 1)).for_each(|(s, v)| *s -= f64::from(*v));
        }
        let count = ((y + radius + 1).min(h) - y.saturating_sub(radius)) as f64;
        out.data[y * w..(y + 1) * w].iter_mut().zip(&sums).for_each(|(o, s)| *o = (s / count) as f32);
    }
    out
}
