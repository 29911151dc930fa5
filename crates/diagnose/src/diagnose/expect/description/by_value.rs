//! Whether factors of surfaces are those that a change of values would ask for.
//!
//! A tone curve and a mix of colours give materials of one colour one factor, and materials of like colours like ones.
//! Paint and lamps do not. So the factors of each material are predicted from those of all others, by a smooth function
//! of their colours.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::rays::material_of;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::expect::forward::Forward;
use crate::diagnose::expect::model::Theta;
use shutterbug::error::Result;
use shutterbug::plane::stats::luma;

/// Values are encoded as a power of the radiance, as nearly all cameras do: a gain is then a multiple of them.
const POWER: f64 = 2.4;
/// Columns of a change that say nothing: each channel's value, for a gain is no sign of either.
const GAINS: Range<usize> = 0..3;
/// Columns of a mix of colours: how far a value is from gray, or the other two channels of each.
const TO_GRAY: usize = GAINS.end;
const MIXED: Range<usize> = TO_GRAY + 1..TO_GRAY + 7;
/// Degrees of a curve of all channels, whose columns begin with its constant and go on with its squares.
const DEGREES: [usize; 3] = [2, 3, 4];
const CURVE: usize = MIXED.end;
/// Columns of a mix of the light of channels, as a matrix of colours ahead of the encoding makes it.
const LIGHT: Range<usize> = CURVE + DEGREES[2]..CURVE + DEGREES[2] + 6;
const COLUMNS: usize = LIGHT.end;
/// Least value whose slope is looked at: a little light changes what is darker by any factor.
const DARK: f64 = 0.1;

/// Share of what factors do that is most of it.
pub(crate) const MOST: f64 = 0.5;
/// Part of a column's own sum that is added to it, so that columns that are alike in all materials have a solution.
const RIDGE: f64 = 1e-6;

/// What is known of a place of a material.
struct Place {
    material: u32,
    /// How many pixels it stands for.
    count: f64,
    /// As described, encoded, 0 to 1.
    value: [f64; 3],
    /// What the factor adds to that.
    change: [f64; 3],
}

impl Place {
    /// `log`: the logarithm of the factor on the radiance.
    fn new(material: u32, count: f64, value: [f64; 3], log: [f64; 3]) -> Self {
        let change = std::array::from_fn(|c| value[c] * ((log[c] / POWER).exp() - 1.0));
        Self { material, count, value, change }
    }
}

/// Normal equations of a material.
#[derive(Clone)]
struct Sums {
    a: DMatrix<f64>,
    b: DVector<f64>,
    squares: f64,
}

impl Sums {
    fn none() -> Self {
        Self { a: DMatrix::zeros(COLUMNS, COLUMNS), b: DVector::zeros(COLUMNS), squares: 0.0 }
    }

    fn add(&mut self, place: &Place) {
        for (row, change) in rows(place.value).iter().zip(place.change) {
            self.a.ger(place.count, row, row, 1.0);
            self.b.axpy(place.count * change, row, 1.0);
            self.squares += place.count * change * change;
        }
    }

    fn put(&mut self, other: &Self, sign: f64) {
        self.a += &other.a * sign;
        self.b += &other.b * sign;
        self.squares += other.squares * sign;
    }

    /// What a function of some columns, fitted to these, leaves of another material; nothing where there is none.
    fn left_of(&self, other: &Self, columns: &[usize]) -> Option<f64> {
        let n = columns.len();
        let part = |of: &Self| {
            let a = DMatrix::from_fn(n, n, |i, k| of.a[(columns[i], columns[k])]);
            (a, DVector::from_fn(n, |i, _| of.b[columns[i]]))
        };
        let ((mut a, b), (other_a, other_b)) = (part(self), part(other));
        (0..n).for_each(|i| a[(i, i)] += RIDGE * a[(i, i)] + f64::MIN_POSITIVE);
        let function = a.cholesky()?.solve(&b);
        Some((other.squares - 2.0 * other_b.dot(&function) + (other_a * &function).dot(&function)).max(0.0))
    }
}

