//! How noise lies in the coefficients of a block: evenly if it is white, else as what mixes pixels ahead of the file
//! makes it. A noise reduction leaves little in high frequencies, where steps are wide, and what it leaves in low ones
//! survives.

use std::sync::LazyLock;

use super::dct::{AREA, Dct, SIDE, TO_YCC};
use crate::chain::{Mixed, Settings};
use crate::effects::LIST;

/// Variances of brightness and two colours.
#[derive(Clone, Debug, PartialEq)]
pub struct Grain {
    /// Of each coefficient, over what as much noise in each colour would give it if it were white.
    own: [[f32; AREA]; 3],
    /// Of the coefficients of rows, of the noise of rows.
    rows: [[f32; SIDE]; 3],
    /// What two of them have in common in a pixel, over that.
    common: [[f32; 3]; 3],
}

static WHITE: LazyLock<Grain> =
    LazyLock::new(|| Grain { own: [[1.0; AREA]; 3], rows: [[1.0; SIDE]; 3], common: [[1.0; 3]; 3] });

impl Grain {
    /// Of white noise.
    pub fn white() -> &'static Self {
        &WHITE
    }

    /// Of noise behind the mosaic, the filters and the shared colour of a camera.
    pub fn of(settings: &Settings) -> Self {
        let mixed = Mixed::of(LIST, settings);
        if mixed.is_none() {
            return WHITE.clone();
        }
        let mixing = mixed.mixing();
        let waves = Dct::new().waves.map(|wave| wave.map(f64::from));
        let to_ycc = TO_YCC.map(|row| row.map(f64::from));
        // What the variance of a pixel's colours says of brightness and colours if they are independent.
        let told = |k: usize, l: usize| -> f64 {
            (0..3).map(|c| to_ycc[k][c] * to_ycc[l][c] * f64::from(mixing.pixel[c])).sum()
        };
        let over = |seen: f64, told: f64| if told.abs() > LEAST { (seen / told) as f32 } else { 1.0 };
        let rows_told = |k: usize| {
            let sum: f64 = (0..3).map(|c| to_ycc[k][c] * f64::from(mixing.row[c]).sqrt()).sum();
            SIDE as f64 * sum * sum
        };
        Self {
            own: std::array::from_fn(|k| {
                let seen = mixed.spectrum(&to_ycc[k], &waves);
                std::array::from_fn(|i| over(seen[i], told(k, k)))
            }),
            rows: std::array::from_fn(|k| {
                mixed.row_spectrum(&to_ycc[k], &waves).map(|seen| over(seen, rows_told(k)))
            }),
            common: std::array::from_fn(|k| {
                std::array::from_fn(|l| over(mixed.common(&to_ycc[k], &to_ycc[l]), told(k, l)))
            }),
        }
    }

    /// Variance of a coefficient of brightness (0) or a colour, over that of white noise.
    pub fn own(&self, component: usize, coefficient: usize) -> f32 {
        self.own[component][coefficient]
    }

    /// The same of the noise of rows, of a coefficient of rows.
    pub fn rows(&self, component: usize, coefficient: usize) -> f32 {
        self.rows[component][coefficient / SIDE]
    }

    /// What two components have in common, over what independent colours would.
    pub fn common(&self, [one, other]: [usize; 2]) -> f32 {
        self.common[one][other]
    }
}

/// Variance of which a share says nothing: brightness and colours have that little in common.
const LEAST: f64 = 1e-3;
