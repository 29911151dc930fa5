//! Which pictures of a flat field have another sensor's pattern, or their own at another place. Two pictures of one
//! sensor share its pattern's variance; of two sensors, or where one picture is turned, nothing.

use super::own::beyond;
use shutterbug::plane::Plane;

/// Side of the middle of the pictures that is compared, px: a pattern of a tenth of the noise shows there.
const SIDE_PX: usize = 512;
/// Pixels that lie further apart have no noise in common that demosaicking or compression mix.
const NEAR_PX: usize = 4;
/// How often a picture may be taken for another sensor's.
const ALPHA: f64 = 0.01;
/// Levels further apart than this leave offsets another share of the pattern.
const LEVELS: f64 = 2.0;

/// Pictures that differ from the rest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Odd {
    /// Those that differ, in the order in which they came.
    pub pictures: Vec<usize>,
    /// Those that they differ from.
    pub others: Vec<usize>,
}

/// The middle of each picture's pattern.
#[derive(Clone, Debug, Default)]
pub(super) struct Patterns(Vec<One>);

#[derive(Clone, Debug)]
struct One {
    level: f64,
    pattern: Vec<f32>,
    square: f64,
    /// Pixels that act as one in a covariance: the sum of squared correlations with neighbours.
    together: f64,
}

impl Patterns {
    /// Adds a picture's pattern.
    pub(super) fn add(&mut self, own: &Plane<f32>, level: f64) {
        let (w, h) = (own.width.min(SIDE_PX), own.height.min(SIDE_PX));
        let (left, top) = ((own.width - w) / 2, (own.height - h) / 2);
        let pattern: Vec<f32> = (top..top + h).flat_map(|y| own.row(y)[left..left + w].to_vec()).collect();
        let square = product(&pattern, &pattern);
        let correlation = |dx: usize, dy: usize| {
            let shifted = pattern.get(dy * w + dx..).unwrap_or_default();
            product(&pattern[..shifted.len()], shifted) / square.max(1e-300)
        };
        let near = (0..=NEAR_PX).flat_map(|dy| (0..=NEAR_PX).map(move |dx| (dx, dy)));
        // Each distance stands for itself and its mirror images.
        let times = |dx: usize, dy: usize| (1 + usize::from(dx > 0)) * (1 + usize::from(dy > 0));
        let together = near.map(|(dx, dy)| times(dx, dy) as f64 * correlation(dx, dy).powi(2)).sum();
        self.0.push(One { level, pattern, square, together });
    }

    /// The pictures that share less than half of what the two most alike share with the one that most pictures are
    /// like, by more than chance.
    pub(super) fn odd(&self) -> Option<Odd> {
        let count = self.0.len();
        let pairs: Vec<[usize; 2]> = (0..count).flat_map(|a| (a + 1..count).map(move |b| [a, b])).collect();
        let shared: Vec<(f64, f64)> = pairs.iter().map(|p| self.covariance(*p)).collect();
        let comparable = |&[a, b]: &[usize; 2]| {
            let [a, b] = [self.0[a].level, self.0[b].level];
            a.max(b) < LEVELS * a.min(b)
        };
        let clear = beyond(ALPHA / pairs.len().max(1) as f64);
        let most_alike = |from: f64| {
            let bright = |p: &[usize; 2]| p.iter().all(|i| self.0[*i].level >= from);
            let alike =
                pairs.iter().zip(&shared).filter(|(p, _)| comparable(p) && bright(p)).map(|(_, s)| *s);
            alike.max_by(|a, b| a.0.total_cmp(&b.0))
        };
        let of_all = most_alike(0.0);
        let of_bright: Vec<_> = self.0.iter().map(|picture| most_alike(picture.level / LEVELS)).collect();
        let differ = |pair: &[usize; 2], (value, own): (f64, f64)| {
            // Offsets make more of a dark picture's pattern, and gains as much: it shares no less with a bright one
            // than bright ones do with each other. With the cap on it shares nothing.
            let [a, b] = *pair;
            let brighter = if self.0[a].level > self.0[b].level { a } else { b };
            let alike = if comparable(pair) { of_all } else { of_bright[brighter] };
            alike.is_some_and(|(most, error)| 0.5 * most - value > clear * own.hypot(0.5 * error))
        };
        let all: Vec<[usize; 2]> =
            pairs.iter().zip(&shared).filter(|(p, s)| differ(p, **s)).map(|(p, _)| *p).collect();
        let differs = |a: usize, b: usize| all.contains(&[a.min(b), a.max(b)]);
        let of = (0..count).min_by_key(|a| (0..count).filter(|b| differs(*a, *b)).count())?;
        let (pictures, others): (Vec<_>, Vec<_>) = (0..count).partition(|b| differs(of, *b));
        (!pictures.is_empty()).then_some(Odd { pictures, others })
    }

