//! Offsets and hot pixels from pictures with the cap on (EMVA 1288, release 4.0, sections 4.2 and 8.4).

use serde::Serialize;

use super::box_mean::box_mean;
use super::flat::{AROUND_PX, Measured};
use super::frames::{Encoding, of_pattern};
use super::own::{Z99, beyond};
use shutterbug::error::{Error, Result};
use shutterbug::plane::Plane;

/// Pixels of a pixel's surroundings.
const AROUND: f64 = ((2 * AROUND_PX + 1) * (2 * AROUND_PX + 1)) as f64;
/// Share of the picture that is taken for where it is darkest.
const DARKEST: f64 = 0.01;

/// What dark pictures tell.
#[derive(Clone, Debug, Serialize)]
pub struct Dark {
    /// Pictures.
    pub frames: usize,
    /// Mean linear value, 1 = white.
    pub level: f64,
    /// The same where it is lowest: a glow or a leak of light adds to it.
    pub lowest: f64,
    /// Share of the values that are black: what lies below is cut off there.
    pub black: f64,
    /// Standard deviation of the pixels' offsets, of full scale, without what changes slowly over the picture and
    /// without hot pixels; none where black cuts them off.
    pub dsnu: Option<Measured>,
    /// Noise of one picture, of full scale.
    pub temporal: f64,
    /// What changes slowly: amplifier glow, or light that leaks in. Standard deviation, of full scale.
    pub uneven: f64,
    /// Pixels that are brighter in every picture than their surroundings, chance and offsets make any.
    pub hot: usize,
}

impl Dark {
    /// What the sensor delivers without light, of full scale. Where black cuts off the half of the values it is not
    /// known, and next to nothing.
    pub fn black_level(&self) -> Option<f64> {
        (self.black < 0.5 && self.lowest > 0.0).then_some(self.lowest)
    }
}

/// Dark pictures that come one after another.
#[derive(Clone, Debug)]
pub struct DarkSums {
    encoding: Encoding,
    frames: usize,
    /// Of which offsets and noise are measured (see [`of_pattern`]).
    pattern: Sums,
    /// Of the mean of the colours: a pixel is hot in whichever of them its site has.
    colours: Sums,
}

/// Of one value a pixel.
#[derive(Clone, Debug)]
struct Sums {
    sums: Plane<f32>,
    least: Vec<f32>,
    squares: f64,
    black: usize,
}

impl Sums {
    fn of(size: [usize; 2]) -> Self {
        let sums = Plane::new(size[0], size[1], 1);
        Self { least: vec![f32::INFINITY; sums.data.len()], sums, squares: 0.0, black: 0 }
    }

    fn pixels(&self) -> f64 {
        self.least.len().max(1) as f64
    }

    fn add(&mut self, values: &[f32]) {
        let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / self.pixels();
        self.squares += values.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / self.pixels();
        for ((sum, least), v) in self.sums.data.iter_mut().zip(&mut self.least).zip(values) {
            *sum += v;
            *least = least.min(*v);
            self.black += usize::from(*v <= 0.0);
        }
    }

    /// Mean of one picture.
    fn level(&self, frames: f64) -> f64 {
        self.sums.data.iter().map(|v| f64::from(*v)).sum::<f64>() / (self.pixels() * frames).max(1.0)
    }

    /// What different pictures share, as a variance: noise has no part in their covariance. And the noise of one.
    fn shared_and_noise(&self, n: f64) -> (f64, f64) {
        let level = self.level(n);
        let squared = self.sums.data.iter().map(|v| (f64::from(*v) - n * level).powi(2));
        let of_sum = squared.sum::<f64>() / self.pixels();
        let shared = (of_sum - self.squares) / (n * (n - 1.0));
        (shared, (self.squares / n - shared).max(0.0).sqrt())
    }

    /// The mean of each pixel less that around it, and the latter where the picture is darkest.
    fn own(&self, n: f64) -> (Vec<f32>, f64) {
        let mean = Plane { data: self.sums.data.iter().map(|v| v / n as f32).collect(), ..self.sums };
        let around = box_mean(&mean, AROUND_PX);
        let own = mean.data.iter().zip(&around.data).map(|(v, a)| v - a).collect();
        let mut around = around.data;
        let place = (DARKEST * around.len().saturating_sub(1) as f64) as usize;
        let lowest = around.select_nth_unstable_by(place, f32::total_cmp).1;
        (own, f64::from(*lowest))
    }

