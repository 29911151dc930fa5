//! A sensor's own pattern, a lens's fall-off and the noise of a picture, from photographs of an evenly lit surface, and
//! with the cap on (EMVA 1288, release 4.0, sections 4 and 8; the zero-mean pattern of Chen et al., IEEE TIFS 3, 2008).
//!
//! What is the same in all pictures is the pattern: its variance is the covariance of two pictures, which noise has no
//! part in. Slopes over the picture are the light and the lens: what is even about the middle is called vignetting, a
//! tilt is the light's.

use serde::Serialize;

use super::box_mean::box_mean;
use super::corners::Corners;
use super::drawn::{Drawn, drawn, fill, frame_of};
use super::ends::{alone, is_end, level_of};
use super::fall_off::{Blocks, without_fall_off};
use super::frames::{Encoding, of_pattern};
use super::lines::{Bands, Lines};
use super::odd::{Odd, Patterns};
use super::own::{REPEAT_PX, content};
use super::rounding::Rounding;
use super::shading::Shading;
use shutterbug::error::{Error, Result};
use shutterbug::plane::Plane;

/// Half a side of the square over which the surface's own brightness is taken, px.
pub(super) const AROUND_PX: usize = 16;
/// Mean linear values of pictures of a lit surface.
const LEVELS: std::ops::RangeInclusive<f64> = 0.01..=0.98;
/// Shifts by which a pattern is compared with another that it has nothing to do with.
const SHIFTS: usize = 64;

/// A number with its 95 % interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Measured {
    /// The number.
    pub value: f64,
    /// Its interval.
    pub ci95: [f64; 2],
}

impl Measured {
    fn of(value: f64, deviation: f64) -> Self {
        Self { value, ci95: [value - 1.96 * deviation, value + 1.96 * deviation] }
    }

    /// Whether the interval leaves out 0.
    pub fn is_some(&self) -> bool {
        self.ci95[0] > 0.0 || self.ci95[1] < 0.0
    }
}

/// How alike two patterns are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Likeness {
    /// Correlation over all pixels.
    pub correlation: f64,
    /// The same in standard deviations of what chance gives (the patterns shifted against each other).
    pub deviations: f64,
}

/// What pictures of a flat field tell.
#[derive(Clone, Debug, Serialize)]
pub struct Flat {
    /// Pictures.
    pub frames: usize,
    /// Columns and rows, px.
    pub size_px: [usize; 2],
    /// Mean linear value beyond that of no light, 1 = white.
    pub level: f64,
    /// Fall-off: L (1 + a1 q + a2 q^2), q = squared distance from the middle over the squared half diagonal.
    pub a1: Measured,
    /// See `a1`.
    pub a2: Measured,
    /// What the corners get of the light of the middle.
    pub corner: f64,
    /// The same in red, green and blue, where it differs.
    pub corner_by_colour: Option<[f64; 3]>,
    /// Tilt of the light over half a diagonal, and what is left beyond fall-off and tilt: rms, of the level.
    pub tilt: f64,
    /// See `tilt`.
    pub uneven: f64,
    /// Standard deviation of the pixels' gains.
    pub prnu: Measured,
    /// Noise of one picture, of the level.
    pub temporal: f64,
    /// Correlation of the noise of pictures that follow each other, where they have some in common: then the pattern
    /// holds noise as well, and is less than it says, and the noise of one picture more.
    pub shared_noise: Option<f64>,
    /// The most that rounding does to means, of the level; it is in the intervals.
    pub rounding: f64,
    /// Rows or columns that differ from picture to picture by more than their pixels' noise.
    pub bands: Option<Bands>,
    /// Rows or columns that are brighter or darker in all pictures, by more than their pixels' own pattern makes them.
    /// They have no part in `prnu`.
    pub shared_lines: Option<Bands>,
    /// The pattern of half of the pictures beside that of the others.
    pub itself: Likeness,
    /// Pixels that are white in every picture, unlike their neighbours. They have no part in the pattern's figures.
    pub stuck: usize,
    /// Pixels that are black in every picture, and have no part in them either.
    pub dead: usize,
    /// Share of the picture that is white, or lies beside white, in one of the pictures: left out of all figures.
    pub white: f64,
    /// Where something is drawn on the pictures, or lies on the sensor: left, top, right, bottom, px, the largest
    /// first. It has no part in the pattern's figures.
    pub drawn_px: Vec<[usize; 4]>,
    /// Pictures that have another pattern than the rest.
    #[serde(skip)]
    pub odd: Option<Odd>,
    /// The pattern: gain of each pixel, less 1.
    #[serde(skip)]
    pub pattern: Plane<f32>,
}

