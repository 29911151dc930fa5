//! The camera whose noise is nearest to what was measured: a simplex search on the closed form, then a few rounds in
//! which the simulation's own measurement corrects what the closed form leaves out (rounding, JPEG, clipping).

use std::collections::HashMap;

use super::analytic::{Predicted, predict};
use super::cells::{Cell, Key, PAIRS};
use super::model::IspCamera;

/// What a cell is fitted to.
#[derive(Clone, Debug)]
pub struct Target {
    weight: f64,
    mean: [f64; 3],
    log_variance: [f64; 3],
    cross: [f64; 3],
    lagged: [[f64; 6]; 3],
}

/// Numbers comparable between cells: logarithms of variances, and correlations.
fn features(covariance: &[f64; 6], lagged: &[[f64; 6]; 3]) -> ([f64; 3], [f64; 3], [[f64; 6]; 3]) {
    let variance = [0, 1, 2].map(|c| covariance[c].max(1e-12));
    let cross = [3, 4, 5].map(|k| {
        let (a, b) = PAIRS[k];
        covariance[k] / (variance[a] * variance[b]).sqrt()
    });
    let correlation = [0, 1, 2].map(|c| lagged[c].map(|v| v / variance[c]));
    (variance.map(f64::ln), cross, correlation)
}

/// Targets of measured cells.
pub fn targets(cells: &HashMap<Key, Cell>) -> HashMap<Key, Target> {
    // Beyond some thousand pixels a cell's own statistics are no longer what limits the fit.
    let weigh = |count: f64| (count.min(20_000.0) / 20_000.0).sqrt();
    cells
        .iter()
        .map(|(key, cell)| {
            let (log_variance, cross, lagged) = features(&cell.covariance, &cell.lagged);
            (*key, Target { weight: weigh(cell.count), mean: cell.mean, log_variance, cross, lagged })
        })
        .collect()
}

/// Moves the targets by what simulation and closed form differ by, so that the next fit meets the measurement in the
/// simulation.
pub fn correct(
    camera: &IspCamera,
    measured: &HashMap<Key, Target>,
    simulated: &HashMap<Key, Cell>,
) -> HashMap<Key, Target> {
    let mut corrected = measured.clone();
    for (key, target) in &mut corrected {
        let Some(cell) = simulated.get(key) else { continue };
        let Some(all) = predict(camera, &[target.mean]) else { continue };
        let (log_variance, cross, lagged) = features(&all[0].covariance, &all[0].lagged);
        let got = features(&cell.covariance, &cell.lagged);
        for c in 0..3 {
            target.log_variance[c] += log_variance[c] - got.0[c];
            target.cross[c] += cross[c] - got.1[c];
            for k in 0..6 {
                target.lagged[c][k] += lagged[c][k] - got.2[c][k];
            }
        }
    }
    corrected
}

/// Number of fitted parameters.
const FREE: usize = 12;

/// The start, in the fit's own coordinates; logarithms where a parameter is positive.
fn to_vector(camera: &IspCamera) -> [f64; FREE] {
    let m = &camera.color_matrix;
    [
        camera.full_well_e.ln(),
        camera.read_sigma.max(1e-5).ln(),
        camera.white_balance[0].ln(),
        camera.white_balance[2].ln(),
        camera.luma_sigma_px.max(0.05).ln(),
        camera.chroma_sigma_px.max(0.05).ln(),
        m[0][1],
        m[0][2],
        m[1][0],
        m[1][2],
        m[2][0],
        m[2][1],
    ]
}

fn from_vector(start: &IspCamera, v: &[f64; FREE]) -> IspCamera {
    let (r, b) = (v[2].clamp(-1.4, 1.4).exp(), v[3].clamp(-1.4, 1.4).exp());
    IspCamera {
        full_well_e: v[0].clamp(2.0, 16.0).exp(),
        read_sigma: v[1].clamp(-12.0, -1.0).exp(),
        white_balance: [r, 1.0, b],
        luma_sigma_px: v[4].clamp(-4.0, 1.0).exp(),
        chroma_sigma_px: v[5].clamp(-4.0, 2.3).exp(),
        color_matrix: [
            [1.0 - v[6] - v[7], v[6], v[7]],
            [v[8], 1.0 - v[8] - v[9], v[9]],
            [v[10], v[11], 1.0 - v[10] - v[11]],
        ],
        ..start.clone()
    }
}