    /// Correlation of the noise of pictures that follow each other, where they share more than pictures at least half
    /// of all apart do, by more than chance: what stays is the same in both. None of fewer than three, or of levels
    /// that leave offsets another share.
    pub(super) fn shared_noise(&self) -> Option<f64> {
        let count = self.0.len();
        let levels = || self.0.iter().map(|p| p.level);
        let (low, high) = (levels().fold(f64::INFINITY, f64::min), levels().fold(0.0, f64::max));
        if count < 3 || high >= LEVELS * low {
            return None;
        }
        let products = |lag: usize| {
            let mut mean = vec![0.0f64; self.0[0].pattern.len()];
            for pair in (lag..count).map(|t| [&self.0[t - lag], &self.0[t]]) {
                let product = pair[0].pattern.iter().zip(&pair[1].pattern).map(|(a, b)| f64::from(a * b));
                mean.iter_mut().zip(product).for_each(|(m, v)| *m += v / (count - lag) as f64);
            }
            mean
        };
        let (near, far) = (products(1), products(count.div_ceil(2)));
        let n = near.len().max(1) as f64;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / n;
        let (more, stays) = (mean(&near) - mean(&far), mean(&far));
        let spread = near.iter().zip(&far).map(|(a, b)| (a - b - more).powi(2)).sum::<f64>() / n;
        let of_each = |value: &dyn Fn(&One) -> f64| self.0.iter().map(value).sum::<f64>() / count as f64;
        let error = (spread * of_each(&|p| p.together) / n).sqrt();
        (more > beyond(ALPHA) * error).then(|| more / (of_each(&|p| p.square) - stays).max(more))
    }

    /// What two pictures share, and its standard deviation if that is nothing (Bartlett's formula).
    fn covariance(&self, [a, b]: [usize; 2]) -> (f64, f64) {
        let [a, b] = [&self.0[a], &self.0[b]];
        let pixels = a.pattern.len().max(1) as f64;
        let together = 0.5 * (a.together + b.together);
        (product(&a.pattern, &b.pattern), (a.square * b.square * together / pixels).sqrt())
    }
}

/// Mean product.
fn product(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>() / a.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::super::dice::Dice;
    use super::*;

    #[test]
    fn pictures_of_another_sensor_are_named() {
        let mut dice = Dice(5);
        let mut normal = || dice.normal() as f32;
        let (w, h) = (160, 120);
        let sensors = [0, 1].map(|_| Plane::from_fn(w, h, |_, _| [0.006 * normal()]));
        let mut odd = |of: &[usize], turned: usize, share: f32| {
            let mut all = Patterns::default();
            for (k, sensor) in of.iter().enumerate() {
                let own = Plane::from_fn(w, h, |x, y| {
                    let (u, v) = if k == turned { (w - 1 - x, h - 1 - y) } else { (x, y) };
                    [share * sensors[*sensor].pixel(u, v)[0] + 0.016 * normal()]
                });
                all.add(&own, 0.4);
            }
            all.odd()
        };
        let found = |pictures: &[usize], others: &[usize]| {
            Some(Odd { pictures: pictures.to_vec(), others: others.to_vec() })
        };
        assert_eq!(odd(&[0, 0, 1, 1], 9, 1.0), found(&[2, 3], &[0, 1]));
        assert_eq!(odd(&[1, 0, 0, 0], 9, 1.0), found(&[0], &[1, 2, 3]));
        assert_eq!(odd(&[0, 0, 0], 2, 1.0), found(&[2], &[0, 1]));
        // Controls: one sensor, and patterns too faint to tell.
        assert_eq!(odd(&[0, 0, 0, 0], 9, 1.0), None);
        assert_eq!(odd(&[0, 1, 0, 1], 9, 0.0), None);
    }

    #[test]
    fn a_picture_with_the_cap_on_is_named_and_a_dark_one_is_not() {
        let mut dice = Dice(5);
        let mut normal = || dice.normal() as f32;
        let (w, h) = (160, 120);
        let [gains, offsets] = [0.006, 0.0005].map(|s| Plane::<f32>::from_fn(w, h, |_, _| [s * normal()]));
        let mut odd = |lit: f32| {
            let mut all = Patterns::default();
            for k in 0..5 {
                let (level, lit) = if k == 4 { (0.05, lit) } else { (0.4, 1.0) };
                let own = Plane::from_fn(w, h, |x, y| {
                    let pattern = gains.pixel(x, y)[0] + offsets.pixel(x, y)[0] / level;
                    [lit * pattern + 0.001 / level * normal()]
                });
                all.add(&own, f64::from(level));
            }
            all.odd().map(|odd| odd.pictures)
        };
        assert_eq!(odd(1.0), None, "a shorter exposure");
        assert_eq!(odd(0.0), Some(vec![4]));
    }

    #[test]
    fn noise_that_pictures_of_a_video_share_is_told_from_the_pattern() {
        let mut dice = Dice(5);
        let mut normal = || dice.normal() as f32;
        let (w, h) = (160, 120);
        let sensor = Plane::from_fn(w, h, |_, _| [0.006 * normal()]);
        let mut shared = |kept: f32, count: usize| {
            let mut noise = Plane::<f32>::new(w, h, 1);
            let mut all = Patterns::default();
            for t in 0..count + 9 {
                noise.data.iter_mut().for_each(|v| *v = kept * *v + (1.0 - kept) * 0.016 * normal());
                if t >= 9 {
                    all.add(
                        &Plane::from_fn(w, h, |x, y| [sensor.pixel(x, y)[0] + noise.pixel(x, y)[0]]),
                        0.4,
                    );
                }
            }
            all.shared_noise()
        };
        for (kept, count) in [(0.7, 3), (0.7, 4), (0.4, 8)] {
            let found = shared(kept, count).expect("shared");
            let far = kept.powi(count.div_ceil(2) as i32);
            let want = f64::from((kept - far) / (1.0 - far));
            assert!((found - want).abs() < 0.05, "{kept} {count}: {found} for {want}");
        }
        // Control: noise of its own in each.
        let false_ones = (0..20).filter(|_| shared(0.0, 4).is_some()).count();
        assert!(false_ones <= 2, "{false_ones} of 20");
    }
}