/// Pictures that come one after another.
#[derive(Clone, Debug)]
pub struct FlatSums {
    encoding: Encoding,
    /// Mean linear value of no light.
    black: f64,
    size: [usize; 2],
    rounding: Rounding,
    levels: Vec<f64>,
    /// Sum of the patterns of even and of odd pictures.
    halves: [Plane<f32>; 2],
    /// Sum over the pictures of the squares of their patterns.
    squares: Plane<f32>,
    blocks: Blocks,
    lines: Lines,
    corners: Corners,
    shading: Shading,
    patterns: Patterns,
    /// What is drawn on the first picture, plain to see.
    drawn: Vec<Drawn>,
    /// In how many pictures each pixel is white, and in how many black, unlike its neighbours; both where it is drawn.
    ends: Vec<[u16; 2]>,
}

impl FlatSums {
    /// For pictures of one size; `black`: the mean linear value of pictures with the cap on.
    pub fn new(width: usize, height: usize, encoding: Encoding, black: f64) -> Self {
        Self {
            encoding,
            black,
            size: [width, height],
            rounding: Rounding::default(),
            levels: Vec::new(),
            halves: [Plane::new(width, height, 1), Plane::new(width, height, 1)],
            squares: Plane::new(width, height, 1),
            blocks: Blocks::new(width, height),
            lines: Lines::default(),
            corners: Corners::new(width, height),
            shading: Shading::new(width, height),
            patterns: Patterns::default(),
            drawn: Vec::new(),
            ends: vec![[0; 2]; width * height],
        }
    }

    /// Adds a picture: encoded values, shape `[height, width, channels]`, and the distance of two neighbouring ones.
    pub fn add(&mut self, encoded: &Plane<f32>, step: f32) {
        self.rounding.add(encoded, step);
        let [w, h] = self.size;
        let black = self.black as f32;
        let light = |p: &[f32]| self.encoding.decode(of_pattern(p)) - black;
        let data = encoded.data.chunks_exact(encoded.channels).map(light).collect();
        let mut light = Plane { width: w, height: h, channels: 1, data };
        let end = |p: &[f32]| [p.iter().all(|v| *v >= 1.0 - 0.5 * step), p.iter().all(|v| *v <= 0.5 * step)];
        let ends: Vec<[bool; 2]> = encoded.data.chunks_exact(encoded.channels).map(end).collect();
        let mut ends = alone(&ends, w);
        if self.levels.is_empty() {
            self.drawn =
                drawn(&beside_mean(&light), &ends.iter().map(|end| !is_end(end)).collect::<Vec<_>>());
        }
        self.drawn.iter().for_each(|drawn| fill(&mut light, drawn));
        self.blocks.leave_out_white(encoded, 1.0 - 0.5 * step);
        let level = level_of(&mut light.data, &ends);
        self.drawn.iter().flatten().for_each(|i| ends[*i] = [true; 2]);
        for (count, end) in self.ends.iter_mut().zip(&ends) {
            (0..2).for_each(|k| count[k] += u16::from(end[k]));
        }
        self.blocks.add(&light);
        self.lines.add(&light, level);
        self.corners.add(&light);
        self.shading.add(encoded, self.encoding, self.black);
        let even = without_fall_off(&light, &self.blocks);
        let mut own = beside_mean(&even);
        own.data.iter_mut().zip(&ends).filter(|(_, end)| is_end(end)).for_each(|(v, _)| *v = 0.0);
        self.blocks.clear_white(&mut own);
        // Of each picture: bands of a lamp that flickers are others in the next one.
        clean(&mut own);
        self.squares.data.iter_mut().zip(&own.data).for_each(|(to, v)| *to += v * v);
        self.patterns.add(&own, level);
        let half = &mut self.halves[self.levels.len() % 2];
        half.data.iter_mut().zip(&own.data).for_each(|(to, v)| *to += v);
        self.levels.push(level);
    }

