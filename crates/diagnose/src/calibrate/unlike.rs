//! Pairs of frames whose noise differs at equal brightness: of another gain (ISO) or another camera. One line through
//! all of them is that of none.

use super::frames::{Encoding, Frame};
use super::noise::Measured;
use super::ptc::{self, Bin, PtcFit};
use super::statics::AlignedPair;

/// From this ratio of variances on: what comparisons with a simulation call near.
const NEAR: f64 = 1.1;

/// Opens the intervals of lines through pairs whose noise differs, to those of each pair, and says which pairs.
pub(super) fn widened(
    real: &mut Measured,
    pairs: &[AlignedPair],
    frames: &[Frame],
    encoding: Encoding,
) -> Option<String> {
    // A pair alone is what was measured.
    if pairs.len() < 2 {
        return None;
    }
    let own: Vec<[Vec<Bin>; 3]> =
        pairs.chunks(1).map(|pair| ptc::curves(pair, frames[0].step, encoding)).collect();
    let chance = |c: usize, n: f64| 1.96 * (4.0 * real.neighbours[c].effective_pixels / n).sqrt();
    let compared = |k: usize| (0..3).map(move |c| (k, c));
    let unlike = (1..own.len()).flat_map(compared).filter_map(|(k, c)| {
        let (ratio, n) = ratio(&own[k][c], &own[0][c])?;
        (ratio.ln().abs() > NEAR.ln() + chance(c, n)).then_some((k, ratio))
    });
    let (k, ratio) = unlike.max_by(|a, b| a.1.ln().abs().total_cmp(&b.1.ln().abs()))?;
    for (c, fit) in real.fits.iter_mut().enumerate() {
        let Some(fit) = fit else { continue };
        let effective = real.neighbours[c].effective_pixels;
        own.iter().filter_map(|bins| ptc::fit(&bins[c], effective)).for_each(|one| reach(fit, &one));
    }
    let name = |i: usize| frames[i].path.display();
    Some(format!(
        "WARNING: {} and {} have {ratio:.2} times the variance of {} and {} at equal brightness, as frames of another \
         gain (ISO) have: the figures are those of neither, and their intervals hold those of each pair. Give frames \
         of one setting",
        name(2 * k),
        name(2 * k + 1),
        name(0),
        name(1)
    ))
}

/// Variance over that of others in the bins that both have, and the pixels there.
fn ratio(bins: &[Bin], others: &[Bin]) -> Option<(f64, f64)> {
    let (mut sums, mut count) = ([0.0; 2], 0.0);
    for bin in bins.iter().filter(|b| !b.cut_off) {
        let Some(other) = others.iter().find(|o| o.place == bin.place && !o.cut_off) else { continue };
        let n = bin.count.min(other.count);
        sums = [sums[0] + n * bin.variance_linear, sums[1] + n * other.variance_linear];
        count += n;
    }
    (sums[0] > 0.0 && sums[1] > 0.0).then(|| (sums[0] / sums[1], count))
}

/// The intervals of a line, with the values of another one inside.
fn reach(fit: &mut PtcFit, one: &PtcFit) {
    let pairs = [
        (&mut fit.full_well_e, &one.full_well_e),
        (&mut fit.read_sigma, &one.read_sigma),
        (&mut fit.slope, &one.slope),
        (&mut fit.intercept, &one.intercept),
    ];
    for (to, of) in pairs {
        to.ci95 = [to.ci95[0].min(of.ci95[0]), to.ci95[1].max(of.ci95[1])];
    }
}