/// Weighted mean square of the features' errors, plus a slight pull towards ordinary colour matrices where the noise
/// says nothing.
fn cost(camera: &IspCamera, targets: &[&Target], colors: &[[f64; 3]]) -> f64 {
    let Some(all) = predict(camera, colors) else { return f64::INFINITY };
    let (mut sum, mut weights) = (0.0, 0.0);
    for (target, Predicted { covariance, lagged }) in targets.iter().zip(&all) {
        let (log_variance, cross, correlation) = features(covariance, lagged);
        let mut error = 0.0;
        for c in 0..3 {
            error += (log_variance[c] - target.log_variance[c]).powi(2);
            error += 0.3 * (cross[c] - target.cross[c]).powi(2);
            for k in 0..6 {
                error += 0.5 * (correlation[c][k] - target.lagged[c][k]).powi(2);
            }
        }
        sum += target.weight * error;
        weights += target.weight;
    }
    let off: f64 = PAIRS[3..]
        .iter()
        .flat_map(|&(a, b)| [camera.color_matrix[a][b], camera.color_matrix[b][a]])
        .map(|m| (m + 0.25).powi(2))
        .sum();
    let gains: f64 = [0, 2].map(|k| (camera.white_balance[k] / 1.5).ln().powi(2)).iter().sum();
    sum / weights.max(1e-12) + 0.01 * off + 0.01 * gains
}

/// The camera nearest to the targets, from `start`; `near`: that is known to be nearly it.
pub fn fit(start: &IspCamera, targets: &HashMap<Key, Target>, near: bool) -> IspCamera {
    let mut keys: Vec<&Key> = targets.keys().collect();
    // A map has no order; the search must not depend on it.
    keys.sort();
    let list: Vec<&Target> = keys.iter().map(|k| &targets[*k]).collect();
    let colors: Vec<[f64; 3]> = list.iter().map(|t| t.mean).collect();
    let mut best = to_vector(start);
    let scales: &[f64] = if near { &[0.15, 0.1] } else { &[0.5, 0.3, 0.15, 0.1] };
    for &scale in scales {
        best = simplex(&best, scale, 1500, |v| cost(&from_vector(start, v), &list, &colors));
    }
    from_vector(start, &best)
}

/// Nelder and Mead (Computer Journal 7, 1965).
fn simplex<const N: usize>(
    start: &[f64; N],
    scale: f64,
    steps: usize,
    f: impl Fn(&[f64; N]) -> f64,
) -> [f64; N] {
    let mut points: Vec<([f64; N], f64)> = vec![(*start, f(start))];
    for i in 0..N {
        let mut p = *start;
        p[i] += scale;
        points.push((p, f(&p)));
    }
    for _ in 0..steps {
        points.sort_by(|a, b| a.1.total_cmp(&b.1));
        if points[N].1 - points[0].1 < 1e-9 {
            break;
        }
        let centre: [f64; N] =
            std::array::from_fn(|i| points[..N].iter().map(|p| p.0[i]).sum::<f64>() / N as f64);
        let along = |t: f64| -> ([f64; N], f64) {
            let p = std::array::from_fn(|i| centre[i] + t * (points[N].0[i] - centre[i]));
            (p, f(&p))
        };
        let reflected = along(-1.0);
        let better = if reflected.1 < points[0].1 {
            let expanded = along(-2.0);
            if expanded.1 < reflected.1 { Some(expanded) } else { Some(reflected) }
        } else if reflected.1 < points[N - 1].1 {
            Some(reflected)
        } else {
            let contracted = along(if reflected.1 < points[N].1 { -0.5 } else { 0.5 });
            (contracted.1 < points[N].1.min(reflected.1)).then_some(contracted)
        };
        match better {
            Some(p) => points[N] = p,
            None => {
                let nearest = points[0].0;
                for p in &mut points[1..] {
                    p.0 = std::array::from_fn(|i| 0.5 * (p.0[i] + nearest[i]));
                    p.1 = f(&p.0);
                }
            }
        }
    }
    points.sort_by(|a, b| a.1.total_cmp(&b.1));
    points[0].0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_simplex_finds_the_bottom_of_a_bent_valley() {
        let valley = |p: &[f64; 2]| (1.0 - p[0]).powi(2) + 100.0 * (p[1] - p[0] * p[0]).powi(2);
        let got = simplex(&[-1.2, 1.0], 0.5, 500, valley);
        assert!((got[0] - 1.0).abs() < 1e-2 && (got[1] - 1.0).abs() < 2e-2, "{got:?}");
    }
}