    /// Whether a pixel sees light.
    fn is_lit(&self, i: usize) -> bool {
        let frames = self.levels.len();
        self.ends[i].iter().all(|c| usize::from(*c) < frames) && !self.blocks.is_white(i)
    }

    /// Mean over the pixels that see light.
    fn over_lit(&self, value: &dyn Fn(usize) -> f32) -> f64 {
        let some = (0..self.ends.len()).filter(|i| self.is_lit(*i));
        let (sum, n) = some.fold((0.0, 0usize), |(sum, n), i| (sum + f64::from(value(i)), n + 1));
        sum / n.max(1) as f64
    }

    /// Takes what is drawn on the pictures for pixels without light. Returns what that is, the largest first. `sum`: of
    /// all patterns.
    fn leave_out_drawn(&mut self, sum: &Plane<f32>) -> Vec<Drawn> {
        let lit: Vec<bool> = (0..self.ends.len()).map(|i| self.is_lit(i)).collect();
        let mut drawn = drawn(sum, &lit);
        drawn.append(&mut self.drawn);
        drawn.sort_by_key(|drawn| std::cmp::Reverse(drawn.len()));
        drawn.iter().flatten().for_each(|i| self.ends[*i] = [self.levels.len() as u16; 2]);
        drawn
    }

    /// Mean linear value of all pictures beyond that of no light.
    pub fn level(&self) -> f64 {
        self.levels.iter().sum::<f64>() / self.levels.len().max(1) as f64
    }

    /// The first picture that shows no light or nothing but white, and its mean linear value.
    pub fn unlit(&self) -> Option<(usize, f64)> {
        let dark = |(_, level): &(usize, f64)| !LEVELS.contains(level);
        self.levels.iter().copied().enumerate().find(dark)
    }

    /// Whether they can tell anything; `level`: their mean.
    fn check(&self, level: f64, path: &std::path::Path) -> Result<()> {
        let frames = self.levels.len();
        let refuse = |found: String, expected: &str| Err(Error::input(path, None, found, expected));
        if frames < 2 {
            return refuse(
                format!("{frames} picture"),
                "two or more of one flat field: noise and pattern look alike in one",
            );
        }
        if !LEVELS.contains(&level) {
            return refuse(
                format!("a mean of {level:.3} of white"),
                "a surface that is neither black nor white: 0.01 to 0.98",
            );
        }
        if self.squares.data.iter().all(|s| *s == 0.0) {
            return refuse("pictures without any noise".to_owned(), "pictures as a sensor takes them");
        }
        let (blocks, white) = (self.blocks.count(), self.blocks.white_share());
        if blocks < 16 {
            return refuse(format!("{}x{} px", self.size[0], self.size[1]), "at least 128x128 px");
        }
        if (1.0 - white) * (blocks as f64) < 16.0 {
            return refuse(
                format!("white in {:.0} % of the picture", 100.0 * white),
                "a shorter exposure: what is cut off at white has neither a fall-off nor a pattern",
            );
        }
        Ok(())
    }

