//! Pixels stuck at white, the same in every frame and run (docs/reference/camera.md): exactly `count`, or `fraction` of
//! the picture's, at places that depend on `sensor_seed` and the picture's size. All channels of the pixel are stuck;
//! under a colour filter mosaic that is the one that it has. Electrons.

use crate::chain::rng::{FIXED_FRAME, random_bits, seed_words};
use crate::chain::{
    At, Domain, Effect, Fit, Law, Moments, Number, Packer, ParamSpec, Parameters, Settings, Stage, View, Work,
};
use crate::error::Result;

/// The effect; its values live in [`Settings`].
pub struct HotPixels;

/// Stream of their places.
pub const STREAM_HOT_PIXELS: u32 = 0x484f;

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::integer("count", "px", (0.0, 1e6), "number of hot pixels (at most half of the picture's)"),
    ParamSpec::number("fraction", "", (0.0, 0.5), 0.0, "hot pixels over all, in place of `count`")
        .fit(Fit::by(1e-4).within(0.0, 0.05).trial(Law::Up, 0.0004, 0.005).graded(5e-5, 5e-3)),
    ParamSpec::integer("sensor_seed", "", (0.0, 4_294_967_295.0), "which sensor of its kind")
        .beside(&["count", "fraction"]),
];

const COUNT: Number = Number::of("hot_pixels", SPECS, "count");
const FRACTION: Number = Number::of("hot_pixels", SPECS, "fraction");
const SENSOR_SEED: Number = Number::of("hot_pixels", SPECS, "sensor_seed");

impl HotPixels {
    /// One bit a pixel, row by row, lowest bit first: set where it is hot.
    pub fn mask(settings: &Settings, size: [u32; 2]) -> Vec<u32> {
        let get = |of| settings.value(of);
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let count = get(COUNT).max((get(FRACTION) * pixels as f64).round()) as u64;
        let count = count.min(pixels.div_ceil(2));
        let seed = seed_words(get(SENSOR_SEED) as u64);
        let mut mask = vec![0_u32; pixels.div_ceil(32) as usize];
        let (mut set, mut draw) = (0, 0);
        while set < count {
            for bits in random_bits([draw, 0], FIXED_FRAME, STREAM_HOT_PIXELS, seed) {
                // The high word of the product is uniform over the pixels.
                let place = (u64::from(bits) * pixels) >> 32;
                let (word, bit) = (&mut mask[place as usize / 32], 1 << (place % 32));
                if set < count && *word & bit == 0 {
                    *word |= bit;
                    set += 1;
                }
            }
            draw += 1;
        }
        mask
    }
}

/// The function of the same name in `glsl/include/effects/hot_pixels.glsl`.
fn hot_pixels(value: [f32; 3], at: &At, p: &Parameters) -> [f32; 3] {
    let place = (at.pixel[1] * at.view.intrinsics.width + at.pixel[0]) as usize;
    let hot = p.word(0, place / 32) & (1 << (place % 32)) != 0;
    if hot { value.map(|v| v.max(1.0)) } else { value }
}

impl Effect for HotPixels {
    fn id(&self) -> &'static str {
        "hot_pixels"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::Electrons, Domain::Electrons)
    }

    fn check(&self, settings: &Settings, _: f64) -> Result<Vec<String>> {
        let get = |of| settings.value(of);
        if get(COUNT) > 0.0 && get(FRACTION) > 0.0 {
            return Ok(vec![
                "hot_pixels has both `count` and `fraction`: the larger number counts".to_owned(),
            ]);
        }
        Ok(Vec::new())
    }

    fn variant(&self, settings: &Settings) -> u32 {
        let get = |of| settings.value(of);
        u32::from(get(COUNT) > 0.0 || get(FRACTION) > 0.0)
    }

    fn moments(&self) -> Moments {
        Moments::Stuck
    }

    fn work(&self) -> Work {
        Work::Pointwise(hot_pixels)
    }

    fn pack(&self, settings: &Settings, view: &View, packer: &mut Packer<'_>) {
        packer.words(Self::mask(settings, [view.intrinsics.width, view.intrinsics.height]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::Value;

    #[test]
    fn there_are_exactly_as_many_as_asked_for() {
        let count = |name, value: f64, size: [u32; 2]| {
            let mut settings = Settings::default();
            settings.set(&HotPixels, name, Value::Number(value)).expect("in range");
            HotPixels::mask(&settings, size).iter().map(|w| w.count_ones()).sum::<u32>()
        };
        assert_eq!(count("count", 100.0, [320, 240]), 100);
        assert_eq!(count("count", 1.0, [1, 1]), 1);
        assert_eq!(count("count", 1e6, [7, 5]), 18, "half, rounded up");
        assert_eq!(count("fraction", 0.25, [64, 64]), 1024);
        assert_eq!(count("fraction", 0.5, [33, 31]), 512);
    }

    #[test]
    fn the_sensor_decides_where() {
        let mask = |seed: f64| {
            let mut settings = Settings::default();
            settings.set(&HotPixels, "count", Value::Number(50.0)).expect("in range");
            settings.set(&HotPixels, "sensor_seed", Value::Number(seed)).expect("in range");
            HotPixels::mask(&settings, [100, 80])
        };
        assert_eq!(mask(1.0), mask(1.0));
        assert_ne!(mask(1.0), mask(2.0));
    }
}
