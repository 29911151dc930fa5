//! Random numbers for making captures: a stream per purpose, so that one more draw in a scene does not change the
//! motion.

/// SplitMix64 (Steele, Lea, Flood 2014): small, and good enough for choosing scenes.
pub(super) struct Draw(u64);

impl Draw {
    /// A stream of its own for a seed, a case and a purpose.
    pub(super) fn new(seed: u64, case: usize, purpose: &str) -> Self {
        let mut draw = Self(seed ^ (case as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        for byte in purpose.bytes() {
            draw.0 = draw.bits() ^ u64::from(byte);
        }
        draw
    }

    /// 64 random bits.
    pub(super) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in 0..1.
    pub(super) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform between two values.
    pub(super) fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.unit()
    }

    /// Uniform in the logarithm: strengths of all orders come up equally often.
    pub(super) fn log_between(&mut self, from: f64, to: f64) -> f64 {
        (self.between(from.ln(), to.ln())).exp()
    }

    /// One of 0..count.
    pub(super) fn index(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count - 1)
    }

    /// True with a probability.
    pub(super) fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// Minus or plus one.
    pub(super) fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_repeat_and_differ_by_seed_case_and_purpose() {
        let first = |seed, case, purpose| Draw::new(seed, case, purpose).bits();
        assert_eq!(first(1, 2, "scene"), first(1, 2, "scene"));
        let others = [first(2, 2, "scene"), first(1, 3, "scene"), first(1, 2, "motion")];
        assert!(others.iter().all(|o| *o != first(1, 2, "scene")), "{others:?}");
        let mut draw = Draw::new(1, 0, "mean");
        let mean = (0..10_000).map(|_| draw.between(2.0, 4.0)).sum::<f64>() / 10_000.0;
        // The standard error is 0.006.
        assert!((mean - 3.0).abs() < 0.03, "{mean}");
    }
}
