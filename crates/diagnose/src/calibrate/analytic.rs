//! The covariance that [`IspCamera`] gives to small noise, in closed form: every stage behind the sensor is linear for
//! small noise, so its effect on the power spectrum is a product. Averaged over the phases of mosaic and subsampling.

use std::f64::consts::PI;
use std::sync::LazyLock;

use super::cells::PAIRS;
use super::frames::Encoding;
use super::model::{IspCamera, LUMA};
use super::spatial::LAGS;

/// Frequencies a side of the quarter plane.
const GRID: usize = 24;

/// Autocovariance of unit noise of one sensor channel behind mosaic and smoothing, at lag 0 and [`LAGS`].
type Kernel = [f64; 7];

/// What of each sensor channel arrives: through luma twice, through luma and chroma, through chroma twice.
struct Arriving {
    luma: [Kernel; 3],
    mixed: [Kernel; 3],
    chroma: [Kernel; 3],
}

/// Number of frequencies.
const POINTS: usize = GRID * GRID;

/// What does not depend on the camera, at each frequency: the mosaic's power (red and blue, green; or no mosaic) times
/// the wave of a lag. The fit asks for the rest some ten thousand times.
struct Waves {
    tent: [Vec<f64>; 7],
    cross: [Vec<f64>; 7],
    flat: [Vec<f64>; 7],
}

fn omega(i: usize) -> f64 {
    PI * (i as f64 + 0.5) / GRID as f64
}

static WAVES: LazyLock<Waves> = LazyLock::new(|| {
    let of = |power: fn(f64, f64) -> f64| -> [Vec<f64>; 7] {
        std::array::from_fn(|k| {
            let at = |p: usize| {
                let (wx, wy) = (omega(p % GRID), omega(p / GRID));
                let lag = match k {
                    0 => 1.0,
                    k => (LAGS[k - 1].0 as f64 * wx).cos() * (LAGS[k - 1].1 as f64 * wy).cos(),
                };
                lag * power(wx, wy) / POINTS as f64
            };
            (0..POINTS).map(at).collect()
        })
    };
    // Bilinear demosaic: a tent around every fourth pixel for red and blue, a cross around every second for green.
    Waves {
        tent: of(|wx, wy| ((1.0 + wx.cos()) * (1.0 + wy.cos())).powi(2) / 4.0),
        cross: of(|wx, wy| (1.0 + 0.5 * (wx.cos() + wy.cos())).powi(2) / 2.0),
        flat: of(|_, _| 1.0),
    }
});

fn arriving(camera: &IspCamera) -> Arriving {
    let gaussian = |sigma: f64, w: f64| (-0.5 * (sigma * w).powi(2)).exp();
    // Mean of 2, then linear interpolation back: (1/2 1/2) * (1/4 3/4 3/4 1/4) / 2 has this response.
    let halved = |w: f64| (0.5 * w).cos() * (0.75 * (0.5 * w).cos() + 0.25 * (1.5 * w).cos());
    let luma: [f64; GRID] = std::array::from_fn(|i| gaussian(camera.luma_sigma_px, omega(i)));
    let chroma: [[f64; GRID]; 2] = [0, 1].map(|axis| {
        let on = camera.chroma_step[axis] == 2;
        std::array::from_fn(|i| {
            let w = omega(i);
            gaussian(camera.chroma_sigma_px, w) * if on { halved(w) } else { 1.0 }
        })
    });
    let response = |of: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
        let at = |p: usize| {
            let (i, j) = (p % GRID, p / GRID);
            of(luma[i] * luma[j], chroma[0][i] * chroma[1][j])
        };
        (0..POINTS).map(at).collect()
    };
    let waves = &*WAVES;
    let sources = if camera.bayer { [&waves.tent, &waves.cross] } else { [&waves.flat, &waves.flat] };
    let kernels = |response: Vec<f64>| -> [Kernel; 3] {
        let of = |source: &[Vec<f64>; 7]| -> Kernel {
            std::array::from_fn(|k| source[k].iter().zip(&response).map(|(w, r)| w * r).sum())
        };
        let [outer, green] = sources.map(of);
        [outer, green, outer]
    };
    Arriving {
        luma: kernels(response(&|y, _| y * y)),
        mixed: kernels(response(&|y, c| y * c)),
        chroma: kernels(response(&|_, c| c * c)),
    }
}

/// What a bilinear demosaic leaves of the variance of red, green and blue, averaged over the mosaic: a tent around
/// every fourth pixel, a cross around every second.
const MOSAIC_POWER: [f64; 3] = [9.0 / 16.0, 5.0 / 8.0, 9.0 / 16.0];

/// Slope of the encoding, clipped at black and white, averaged over normal noise around a linear value: what small
/// changes of the noise are passed on with (Stein: the mean of f' is that of z f(v + sigma z) over sigma).
fn mean_slope(encoding: Encoding, linear: f64, sigma: f64) -> f64 {
    /// In sigmas, and the step.
    const REACH: f64 = 8.0;
    const STEP: f64 = 0.4;
    let whole = linear > REACH * sigma && linear + REACH * sigma < 1.0;
    if whole || sigma <= 0.0 || encoding == Encoding::Linear {
        return encoding.slope(linear);
    }
    let (mut sum, mut of_line) = (0.0, 0.0);
    for i in -8..=8 {
        let z = STEP * f64::from(i);
        let weight = (-0.5 * z * z).exp() * z;
        sum += weight * f64::from(encoding.encode((linear + sigma * z).clamp(0.0, 1.0) as f32));
        of_line += weight * z;
    }
    sum / (of_line * sigma)
}

