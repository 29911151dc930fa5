//! Corners that a round edge leaves dark: a lens hood, the image circle of a fisheye. No polynomial falls off like
//! that, and the edge looks like the sensor's own pattern.

use super::own::{REPEAT_PX, beyond};
use shutterbug::plane::Plane;

/// How often a corner may be taken for a dark one by chance.
const ALPHA: f64 = 0.01;
/// Side of the squares whose means are compared, px.
const SIDE_PX: usize = 2;
const NAMES: [&str; 4] = ["top left", "top right", "bottom left", "bottom right"];

/// Sum of pictures.
#[derive(Clone, Debug)]
pub(super) struct Corners {
    sum: Plane<f32>,
    frames: usize,
}

impl Corners {
    pub(super) fn new(width: usize, height: usize) -> Self {
        Self { sum: Plane::new(width, height, 1), frames: 0 }
    }

    /// Adds a picture of linear values.
    pub(super) fn add(&mut self, light: &Plane<f32>) {
        self.sum.data.iter_mut().zip(&light.data).for_each(|(s, v)| *s += v);
        self.frames += 1;
    }

    /// Corners that get less than half of the light that a fall-off leaves them which goes on as it is over the block
    /// of pixels further in, and the one before. A lens's is smooth. `noise`: of a pixel of one picture.
    pub(super) fn dark(&self, noise: f64) -> Option<String> {
        let all = NAMES.iter().enumerate().filter_map(|(k, name)| Some((name, self.reach(k, noise)?)));
        let found: Vec<String> =
            all.map(|(name, px)| format!("{name} ({px} px along the diagonal)")).collect();
        (!found.is_empty()).then(|| format!("dark corners that no light reaches: {}", found.join(", ")))
    }

    /// How far a dark corner reaches, px.
    fn reach(&self, corner: usize, noise: f64) -> Option<usize> {
        let light = self.along(corner);
        let square_noise = noise / SIDE_PX as f64 / (self.frames.max(1) as f64).sqrt();
        let clear = beyond(ALPHA / (NAMES.len() * light.len()).max(1) as f64);
        let is_dark = |i: &usize| {
            let [own, next, after] = [0, 1, 2].map(|k| light[i + k * REPEAT_PX]);
            let missing = 0.5 * next * next - own * after;
            next > 0.0
                && light[..=*i].iter().all(|v| *v < 0.5 * next)
                && missing > clear * square_noise * next.hypot(own).hypot(after)
        };
        let last = (0..light.len().saturating_sub(2 * REPEAT_PX)).filter(is_dark).max()?;
        let half = 0.5 * light[last + REPEAT_PX];
        (last..).find(|i| light[*i] >= half)
    }

    /// Mean light of squares from a corner to the middle, one for each px.
    fn along(&self, corner: usize) -> Vec<f64> {
        let (w, h) = (self.sum.width, self.sum.height);
        let diagonal = (w as f64).hypot(h as f64);
        let place = |i: usize, side: usize, back: bool| {
            let from = (i as f64 * side as f64 / diagonal) as usize;
            if back { side - SIDE_PX - from } else { from }
        };
        let square = |i: usize| {
            let (x, y) = (place(i, w, corner % 2 == 1), place(i, h, corner / 2 == 1));
            let cells = (0..SIDE_PX * SIDE_PX).map(|k| (x + k % SIDE_PX, y + k / SIDE_PX));
            let sum: f64 = cells.map(|(x, y)| f64::from(self.sum.pixel(x, y)[0])).sum();
            sum / (SIDE_PX * SIDE_PX * self.frames.max(1)) as f64
        };
        (0..(0.5 * diagonal) as usize).map(square).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::dice::Dice;
    use super::*;

    #[test]
    fn round_dark_corners_are_told_from_a_steep_fall_off() {
        let mut dice = Dice(5);
        let mut normal = || dice.normal() as f32;
        let (w, h) = (320, 240);
        let mut found = |level: f32, noise: f32, fall: &dyn Fn(f32) -> f32| {
            let mut corners = Corners::new(w, h);
            for _ in 0..2 {
                corners.add(&Plane::from_fn(w, h, |x, y| {
                    let [dx, dy] = [(x, w), (y, h)].map(|(v, side)| v as f32 + 0.5 - 0.5 * side as f32);
                    [level * fall((dx * dx + dy * dy) / 40_000.0) + noise * normal()]
                }));
            }
            corners.dark(f64::from(noise))
        };
        for (from, left) in [(0.7, 0.02), (0.85, 0.05), (0.95, 0.02), (0.85, 0.3)] {
            let said = found(0.4, 0.01, &|q| if q > from { left } else { 1.0 - 0.2 * q }).expect("dark");
            let px = ((1.0 - f32::sqrt(from)) * 200.0).round();
            assert_eq!(said.matches("px along").count(), 4, "{from}: {said}");
            let near = (-2..=2).any(|d| said.contains(&format!("top left ({} px", px as i32 + d)));
            assert!(near, "{from}: {said} for {px}");
        }
        assert!(found(0.4, 0.01, &|q| if q < 0.9 { 1.0 } else { 0.5 }).is_none(), "a half is no dark corner");
        // Controls: lenses that leave their corners a fifth and a tenth, a soft rim, and little light.
        for fall in [0.3, 0.8, 0.9] {
            assert_eq!(found(0.4, 0.01, &|q| 1.0 - fall * q), None, "{fall}");
        }
        for _ in 0..20 {
            assert_eq!(found(0.02, 0.02, &|q| 1.0 - 0.3 * q), None);
        }
    }
}
