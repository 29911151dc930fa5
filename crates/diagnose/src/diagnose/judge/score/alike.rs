//! What statistics have of errors that are the same wherever a simulator's picture has the same value. Within one value
//! such errors add up, from one value to another they are independent.

use super::Seen;

/// Values of a picture.
const VALUES: usize = 256;

/// Sums of standard deviations by line and value, DN.
pub(super) struct Alike(Vec<[f32; VALUES]>);

impl Alike {
    /// Of so many lines; of none where nothing is rounded alike.
    pub(super) fn new(lines: usize, is_there: bool) -> Self {
        Self(if is_there { vec![[0.0; VALUES]; lines] } else { Vec::new() })
    }

    pub(super) fn add(&mut self, line: usize, v: &Seen) {
        if let Some(sums) = self.0.get_mut(line) {
            sums[usize::from(v.value)] += v.alike.sqrt();
        }
    }

    /// Variance of the mean over the `n` values of a line, DN^2.
    pub(super) fn in_mean(&self, line: usize, n: f64) -> f64 {
        let sums = self.0.get(line).into_iter().flatten();
        sums.map(|s| (f64::from(*s) / n).powi(2)).sum()
    }
}

/// Variance of the difference between the mean of each block of `side` px and that of the block that is twice as large,
/// DN^2, in the order `[block row, block column, channel]`.
pub(super) fn beside_larger(values: &[Option<Seen>], [w, h]: [usize; 2], side: usize) -> Vec<f32> {
    let (across, down) = (w / side, h / side);
    let mut out = vec![0.0; across * down * 3];
    // Means of the four blocks of a larger one, by value.
    let mut means = vec![[0.0f32; 4]; VALUES];
    let one = 1.0 / (side * side) as f32;
    for (y, x, c) in (0..down / 2).flat_map(|y| (0..across / 2 * 3).map(move |i| (y, i / 3, i % 3))) {
        means.fill([0.0; 4]);
        for (u, v) in (0..4 * side * side).map(|k| (k % (2 * side), k / (2 * side))) {
            if let Some(seen) = &values[((2 * y * side + v) * w + 2 * x * side + u) * 3 + c] {
                means[usize::from(seen.value)][2 * (v / side) + u / side] += one * seen.alike.sqrt();
            }
        }
        for k in 0..4 {
            let off = |m: &[f32; 4]| (m[k] - 0.25 * m.iter().sum::<f32>()).powi(2);
            out[((2 * y + k / 2) * across + 2 * x + k % 2) * 3 + c] = means.iter().map(off).sum();
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(value: u8) -> Seen {
        Seen { alike: 0.09, value, ..Seen::default() }
    }

    #[test]
    fn a_line_of_one_value_is_off_as_one_of_its_pixels_and_one_of_many_is_not() {
        let mut lines = Alike::new(2, true);
        (0..100).for_each(|i| {
            lines.add(0, &seen(7));
            lines.add(1, &seen(i));
        });
        assert!((lines.in_mean(0, 100.0) - 0.09).abs() < 1e-5);
        assert!((lines.in_mean(1, 100.0) - 0.0009).abs() < 1e-7);
        assert_eq!(Alike::new(2, false).in_mean(0, 100.0), 0.0);
    }

    #[test]
    fn blocks_of_one_value_do_not_differ_and_blocks_of_two_do() {
        let values = |of: &dyn Fn(usize) -> u8| -> Vec<Option<Seen>> {
            (0..8 * 8 * 3).map(|i| Some(seen(of(i / 3 % 8)))).collect()
        };
        let same = beside_larger(&values(&|_| 5), [8, 8], 2);
        assert!(same.len() == 4 * 4 * 3 && same.iter().all(|v| *v < 1e-9), "{same:?}");
        // Each larger block is half of one value and half of the other: off by half a difference of two.
        let two = beside_larger(&values(&|x| if x % 4 < 2 { 5 } else { 6 }), [8, 8], 2);
        assert!(two.iter().all(|v| (v - 2.0 * 0.25 * 0.09).abs() < 1e-6), "{two:?}");
    }
}