/// Covariances of one colour as in [`super::cells::Cell`].
pub struct Predicted {
    /// Variances and covariances at lag 0.
    pub covariance: [f64; 6],
    /// Autocovariances of R, G, B at [`LAGS`].
    pub lagged: [[f64; 6]; 3],
}

/// Noise of the camera at each of the (encoded) `colors`. `None` if the colour matrix cannot be inverted.
pub fn predict(camera: &IspCamera, colors: &[[f64; 3]]) -> Option<Vec<Predicted>> {
    let inverse = camera.inverse_matrix()?;
    let kernels = arriving(camera);
    let encoding = if camera.srgb { Encoding::Srgb } else { Encoding::Linear };
    let rounding = camera.step.powi(2) / 12.0;
    let one = |encoded: &[f64; 3]| {
        let color: [f64; 3] = encoded.map(|v| f64::from(encoding.decode(v as f32)));
        let vivid = camera.vivid(color);
        let seen = camera.sensor_color(&inverse, color);
        let saturation = if camera.srgb { camera.saturation } else { 1.0 };
        let variance: [f64; 3] =
            std::array::from_fn(|k| seen[k] / camera.full_well_e + camera.read_sigma.powi(2));
        // Ahead of the smoothing, where black and white clip it.
        let slope: [f64; 3] = std::array::from_fn(|i| {
            let linear = |k: usize| camera.color_matrix[i][k] * camera.white_balance[k];
            let power = |k: usize| if camera.bayer { MOSAIC_POWER[k] } else { 1.0 };
            let all: f64 = (0..3).map(|k| linear(k).powi(2) * variance[k] * power(k)).sum();
            mean_slope(encoding, vivid[i], all.sqrt())
        });
        // How sensor channel k reaches luma, and what of it picture channel i has beyond that.
        let gain = |i: usize, k: usize| slope[i] * camera.color_matrix[i][k] * camera.white_balance[k];
        let to_luma: [f64; 3] = std::array::from_fn(|k| (0..3).map(|j| LUMA[j] * gain(j, k)).sum());
        let covariance = |a: usize, b: usize, lag: usize| -> f64 {
            (0..3)
                .map(|k| {
                    let y = to_luma[k];
                    let [ca, cb] = [a, b].map(|i| saturation * (gain(i, k) - y));
                    variance[k]
                        * (y * y * kernels.luma[k][lag]
                            + y * (ca + cb) * kernels.mixed[k][lag]
                            + ca * cb * kernels.chroma[k][lag])
                })
                .sum()
        };
        let at_once = PAIRS.map(|(a, b)| covariance(a, b, 0) + if a == b { rounding } else { 0.0 });
        let lagged = std::array::from_fn(|c| std::array::from_fn(|k| covariance(c, c, k + 1)));
        Predicted { covariance: at_once, lagged }
    };
    Some(colors.iter().map(one).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::cells::cells;
    use crate::calibrate::model::CameraModel;
    use shutterbug::plane::{Plane, srgb_decode};

    #[test]
    fn the_closed_form_agrees_with_the_simulation() {
        let camera = IspCamera {
            bayer: true,
            white_balance: [1.6, 1.0, 1.9],
            color_matrix: [[1.5, -0.35, -0.15], [-0.2, 1.4, -0.2], [-0.05, -0.45, 1.5]],
            luma_sigma_px: 0.8,
            chroma_sigma_px: 1.7,
            chroma_step: [2, 2],
            row_sigma: 0.0,
            ..IspCamera::sensor(4000.0, 0.004, true, 0.0)
        };
        let encoded = [0.55, 0.5, 0.42];
        let clean = Plane::from_fn(400, 400, |_, _| encoded.map(srgb_decode));
        let frames = [0, 1].map(|f| camera.frame(&clean, f, 3).expect("a frame"));
        let flat = Plane::from_fn(400, 400, |_, _| encoded);
        let d =
            Plane { data: frames[0].data.iter().zip(&frames[1].data).map(|(a, b)| b - a).collect(), ..flat };
        let found = cells(&flat, &d, &vec![true; 160_000]);
        let cell = found.values().next().expect("one cell");
        let want = &predict(&camera, &[encoded.map(f64::from)]).expect("invertible")[0];
        for k in 0..3 {
            let ratio = cell.covariance[k] / want.covariance[k];
            assert!((ratio - 1.0).abs() < 0.05, "channel {k}: {ratio}");
            for lag in 0..6 {
                let (got, want) =
                    (cell.lagged[k][lag] / cell.covariance[k], want.lagged[k][lag] / want.covariance[k]);
                assert!((got - want).abs() < 0.03, "channel {k}, lag {lag}: {got} for {want}");
            }
        }
        // Control: without the matrix it does not.
        let plain = IspCamera { color_matrix: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], ..camera };
        let other = &predict(&plain, &[encoded.map(f64::from)]).expect("invertible")[0];
        assert!((cell.covariance[0] / other.covariance[0] - 1.0).abs() > 0.3);
    }
}