/// The columns of a change of each channel's value.
fn rows(value: [f64; 3]) -> [DVector<f64>; 3] {
    let gray = luma(&value.map(|v| v as f32));
    std::array::from_fn(|c| {
        let mut row = DVector::zeros(COLUMNS);
        row[c] = value[c];
        row[TO_GRAY] = value[c] - f64::from(gray);
        let slope = value[c].max(DARK).powf(1.0 - POWER);
        for k in [1, 2] {
            let (column, other) = (2 * c + k - 1, value[(c + k) % 3]);
            row[MIXED.start + column] = other;
            row[LIGHT.start + column] = slope * other.powf(POWER);
        }
        row[CURVE] = 1.0;
        DEGREES.into_iter().for_each(|d| row[CURVE + d - 1] = value[c].powi(d as i32));
        row
    })
}

/// The functions that are tried, by their columns: gains and a curve, with either mix of colours; and a mix of light.
fn functions() -> impl Iterator<Item = Vec<usize>> {
    let curve = |degree: usize| CURVE..CURVE + degree;
    let to_gray = move |degree| GAINS.chain([TO_GRAY]).chain(curve(degree)).collect();
    let to_gray = DEGREES.into_iter().map(to_gray);
    let mixed = GAINS.chain(MIXED).chain(curve(DEGREES[0]));
    to_gray.chain([mixed.collect(), GAINS.chain(LIGHT).collect()])
}

/// What factors of surfaces look like.
///
/// Of 60 rooms of twelve (24) materials drawn at random, saturations of 0.7 and 1.55, a contrast, what a gamma leaves
/// of one, a mix of channels, and a matrix of light (Display P3 taken for sRGB) were told in 60 (60) each; paint by
/// 10 % was taken for one of them in none, with a share of 0.45 (0.20) at most.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum ByValue {
    /// There are none, or too few materials to tell.
    #[default]
    Untold,
    /// A change of values would ask for most of them.
    Most,
    /// It would not.
    NotMost,
}

impl From<Option<f64>> for ByValue {
    fn from(share: Option<f64>) -> Self {
        match share {
            None => Self::Untold,
            Some(share) if share > MOST => Self::Most,
            Some(_) => Self::NotMost,
        }
    }
}

/// The share of the squares of what factors change that a function of values predicts of materials that it has not
/// seen, of the function that predicts most; nothing where there are too few materials to tell.
fn share_by_value(places: impl Iterator<Item = Place>) -> Option<f64> {
    let mut materials: BTreeMap<u32, Sums> = BTreeMap::new();
    places.for_each(|p| materials.entry(p.material).or_insert_with(Sums::none).add(&p));
    let mut all = Sums::none();
    materials.values().for_each(|m| all.put(m, 1.0));
    let apart = |material: &Sums| {
        let mut others = all.clone();
        others.put(material, -1.0);
        others
    };
    let apart: Vec<(Sums, &Sums)> = materials.values().map(|m| (apart(m), m)).collect();
    let left =
        |columns: &[usize]| apart.iter().map(|(others, m)| others.left_of(m, columns)).sum::<Option<f64>>();
    let gains = left(&[0, 1, 2]).filter(|v| *v > 1e-9 * all.squares)?;
    let told = functions().filter(|columns| materials.len() > columns.len() - GAINS.len());
    told.filter_map(|columns| Some(1.0 - left(&columns)? / gains)).max_by(f64::total_cmp)
}

/// Means over the places of a cell: texture is finer than a factor.
#[derive(Default)]
struct Cell {
    value: [f64; 3],
    log: [f64; 3],
    count: f64,
}

