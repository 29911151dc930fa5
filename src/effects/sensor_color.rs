//! What the sensor sees of the scene's colours. A rendered scene has the colours that a camera is to deliver; behind a
//! sensor stand `white_balance`, `color_matrix`, `response_curve` and `saturation`, which change them. With `match =
//! "delivered"` the light is taken through their inverse first: the sensor sees what these turn back into the scene's
//! colours (its colour filters overlap, its blue is weak), so the delivered picture keeps its colours and the noise
//! gets the ISP's correlations and gains. No sensor sees less than no light: colours outside of what the matrix can
//! make are clipped; so is what is brighter than white or more vivid than `saturation` can deliver, where a response or
//! a saturation is undone. Linear radiance, ahead of the sensor.

use glam::{DMat3, DVec3};

use super::{Saturation, response};
use crate::chain::{At, Domain, Effect, Packer, ParamSpec, Parameters, Settings, Stage, View, Work};
use crate::error::{Error, Result};
use crate::plane::stats::luma;
use crate::plane::{srgb_decode, srgb_encode, three};

/// The effect; its values live in [`Settings`].
pub struct SensorColor;

const ID: &str = "sensor_color";
const DELIVERED: &str = "delivered";
/// Below this determinant a matrix has no inverse worth using.
const SINGULAR: f64 = 1e-3;

pub(super) const SPECS: &[ParamSpec] = &[ParamSpec::choice(
    "match",
    &["radiance", DELIVERED],
    "radiance: the sensor sees the scene's colours; delivered: it sees what white_balance, color_matrix, \
     response_curve and saturation turn back into them",
)];

const MATRIX: u32 = 1;
const CURVE: u32 = 2;
const SATURATION: u32 = 4;
/// Parameter with one over the saturation's factor, behind matrix and curve.
const UNDO: usize = 10;

/// From the delivered linear colours to the sensor's: the inverse of matrix and gains. `None` if there is none.
fn inverse(settings: &Settings) -> Option<DMat3> {
    let entry = |name: &str| {
        let diagonal = name.as_bytes()[0] == name.as_bytes()[1];
        settings.number("color_matrix", name, if diagonal { 1.0 } else { 0.0 })
    };
    let rows = [["rr", "rg", "rb"], ["gr", "gg", "gb"], ["br", "bg", "bb"]].map(|row| row.map(entry));
    let gains = DVec3::new(
        settings.number("white_balance", "r", 1.0),
        1.0,
        settings.number("white_balance", "b", 1.0),
    );
    let forward = DMat3::from_cols_array_2d(&rows).transpose() * DMat3::from_diagonal(gains);
    (forward.determinant().abs() > SINGULAR).then(|| forward.inverse())
}

/// The function of the same name in `glsl/include/effects/sensor_color.glsl`.
fn sensor_color(value: [f32; 3], at: &At, p: &Parameters) -> [f32; 3] {
    let mut seen = value;
    if at.variant & (CURVE | SATURATION) != 0 {
        seen = seen.map(srgb_encode);
        if at.variant & SATURATION != 0 {
            let y = luma(&seen);
            seen = seen.map(|v| (y + p.number(UNDO) * (v - y)).clamp(0.0, 1.0));
        }
        if at.variant & CURVE != 0 {
            seen = three(|c| response::to_sensor(seen[c], c, p, 9));
        }
        seen = seen.map(srgb_decode);
    }
    if at.variant & MATRIX != 0 {
        let [r, g, b] = seen;
        seen = [0, 3, 6].map(|i| p.number(i) * r + p.number(i + 1) * g + p.number(i + 2) * b);
    }
    seen.map(|v| v.max(0.0))
}

impl Effect for SensorColor {
    fn id(&self) -> &'static str {
        ID
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::LinearRgb, Domain::LinearRgb)
    }

    fn check(&self, settings: &Settings, _frame_period_s: f64) -> Result<Vec<String>> {
        if settings.choice(ID, "match") != Some(DELIVERED) {
            return Ok(Vec::new());
        }
        if inverse(settings).is_none() {
            let what =
                "color_matrix and white_balance have no inverse: match = \"delivered\" cannot be".to_owned();
            return Err(Error::Contradiction { effect: ID, what });
        }
        if Saturation::factor(settings) == 0.0 {
            let what = "saturation.factor = 0 has no inverse: match = \"delivered\" cannot be".to_owned();
            return Err(Error::Contradiction { effect: ID, what });
        }
        let idle = self.variant(settings) == 0;
        let said = "sensor_color.match = \"delivered\" changes nothing without white_balance, color_matrix, \
            response_curve or saturation";
        Ok(idle.then(|| said.to_owned()).into_iter().collect())
    }

    fn variant(&self, settings: &Settings) -> u32 {
        if settings.choice(ID, "match") != Some(DELIVERED) {
            return 0;
        }
        let straight = inverse(settings).is_none_or(|m| m == DMat3::IDENTITY);
        let matrix = if straight { 0 } else { MATRIX };
        let curve = if response::densities(settings).is_some() { CURVE } else { 0 };
        matrix | curve | if Saturation::factor(settings) != 1.0 { SATURATION } else { 0 }
    }

    fn undiagnosed(&self) -> Option<&'static str> {
        Some("changes nothing alone: it undoes what the ISP does to colours")
    }

    fn work(&self) -> Work {
        Work::Pointwise(sensor_color)
    }

    fn pack(&self, settings: &Settings, _: &View, packer: &mut Packer<'_>) {
        let rows = inverse(settings).unwrap_or(DMat3::IDENTITY).transpose().to_cols_array();
        rows.into_iter().for_each(|v| packer.number(v));
        let straight = [[1.0; response::KNOTS]; 3];
        response::pack(&response::densities(settings).unwrap_or(straight), packer);
        packer.number(1.0 / Saturation::factor(settings));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::Value;
    use crate::effects::ColorMatrix;

    #[test]
    fn a_matrix_without_an_inverse_is_a_contradiction() {
        let mut s = Settings::default();
        s.set(&SensorColor, "match", Value::Choice(DELIVERED)).expect("an option");
        assert!(SensorColor.check(&s, 0.1).expect("allowed")[0].contains("changes nothing"));
        s.set(&ColorMatrix, "bb", Value::Number(0.0)).expect("in range");
        assert!(SensorColor.check(&s, 0.1).expect_err("singular").to_string().contains("no inverse"));
    }
}
