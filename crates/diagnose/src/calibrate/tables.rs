//! The result as the chain's settings, which become tables of `camera.toml`, and the chain itself as a [`CameraModel`].

use super::model::{CameraModel, IspCamera, at_knots};
use super::noise::Calibration;
use shutterbug::camera::{Intrinsics, ScanOrder, ShutterTiming};
use shutterbug::chain::{Effect, Settings, Value, View};
use shutterbug::effects::{self, ResponseCurve};
use shutterbug::error::Result;
use shutterbug::plane::Plane;
use shutterbug::reference::chain;

/// Sets a parameter of the effect of that stem, within its range.
///
/// # Errors
/// A value outside the parameter's range.
fn set(settings: &mut Settings, effect: &str, name: &str, value: Value) -> Result<()> {
    let effect: &dyn Effect = effects::by_id(effect).expect("the chain has the effects of a calibration");
    settings.set(effect, name, value)
}

/// Settings of a fitted camera. The picture's colours stay those of the scene: `sensor_color` takes the light through
/// the inverse of what stands behind the sensor. The factors of [`IspCamera::level_gain`] become the response's
/// steepness.
///
/// # Errors
/// A value outside the range that the chain allows.
pub fn chain_settings(camera: &IspCamera) -> Result<Settings> {
    let mut out = Settings::default();
    let number = Value::Number;
    set(&mut out, "shot_noise", "full_well_e", number(camera.full_well_e))?;
    set(&mut out, "read_noise", "sigma", number(camera.read_sigma))?;
    if camera.row_sigma > 0.0 {
        set(&mut out, "row_noise", "sigma", number(camera.row_sigma))?;
    }
    if camera.bayer {
        set(&mut out, "bayer_mosaic", "pattern", Value::Choice("RGGB"))?;
        set(&mut out, "bayer_mosaic", "demosaic", Value::Choice("bilinear"))?;
    }
    isp_settings(camera, &mut out)?;
    if camera.luma_sigma_px > 0.0 {
        set(&mut out, "noise_reduction", "luma_sigma_px", number(camera.luma_sigma_px))?;
    }
    if camera.chroma_sigma_px > 0.0 {
        set(&mut out, "noise_reduction", "chroma_sigma_px", number(camera.chroma_sigma_px))?;
    }
    let scheme = match camera.chroma_step {
        [2, 2] => Some("4:2:0"),
        [2, 1] => Some("4:2:2"),
        _ => None,
    };
    if let Some(scheme) = scheme {
        set(&mut out, "chroma_subsampling", "scheme", Value::Choice(scheme))?;
    }
    if let Some(quality) = camera.jpeg_quality {
        set(&mut out, "jpeg", "quality", number(f64::from(quality)))?;
    }
    Ok(out)
}

/// Gains, matrix and response behind the sensor, and their inverse ahead of it.
fn isp_settings(camera: &IspCamera, out: &mut Settings) -> Result<()> {
    let number = Value::Number;
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let bent = camera.level_gain.iter().any(|knots| !knots.is_empty());
    if camera.saturation != 1.0 {
        set(out, "saturation", "factor", number(camera.saturation))?;
    }
    if camera.white_balance != [1.0; 3] || camera.color_matrix != identity || bent || camera.saturation != 1.0
    {
        set(out, "sensor_color", "match", Value::Choice("delivered"))?;
        set(out, "white_balance", "r", number(camera.white_balance[0]))?;
        set(out, "white_balance", "b", number(camera.white_balance[2]))?;
        let names = [["rr", "rg", "rb"], ["gr", "gg", "gb"], ["br", "bg", "bb"]];
        for (name, value) in names.iter().flatten().zip(camera.color_matrix.iter().flatten()) {
            set(out, "color_matrix", name, number(*value))?;
        }
    }
    for (names, knots) in ResponseCurve::NAMES.iter().zip(&camera.level_gain).filter(|(_, k)| !k.is_empty()) {
        let (low, high) = ResponseCurve::RANGE;
        for (i, name) in names.iter().enumerate() {
            let at = i as f64 / (names.len() - 1) as f64;
            set(out, "response_curve", name, number(at_knots(knots, at).clamp(low, high)))?;
        }
    }
    Ok(())
}