    /// What they tell.
    ///
    /// # Errors
    /// Fewer than two pictures; pictures too small for a fall-off; a surface that is black or white.
    pub fn measure(mut self, path: &std::path::Path) -> Result<Flat> {
        let frames = self.levels.len();
        let n = frames as f64;
        let level = self.level();
        self.check(level, path)?;
        let rounding = self.rounding.most() / (self.encoding.slope(level + self.black) * level);
        let shape = self.blocks.shape(n * level, rounding);
        let white = self.blocks.white_share();
        let both: Vec<f32> =
            self.halves[0].data.iter().zip(&self.halves[1].data).map(|(a, b)| a + b).collect();
        let mut sum = Plane { data: both, ..self.halves[0].clone() };
        let [stuck, dead] = [0, 1]
            .map(|end| self.ends.iter().filter(|c| usize::from(c[end]) == frames && c[1 - end] == 0).count());
        let drawn = self.leave_out_drawn(&sum);
        let pixels = (1.0 - white) * (sum.data.len() - stuck - dead - drawn.iter().flatten().count()) as f64;
        let shared_noise = self.patterns.shared_noise();
        let (prnu, temporal) = self.spread(&sum, pixels, rounding, shared_noise.is_some());
        let mut halves = self.halves;
        for plane in halves.iter_mut().chain([&mut sum]) {
            self.blocks.clear_white(plane);
            drawn.iter().flatten().for_each(|i| plane.data[*i] = 0.0);
        }
        let itself = likeness(&halves[0], &halves[1]);
        sum.data.iter_mut().for_each(|v| *v /= n as f32);
        let [a1, a2, corner, tilt, uneven] = shape;
        if let Some(what) = content(&halves) {
            let expected = "an evenly lit surface without edges, and a camera at rest";
            return Err(Error::input(path, None, what, expected));
        }
        if let Some(frame) = self.lines.dark_frame().or_else(|| self.corners.dark(temporal * level)) {
            return Err(Error::input(path, None, frame, "pictures cropped to what the lens lights"));
        }
        Ok(Flat {
            frames,
            size_px: self.size,
            level,
            a1: Measured::of(a1[0], a1[1]),
            a2: Measured::of(a2[0], a2[1]),
            corner: corner[0],
            corner_by_colour: self.shading.unlike(&self.blocks, rounding),
            tilt: tilt[0],
            uneven: uneven[0],
            prnu,
            temporal,
            shared_noise,
            rounding,
            bands: self.lines.bands(),
            shared_lines: self.lines.shared(),
            itself,
            stuck,
            dead,
            white,
            drawn_px: drawn.iter().map(|drawn| frame_of(drawn, self.size[0])).collect(),
            odd: self.patterns.odd(),
            pattern: sum,
        })
    }

    /// Spread of the pattern and of the noise of one picture. `sum`: of all patterns; `pixels` that see light;
    /// `rounding`: the most that each is off by, of the level; `shared`: whether noise is in several pictures, and so
    /// in the pattern.
    fn spread(&self, sum: &Plane<f32>, pixels: f64, rounding: f64, shared: bool) -> (Measured, f64) {
        let n = self.levels.len() as f64;
        // Cleaning took so many means of each picture.
        let kept = 1.0 - (self.size[0] + self.size[1] + REPEAT_PX * REPEAT_PX) as f64 / pixels;
        let of_sum = self.over_lit(&|i| sum.data[i] * sum.data[i]) / kept;
        let of_each = self.over_lit(&|i| self.squares.data[i]) / kept;
        // Covariance of two different pictures, and its spread over pixels that are independent but for demosaicking.
        let variance = (of_sum - of_each) / (n * (n - 1.0));
        let chance = (of_sum / n) * (2.0 / pixels).sqrt() * 2.0 / (n - 1.0);
        // What rounding does is the same in all pictures, and a wave over the values.
        let spread = chance + 0.5 * rounding * rounding;
        let prnu = variance.max(0.0).sqrt();
        let deviation = if prnu > 0.0 { spread / (2.0 * prnu) } else { spread.sqrt() };
        let mut prnu = Measured::of(prnu, deviation);
        if shared {
            prnu.ci95[0] = 0.0;
        }
        (prnu, (of_each / n - variance).max(0.0).sqrt())
    }
}

/// Light over its mean around each pixel, less 1.
fn beside_mean(light: &Plane<f32>) -> Plane<f32> {
    let mut own = box_mean(light, AROUND_PX);
    own.data.iter_mut().zip(&light.data).for_each(|(a, v)| *a = v / a.max(1e-6) - 1.0);
    own
}