impl Forward {
    /// What the factors of surfaces that frames (by place) see look like.
    ///
    /// # Errors
    /// Those of renders.
    pub(crate) fn by_value(&mut self, frames: &[usize], theta: &Theta) -> Result<ByValue> {
        let theta = self.settled(frames, theta)?.into_owned();
        let map = self.map_of(&theta, Quality::Fit)?;
        let bare = self.bare_radiance(frames, &theta, Quality::Fit)?;
        let mut cells: BTreeMap<u32, Cell> = BTreeMap::new();
        for (&at, plane) in frames.iter().zip(&bare) {
            let surface = self.surface(at, &theta);
            let grid = &self.description.grid;
            for (i, log) in map.seen_in(grid, &surface).filter(|(i, _)| surface.clean[*i]) {
                let sum = cells.entry(surface.cell[i]).or_default();
                for c in 0..3 {
                    sum.value[c] += f64::from(plane.data[3 * i + c].clamp(0.0, 1.0)).powf(1.0 / POWER);
                    sum.log[c] += f64::from(log[c]);
                }
                sum.count += 1.0;
            }
        }
        let grid = &self.description.grid;
        let place = |(cell, sum): (&u32, &Cell)| {
            let corner = grid.of_cell[*cell as usize][0];
            let surface = grid.surface.get(grid.group[corner as usize] as usize).copied().unwrap_or(0);
            let mean = |v: [f64; 3]| v.map(|v| v / sum.count);
            Place::new(material_of(&self.scene, surface), sum.count, mean(sum.value), mean(sum.log))
        };
        let share = share_by_value(cells.iter().map(place));
        tracing::info!("share of the factors that a change of values would ask for: {share:?}");
        Ok(share.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A number of its own for each argument, evenly spread from -1 to 1.
    fn dice(seed: u32, i: u32) -> f64 {
        let mut x = seed.wrapping_mul(0x9E37_79B9) ^ i.wrapping_mul(0x85EB_CA6B) ^ 0x68E3_1DA4;
        for _ in 0..3 {
            x ^= x >> 15;
            x = x.wrapping_mul(0x2C1B_3C6D);
            x ^= x >> 12;
        }
        f64::from(x) / f64::from(u32::MAX) * 2.0 - 1.0
    }

    /// A room of so many materials, ten places each, with factors by colour, material and place.
    fn share(seed: u32, materials: u32, log: &dyn Fn([f64; 3], u32, u32) -> [f64; 3]) -> Option<f64> {
        share_by_value((0..10 * materials).map(|i| {
            let (material, at) = (i % materials, i / materials);
            let value = [0, 1, 2].map(|c| 0.5 + 0.4 * dice(seed, 1000 + 3 * material + c));
            Place::new(material, 1.0, value, log(value, material, at))
        }))
    }

    /// Logarithm of what a change of an encoded value does to the radiance.
    fn ratio(before: f64, after: f64) -> f64 {
        2.4 * (after / before).ln()
    }

    #[test]
    fn changes_of_values_are_told_from_paint_and_lamps() {
        for seed in 0..40 {
            let contrast =
                |v: [f64; 3], _, _| v.map(|v| ratio(v, v - 0.06 * (v * std::f64::consts::TAU).sin()));
            let washed_out = |v: [f64; 3], _, _| {
                let gray = v.iter().sum::<f64>() / 3.0;
                v.map(|v| ratio(v, gray + 0.7 * (v - gray)))
            };
            // What a gamma leaves of a contrast: no slope any more.
            let rest = |v: [f64; 3], _, _| v.map(|v| 0.1 * (3.0 * std::f64::consts::PI * v).cos());
            let paint = |_: [f64; 3], m: u32, _| {
                [0, 1, 2].map(|c| 0.1 * dice(seed, m) + 0.03 * dice(seed, 100 + 3 * m + c))
            };
            let lamp = |_: [f64; 3], m: u32, at: u32| [0.4 * dice(seed, 500 + 10 * m + at); 3];
            // Values that leave the range are cut off.
            let vivid = |v: [f64; 3], _, _| {
                let gray = v.iter().sum::<f64>() / 3.0;
                v.map(|v| ratio(v, (gray + 1.55 * (v - gray)).clamp(0.02, 1.0)))
            };
            // Display P3 taken for sRGB.
            let matrix = [[0.8225, 0.1774, 0.0], [0.0332, 0.9669, 0.0], [0.0171, 0.0724, 0.9108]];
            let of_light = |v: [f64; 3], _, _| {
                let light = v.map(|v| v.powf(POWER));
                let mixed = |row: &[f64; 3]| (0..3).map(|k| row[k] * light[k]).sum::<f64>();
                [0, 1, 2].map(|c| (mixed(&matrix[c]) / light[c]).ln())
            };
            for change in [&contrast as &dyn Fn(_, _, _) -> _, &washed_out, &vivid, &rest, &of_light] {
                let told = share(seed, 40, change).expect("many materials");
                assert!(told > 0.5, "{seed}: {told}");
            }
            for room in [&paint as &dyn Fn(_, _, _) -> _, &lamp] {
                let told = share(seed, 40, room).expect("many materials");
                assert!(told < 0.5, "control {seed}: {told}");
            }
        }
    }

    #[test]
    fn a_gain_and_few_materials_tell_nothing() {
        assert_eq!(share(1, 12, &|_, _, _| [0.3, 0.2, 0.1]), None);
        assert_eq!(share(1, 3, &|v, _, _| v), None);
    }
}