/// The paper's own noise, as an alternative to [`chain_settings`]: variances per channel of the delivered picture,
/// white.
///
/// # Errors
/// A variance above 1.
pub fn paper_settings(c: &Calibration) -> Result<Settings> {
    let mut out = Settings::default();
    let mut add = |names: [&str; 3], variances: [f64; 3]| -> Result<()> {
        names.iter().zip(variances).try_for_each(|(n, v)| set(&mut out, "paper_noise", n, Value::Number(v)))
    };
    if let Some(fixed) = c.static_variance {
        add(["static_variance_r", "static_variance_g", "static_variance_b"], fixed)?;
    }
    add(["color_variance_r", "color_variance_g", "color_variance_b"], c.color_variance)?;
    if let Some(edge) = &c.edge_variance {
        // An edge part that is not there beyond chance is none.
        let sure = edge.each_ref().map(|e| if e.ci95[0] > 0.0 { e.value.min(1.0) } else { 0.0 });
        add(["edge_variance_r", "edge_variance_g", "edge_variance_b"], sure)?;
    }
    Ok(out)
}

/// The chain's CPU reference with these settings.
pub struct ChainCamera {
    /// Which effects are on.
    pub settings: Settings,
}

impl CameraModel for ChainCamera {
    fn frame(&self, clean: &Plane<f32>, frame: u32, seed: u64) -> Result<Plane<f32>> {
        let (width, height) = (clean.width as u32, clean.height as u32);
        let side = f64::from(width);
        let intrinsics =
            Intrinsics { width, height, fx: side, fy: side, cx: side / 2.0, cy: f64::from(height) / 2.0 };
        let shutter = ShutterTiming {
            start_s: 0.0,
            exposure_time_s: 0.0,
            readout_time_s: 0.0,
            scan_order: ScanOrder::TopToBottom,
            line_count: height,
        };
        let data = clean.data.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 1.0]).collect();
        let radiance = Plane { width: clean.width, height: clean.height, channels: 4, data };
        let view = View { intrinsics, shutter, frame, seed };
        let seen = chain::picture(effects::LIST, &self.settings, &view, &radiance);
        Ok(Plane { data: seen.data.iter().map(|v| f32::from(*v) / 255.0).collect(), ..*clean })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chain_makes_the_noise_of_the_model_that_it_is_to_hold() {
        // Without subsampled chroma: the model interpolates it as decoders do, the chain repeats it.
        let camera = IspCamera {
            bayer: true,
            luma_sigma_px: 0.8,
            chroma_sigma_px: 1.6,
            white_balance: [1.6, 1.0, 1.9],
            color_matrix: [[1.5, -0.35, -0.15], [-0.2, 1.4, -0.2], [-0.05, -0.45, 1.5]],
            ..IspCamera::sensor(900.0, 0.004, true, 1.0 / 255.0)
        };
        let clean = Plane::from_fn(256, 256, |_, _| [0.3f32, 0.35, 0.25]);
        let chain = ChainCamera { settings: chain_settings(&camera).expect("in range") };
        let variances = |model: &dyn CameraModel| {
            let [a, b] = [0, 1].map(|f| model.frame(&clean, f, 3).expect("a frame"));
            [0, 1, 2].map(|c| {
                let d = a.data.iter().zip(&b.data).skip(c).step_by(3).map(|(a, b)| f64::from(b - a).powi(2));
                d.sum::<f64>() / 65_536.0
            })
        };
        let (model, engine) = (variances(&camera), variances(&chain));
        for c in 0..3 {
            assert!((engine[c] / model[c] - 1.0).abs() < 0.08, "{engine:?} for {model:?}");
        }
        // Control: a sensor of half the full well is seen.
        let other = variances(&IspCamera { full_well_e: 450.0, ..camera });
        assert!((engine[1] / other[1] - 1.0).abs() > 0.25);
    }
}