/// Takes the means of rows, of columns and of places in a block of 8x8 px out of a pattern: other sensors share them.
fn clean(pattern: &mut Plane<f32>) {
    let (w, h) = (pattern.width, pattern.height);
    let mut remove = |groups: usize, group: &dyn Fn(usize) -> usize| {
        let (mut sums, mut counts) = (vec![0.0f64; groups], vec![0.0f64; groups]);
        for (i, v) in pattern.data.iter().enumerate() {
            sums[group(i)] += f64::from(*v);
            counts[group(i)] += 1.0;
        }
        sums.iter_mut().zip(&counts).for_each(|(s, c)| *s /= c.max(1.0));
        pattern.data.iter_mut().enumerate().for_each(|(i, v)| *v -= sums[group(i)] as f32);
    };
    remove(h, &|i| i / w);
    remove(w, &|i| i % w);
    remove(REPEAT_PX * REPEAT_PX, &|i| (i / w) % REPEAT_PX * REPEAT_PX + (i % w) % REPEAT_PX);
}

fn mean_square(plane: &Plane<f32>) -> f64 {
    plane.data.iter().map(|v| f64::from(v * v)).sum::<f64>() / plane.data.len().max(1) as f64
}

/// How alike two patterns of one size are.
pub fn likeness(a: &Plane<f32>, b: &Plane<f32>) -> Likeness {
    let scale = (mean_square(a) * mean_square(b)).sqrt().max(1e-30);
    let n = a.data.len();
    let at = |shift: usize| {
        let (head, tail) = b.data.split_at(shift);
        let product = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
        (product(&a.data[..n - shift], tail) + product(&a.data[n - shift..], head)) / n as f64 / scale
    };
    // All over the picture, and off the repeats of rows and blocks.
    let chance: f64 =
        (1..=SHIFTS).map(|k| at((n / (SHIFTS + 1)) * k + 37 * k % 101 + 3)).map(|c| c * c).sum::<f64>()
            / SHIFTS as f64;
    let correlation = at(0);
    Likeness { correlation, deviations: correlation / chance.sqrt().max(1e-30) }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Dice(u64);

    impl Dice {
        fn normal(&mut self) -> f32 {
            // Splitmix64: neighbouring seeds have nothing to do with each other.
            let mut roll = || {
                self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
                let a = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                let b = (a ^ (a >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
                ((b ^ (b >> 31)) >> 40) as f32 / (1 << 24) as f32
            };
            (0..12).map(|_| roll()).sum::<f32>() - 6.0
        }
    }

    fn unit(seed: u64, prnu: f32, frames: u64) -> Flat {
        let (w, h) = (320, 256);
        let mut dice = Dice(seed);
        let gains: Vec<f32> = (0..w * h).map(|_| 1.0 + prnu * dice.normal()).collect();
        let mut sums = FlatSums::new(w, h, Encoding::Linear, 0.0);
        for frame in 0..frames {
            let mut dice = Dice((seed << 32) + (frame << 16));
            let half = 0.5 * (w as f32).hypot(h as f32);
            let picture = Plane::from_fn(w, h, |x, y| {
                let (dx, dy) = ((x as f32 + 0.5 - 160.0) / half, (y as f32 + 0.5 - 128.0) / half);
                let q = dx * dx + dy * dy;
                let light = 0.5 * (1.0 - 0.3 * q - 0.1 * q * q) * (1.0 + 0.04 * dx);
                [light * gains[y * w + x] + 0.01 * dice.normal()]
            });
            sums.add(&picture, 0.0);
        }
        sums.measure(std::path::Path::new("flat")).expect("a flat field")
    }

    #[test]
    fn what_a_few_steps_make_of_pictures_without_noise_is_within_the_intervals() {
        let (w, h) = (320, 256);
        let flat = |step: f32, noise: f32| {
            let mut dice = Dice(5);
            let mut sums = FlatSums::new(w, h, Encoding::Linear, 0.0);
            for _ in 0..4 {
                let picture = Plane::from_fn(w, h, |x, y| {
                    let (dx, dy) = ((x as f32 - 159.5) / 205.0, (y as f32 - 127.5) / 205.0);
                    let light = 0.5 - 0.1 * (dx * dx + dy * dy) + noise * dice.normal();
                    [(light / step).round() * step]
                });
                sums.add(&picture, step);
            }
            sums.measure(std::path::Path::new("flat")).expect("a flat field")
        };
        let holds = |m: &Measured, true_value: f64| m.ci95[0] <= true_value && true_value <= m.ci95[1];
        let few = flat(1.0 / 15.0, 0.015);
        assert!(!few.prnu.is_some() && holds(&few.a1, -0.2), "{:?} {:?} {}", few.prnu, few.a1, few.rounding);
        let chance = 1.96 * 0.015 / 0.5 / (w as f64 * h as f64).sqrt();
        assert!((few.a1.value + 0.2).abs() > chance, "control: steps show, {:?}", few.a1);
        // Noise that hides the steps costs nothing.
        let many = flat(1.0 / 255.0, 0.004);
        assert!(many.rounding < 1e-6 && holds(&many.a1, -0.2), "{many:?}");
    }

    #[test]
    fn pattern_fall_off_and_noise_come_back_and_units_are_told_apart() {
        let a = unit(3, 0.01, 6);
        assert!((a.prnu.value / 0.01 - 1.0).abs() < 0.03, "{:?}", a.prnu);
        assert!(a.prnu.ci95[0] < 0.01 && 0.01 < a.prnu.ci95[1] * 1.01, "{:?}", a.prnu);
        assert!((a.corner - 0.6).abs() < 0.01, "{} {:?} {:?}", a.corner, a.a1, a.a2);
        assert!((a.tilt - 0.04).abs() < 0.004, "{}", a.tilt);
        // 0.01 of a level of 0.5, less in the corners: more of what is left there.
        assert!((0.02..0.027).contains(&a.temporal), "{}", a.temporal);
        assert!(a.itself.deviations > 20.0, "{:?}", a.itself);
        let again = likeness(&a.pattern, &unit(3, 0.01, 4).pattern);
        assert!(again.deviations > 20.0, "{again:?}");
        let other = likeness(&a.pattern, &unit(4, 0.01, 6).pattern);
        assert!(other.deviations.abs() < 5.0, "control: {other:?}");
        // Control: without a pattern there is none.
        let none = unit(5, 0.0, 6);
        assert!(
            none.prnu.value < 0.002 && none.itself.deviations.abs() < 5.0,
            "{:?} {:?}",
            none.prnu,
            none.itself
        );
    }

    /// As a simulation draws it: the mean of the three would have 0.58 of the pattern.
    #[test]
    fn colours_with_patterns_of_their_own_have_that_of_each() {
        let mut dice = Dice(8);
        let gains = Plane::from_fn(320, 256, |_, _| [0, 1, 2].map(|_| 1.0 + 0.02 * dice.normal()));
        let mut sums = FlatSums::new(320, 256, Encoding::Linear, 0.0);
        for _ in 0..4 {
            let one = |v: f32, dice: &mut Dice| 0.5 * v + 0.004 * dice.normal();
            let data = gains.data.iter().map(|v| one(*v, &mut dice)).collect();
            sums.add(&Plane { data, ..gains.clone() }, 0.0);
        }
        let prnu = sums.measure(std::path::Path::new("flat")).expect("a flat field").prnu;
        assert!(prnu.ci95[0] <= 0.0203 && 0.0197 <= prnu.ci95[1], "{prnu:?}");
        assert!((prnu.value / 0.02 - 1.0).abs() < 0.03, "{prnu:?}");
    }

    #[test]
    fn stuck_pixels_and_a_black_level_have_no_part_in_the_pattern() {
        let (w, h, prnu) = (320, 240, 0.006);
        let mut dice = Dice(11);
        let gains: Vec<f32> = (0..w * h).map(|_| 1.0 + prnu * dice.normal()).collect();
        let measured = |stuck: &dyn Fn(usize) -> Option<f32>, pedestal: f32, black: f64| {
            let mut sums = FlatSums::new(w, h, Encoding::Linear, black);
            for frame in 0..4 {
                let mut dice = Dice(7 + (frame << 16));
                let picture = Plane::from_fn(w, h, |x, y| {
                    let (dx, dy) = ((x as f32 - 159.5) / 200.0, (y as f32 - 119.5) / 200.0);
                    let light = 0.5 * (1.0 - 0.3 * (dx * dx + dy * dy)) * gains[y * w + x];
                    let seen = pedestal + (1.0 - pedestal) * light + 0.005 * dice.normal();
                    [stuck(y * w + x).unwrap_or(seen)]
                });
                sums.add(&picture, 1.0 / 1023.0);
            }
            sums.measure(std::path::Path::new("flat")).expect("a flat field")
        };
        let plain = measured(&|_| None, 0.0, 0.0);
        let holds = |m: &Measured, true_value: f64| m.ci95[0] <= true_value && true_value <= m.ci95[1];
        for end in [0.0, 1.0] {
            let stuck = measured(&|i| (i % 2557 == 100).then_some(end), 0.0, 0.0);
            let found = [stuck.stuck, stuck.dead];
            assert_eq!(found, if end > 0.0 { [30, 0] } else { [0, 30] });
            assert!((stuck.prnu.value / plain.prnu.value - 1.0).abs() < 0.01, "{end}: {:?}", stuck.prnu);
        }
        // A date on all pictures: strokes of 2 px in one of 90x20.
        let stroke = |x: usize, y: usize| x % 9 < 2 || y % 9 < 2;
        let date = |i: usize| {
            let (x, y) = (i % w, i / w);
            let there = (200..290).contains(&x) && (210..230).contains(&y) && stroke(x, y);
            there.then_some(0.9)
        };
        let dated = measured(&date, 0.0, 0.0);
        assert!((dated.prnu.value / plain.prnu.value - 1.0).abs() < 0.03, "{:?}", dated.prnu);
        let [left, top, right, bottom] = dated.drawn_px[0];
        assert!(left >= 190 && top >= 200 && right <= 300 && bottom <= 240, "{:?}", dated.drawn_px);
        assert!(plain.drawn_px.is_empty(), "control");
        let raised = measured(&|_| None, 0.06, 0.06);
        assert!(holds(&raised.a1, -0.3) && holds(&raised.prnu, f64::from(prnu)), "{raised:?}");
        let taken_for_light = measured(&|_| None, 0.06, 0.0);
        assert!(!holds(&taken_for_light.a1, -0.3), "control: {:?}", taken_for_light.a1);
    }

    /// Copies of a photograph with noise, photographs by a camera that moves, and a sensor's pattern behind a
    /// compression that leaves the means of its blocks.
    #[test]
    fn a_scene_is_no_flat_field() {
        let (w, h) = (320, 256);
        let measured = |at: &dyn Fn(usize, usize, usize) -> f32| {
            let mut sums = FlatSums::new(w, h, Encoding::Linear, 0.0);
            for frame in 0..4 {
                let mut dice = Dice(99 + (frame << 16) as u64);
                let picture = Plane::from_fn(w, h, |x, y| [at(x, y, frame) + 0.005 * dice.normal()]);
                sums.add(&picture, 0.0);
            }
            sums.measure(std::path::Path::new("flat"))
        };
        let mut dice = Dice(5);
        let gains: Vec<f32> = (0..w * h).map(|_| 1.0 + 0.05 * dice.normal()).collect();
        // Boxes of several sizes: not one period.
        let tone = |i: usize, j: usize| ((i * 73_856_093) ^ (j * 19_349_663)) % 97;
        let room = |x: usize, y: usize| 0.2 + 0.002 * (tone(x / 37, y / 29) + tone(x / 61, y / 53)) as f32;
        let refused =
            |r: Result<Flat>| r.map_or_else(|e| e.to_string(), |f| format!("a flat field: {:?}", f.prnu));
        let scene = refused(measured(&|x, y, _| room(x, y)));
        assert!(scene.contains("a pattern that is no pixel's own"), "{scene}");
        let moving = refused(measured(&|x, y, frame| room(x + 9 * frame, y)));
        assert!(moving.contains("a difference of the pictures that is no pixel's own"), "{moving}");
        let packed = |x: usize, y: usize, _: usize| 0.5 * gains[y / 8 * 8 * w + x / 8 * 8];
        measured(&packed).expect("a sensor's own pattern behind a compression");
        measured(&|x, y, _| 0.5 * gains[y * w + x]).expect("control");
    }
}
