//! Whether the light of one colour falls off more than that of another: light that meets the sensor at a slant is lost
//! in part between its filters, more of one colour than of another. Cameras take it back ("colour shading correction"),
//! and what they leave is seen here. A lens alone darkens all colours alike.

use shutterbug::plane::Plane;

use super::fall_off::Blocks;
use super::frames::Encoding;

/// Fall-off by colour.
#[derive(Clone, Debug)]
pub(super) struct Shading([Blocks; 3]);

impl Shading {
    pub(super) fn new(width: usize, height: usize) -> Self {
        Self(std::array::from_fn(|_| Blocks::new(width, height)))
    }

    /// Adds a picture of three colours: encoded values, and the mean linear value of no light.
    pub(super) fn add(&mut self, encoded: &Plane<f32>, encoding: Encoding, black: f64) {
        if encoded.channels != 3 {
            return;
        }
        for (c, blocks) in self.0.iter_mut().enumerate() {
            let light = |p: &[f32]| encoding.decode(p[c]) - black as f32;
            let data = encoded.data.chunks_exact(3).map(light).collect();
            blocks.add(&Plane { data, channels: 1, ..*encoded });
        }
    }

    /// What the corners get of the middle in red, green and blue, where they differ by more than what is known of each.
    /// `whole`: the same pictures' blocks, which know what is white.
    pub(super) fn unlike(mut self, whole: &Blocks, rounding: f64) -> Option<[f64; 3]> {
        let corners = self.0.each_mut().map(|blocks| {
            blocks.leave_out_as(whole);
            let level = blocks.level();
            let [_, _, corner, ..] = blocks.shape(level, rounding);
            (level > 0.0).then_some(corner)
        });
        let [Some(r), Some(g), Some(b)] = corners else { return None };
        let all = [r, g, b];
        let end = |side: f64| all.map(|[value, deviation]| value + side * 1.96 * deviation);
        let lowest_end = end(1.0).into_iter().fold(f64::INFINITY, f64::min);
        let highest_start = end(-1.0).into_iter().fold(f64::NEG_INFINITY, f64::max);
        (highest_start > lowest_end).then(|| all.map(|[value, _]| value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::chain::rng::random_normal;

    #[test]
    fn colours_that_fall_off_by_themselves_are_told_and_a_tinted_light_is_not() {
        let (w, h) = (320, 256);
        let seen = |falls: [f32; 3], tint: [f32; 3]| {
            let mut shading = Shading::new(w, h);
            for frame in 0..4 {
                let picture = Plane::from_fn(w, h, |x, y| {
                    let (dx, dy) = ((x as f32 - 159.5) / 205.0, (y as f32 - 127.5) / 205.0);
                    let q = dx * dx + dy * dy;
                    let noise = random_normal([x as u32, y as u32], frame, 3, [7, 1]);
                    [0, 1, 2].map(|c| tint[c] * (1.0 - falls[c] * q) + 0.01 * noise[c])
                });
                shading.add(&picture, Encoding::Linear, 0.0);
            }
            shading.unlike(&Blocks::new(w, h), 0.0)
        };
        let [r, g, b] = seen([0.44, 0.40, 0.38], [0.4, 0.5, 0.3]).expect("they differ");
        assert!((r - 0.56).abs() < 5e-3 && (g - 0.60).abs() < 5e-3 && (b - 0.62).abs() < 5e-3, "{r} {g} {b}");
        assert_eq!(seen([0.4; 3], [0.4, 0.5, 0.3]), None, "control");
    }
}