    /// Which pixels are hot. A pixel's darkest value lies above this in less than one of a hundred pictures of this
    /// many normal pixels. The spread is that of the middle half, which hot pixels do not widen.
    fn hot(&self, n: f64) -> Vec<bool> {
        let (own, _) = self.own(n);
        let (_, noise) = self.shared_and_noise(n);
        let mut sorted = own.clone();
        let mut at = |share: f64| {
            let i = ((sorted.len() - 1) as f64 * share) as usize;
            f64::from(*sorted.select_nth_unstable_by(i, f32::total_cmp).1)
        };
        let [low, middle, high] = [0.25, 0.5, 0.75].map(&mut at);
        let spread = ((high - low) / 1.349).max(noise / n.sqrt()).max(1e-9);
        let limit = middle + beyond(0.01 / own.len() as f64) * spread;
        // Of the darkest picture, beside what is around the pixel in the mean of all.
        let least = self.least.iter().zip(&self.sums.data).zip(&own);
        least.map(|((least, sum), own)| f64::from(*least - sum / n as f32 + own) > limit).collect()
    }
}

impl DarkSums {
    /// Of none.
    pub fn new(encoding: Encoding) -> Self {
        let none = Sums::of([0; 2]);
        Self { encoding, frames: 0, pattern: none.clone(), colours: none }
    }

    /// Adds a picture of encoded values, of the same size as those before.
    pub fn add(&mut self, encoded: &Plane<f32>) {
        if self.frames == 0 {
            let size = [encoded.width, encoded.height];
            (self.pattern, self.colours) = (Sums::of(size), Sums::of(size));
        }
        let n = encoded.channels;
        let light: Vec<f32> = encoded.data.iter().map(|v| self.encoding.decode(*v)).collect();
        let of_pixels = |f: &dyn Fn(&[f32]) -> f32| light.chunks_exact(n).map(f).collect::<Vec<f32>>();
        self.pattern.add(&of_pixels(&of_pattern));
        self.colours.add(&of_pixels(&|p| p.iter().sum::<f32>() / n as f32));
        self.frames += 1;
    }

    /// What they tell.
    ///
    /// # Errors
    /// Fewer than two pictures.
    pub fn measure(self, path: &std::path::Path) -> Result<Dark> {
        let n = self.frames as f64;
        if self.frames < 2 {
            let found = format!("{} dark picture", self.frames);
            return Err(Error::input(path, None, found, "two or more: noise and offsets look alike in one"));
        }
        let pixels = self.pattern.pixels();
        let level = self.pattern.level(n);
        let (shared, noise) = self.pattern.shared_and_noise(n);
        let (own, darkest) = self.pattern.own(n);
        let of_all = own.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>() / pixels;
        let hot = self.colours.hot(n);
        // What a pixel is beside its surroundings, of which it is a part.
        let kept = 1.0 - 1.0 / AROUND;
        let cold = own.iter().zip(&hot).filter(|(_, hot)| !**hot).map(|(v, _)| f64::from(*v).powi(2));
        let of_own = cold.sum::<f64>() / pixels / kept;
        let variance = of_own - noise * noise / n;
        let spread = of_own * (2.0 / pixels).sqrt() * n / (n - 1.0);
        let dsnu = variance.max(0.0).sqrt();
        let half = 1.96 * if dsnu > 0.0 { spread / (2.0 * dsnu) } else { spread.sqrt() };
        let black = self.pattern.black as f64 / (pixels * n);
        Ok(Dark {
            frames: self.frames,
            level,
            // As far as chance alone puts the darkest of even surroundings below their mean.
            lowest: level.min(darkest + Z99 * (of_all / AROUND).sqrt()),
            black,
            dsnu: (!is_cut_off(black, dsnu, half))
                .then_some(Measured { value: dsnu, ci95: [dsnu - half, dsnu + half] }),
            temporal: noise,
            uneven: (shared - of_all / kept + noise * noise / n).max(0.0).sqrt(),
            hot: hot.iter().filter(|hot| **hot).count(),
        })
    }
}

