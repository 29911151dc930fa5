//! Small pictures: enough to tell a mirror image or another frame, too little to see what an effect of a camera does.

use shutterbug::plane::{Plane, srgb_decode, srgb_encode};

/// Columns at most. Rows follow from the shape.
const COLUMNS: usize = 40;

/// Means over square blocks, DN, shape `[height, width, 3]`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Thumb {
    pub(super) dn: Plane<f32>,
    /// Of the same picture with each value decoded or encoded once more.
    pub(super) decoded: Plane<f32>,
    pub(super) encoded: Plane<f32>,
}

impl Thumb {
    pub(super) fn of(picture: &Plane<f32>) -> Self {
        let side = picture.width.max(picture.height).div_ceil(COLUMNS).max(1);
        let coded = |f: fn(f32) -> f32| blocks(picture, side, |v| 255.0 * f((v / 255.0).clamp(0.0, 1.0)));
        Self { dn: blocks(picture, side, |v| v), decoded: coded(srgb_decode), encoded: coded(srgb_encode) }
    }

    /// One that has other values than the picture, for comparisons of `dn` alone.
    pub(super) fn with(&self, dn: Plane<f32>) -> Self {
        Self { dn, decoded: self.decoded.clone(), encoded: self.encoded.clone() }
    }

    /// One minus the correlation, over all blocks and colours, each colour about its own mean.
    pub(super) fn unlike(&self, other: &Self) -> f64 {
        let (a, b) = (&self.dn.data, &other.dn.data);
        if a.len() != b.len() {
            return 1.0;
        }
        let mean = |v: &[f32], c: usize| {
            v.iter().skip(c).step_by(3).map(|v| f64::from(*v)).sum::<f64>() / (v.len() / 3).max(1) as f64
        };
        let means = [0, 1, 2].map(|c| [mean(a, c), mean(b, c)]);
        let mut sums = [0.0f64; 3];
        for (i, (a, b)) in a.iter().zip(b).enumerate() {
            let [da, db] = [f64::from(*a) - means[i % 3][0], f64::from(*b) - means[i % 3][1]];
            sums = [sums[0] + da * db, sums[1] + da * da, sums[2] + db * db];
        }
        // Less than half a DN of contrast says nothing about what is to be seen.
        let least = 0.25 * a.len() as f64;
        if sums[1] < least || sums[2] < least {
            return 1.0;
        }
        1.0 - sums[0] / (sums[1] * sums[2]).sqrt()
    }
}

/// Mean absolute difference, DN.
pub(super) fn apart(a: &Plane<f32>, b: &Plane<f32>) -> f64 {
    let sum: f64 = a.data.iter().zip(&b.data).map(|(a, b)| f64::from((a - b).abs())).sum();
    sum / a.data.len().max(1) as f64
}

fn blocks(picture: &Plane<f32>, side: usize, value: impl Fn(f32) -> f32) -> Plane<f32> {
    let (width, height) = ((picture.width / side).max(1), (picture.height / side).max(1));
    Plane::from_fn(width, height, |x, y| {
        let mut sums = [0.0f32; 3];
        for at in 0..side * side {
            let (px, py) = (
                (x * side + at % side).min(picture.width - 1),
                (y * side + at / side).min(picture.height - 1),
            );
            let pixel = picture.pixel(px, py);
            (0..3).for_each(|c| sums[c] += value(pixel[c]));
        }
        sums.map(|s| s / (side * side) as f32)
    })
}