/// Whether black hides more of the offsets than they are known to: a value that is cut off at black does not move with
/// the offset below it, so that the means of pixels of which this share is black keep the rest of what they differ by.
/// Where the half of the values is black, so is what the typical pixel has.
fn is_cut_off(black: f64, dsnu: f64, half: f64) -> bool {
    black >= 0.5 || black * dsnu > half
}

#[cfg(test)]
mod tests {
    use super::super::dice::Dice;
    use super::*;

    #[test]
    fn offsets_and_hot_pixels_come_back() {
        let mut dice = Dice(9);
        let mut normal = || dice.normal() as f32;
        let (w, h) = (200, 160);
        let offsets: Vec<f32> = (0..w * h).map(|_| 0.004 * normal()).collect();
        let lit = |hot: usize, offset: f32, glow: f32, normal: &mut dyn FnMut() -> f32| {
            let mut sums = DarkSums::new(Encoding::Linear);
            for _ in 0..8 {
                let picture = Plane::from_fn(w, h, |x, y| {
                    let i = y * w + x;
                    let warm = if i % 97 == 5 && i / 97 < hot { 0.2 } else { 0.0 };
                    // An amplifier beside a corner.
                    let near = ((x * x + y * y) as f32 / 3000.0).min(20.0);
                    [0.05 + offset * offsets[i] + warm + glow * (-near).exp() + 0.01 * normal()]
                });
                sums.add(&picture);
            }
            sums.measure(std::path::Path::new("dark")).expect("dark")
        };
        let measured =
            |hot: usize, offset: f32, normal: &mut dyn FnMut() -> f32| lit(hot, offset, 0.0, normal);
        let found = measured(7, 1.0, &mut normal);
        assert_eq!(found.hot, 7);
        let none = measured(0, 1.0, &mut normal);
        let dsnu = |d: &Dark| d.dsnu.expect("nothing is cut off").value;
        assert!((dsnu(&none) / 0.004 - 1.0).abs() < 0.03, "{:?}", none.dsnu);
        assert!((none.temporal / 0.01 - 1.0).abs() < 0.02 && none.hot == 0, "{none:?}");
        // Control: without offsets there are none.
        assert!(dsnu(&measured(0, 0.0, &mut normal)) < 0.0007);
        assert!(dsnu(&found) < 0.0042, "hot pixels have no part in it: {:?}", found.dsnu);
        let glows = lit(0, 1.0, 0.05, &mut normal);
        assert!((dsnu(&glows) / 0.004 - 1.0).abs() < 0.03 && glows.hot == 0, "{glows:?}");
        assert!((glows.lowest - 0.05).abs() < 4e-4 && glows.level > 0.0505, "{glows:?}");
        assert!(glows.uneven > 0.005 && none.uneven < 0.0005, "{} {}", glows.uneven, none.uneven);
    }

    /// The mean of three colours would have 0.58 of the offsets; a pixel that is hot in one colour counts.
    #[test]
    fn colours_with_offsets_of_their_own_have_those_of_one() {
        let mut dice = Dice(4);
        let mut normal = || dice.normal() as f32;
        let (w, h) = (200, 160);
        let offsets: Vec<[f32; 3]> = (0..w * h).map(|_| [0; 3].map(|_| 0.004 * normal())).collect();
        let mut sums = DarkSums::new(Encoding::Linear);
        for _ in 0..8 {
            sums.add(&Plane::from_fn(w, h, |x, y| {
                let mut pixel = offsets[y * w + x].map(|offset| 0.05 + offset + 0.01 * normal());
                if (x, y) == (70, 50) {
                    pixel[0] += 0.4;
                }
                pixel
            }));
        }
        let found = sums.measure(std::path::Path::new("dark")).expect("dark");
        let dsnu = found.dsnu.expect("nothing is cut off");
        assert!(
            (dsnu.value / 0.004 - 1.0).abs() < 0.03 && dsnu.ci95[0] < 0.004 && dsnu.ci95[1] > 0.004,
            "{dsnu:?}"
        );
        assert!((found.temporal / 0.01 - 1.0).abs() < 0.02 && found.hot == 1, "{found:?}");
    }
}
