//! One colour a pixel, then demosaicked (docs/reference/camera.md). The filters stand before the sensor, but choosing a
//! colour commutes with everything that a sensor does to each pixel and channel, so the choice is made where the others
//! are filled in: behind noise and converter, before the white balance. Thus noise is spread over neighbours as in a
//! real camera. Digital numbers before the tone curve.
//!
//! Bilinear: means of the neighbours that have the colour. Malvar-He-Cutler: the same corrected by the Laplacian of the
//! pixel's own colour (Malvar, He, Cutler: "High-quality linear interpolation for demosaicing of Bayer-patterned color
//! images", ICASSP 2004, Fig. 2). The picture is mirrored about its outermost pixels.

use std::sync::LazyLock;

use super::gaussian;
use crate::chain::{
    Choice, Domain, Effect, Fit, Law, Moments, ParamSpec, Parameters, Pass, Settings, Spread, Stage, Work,
};
use crate::plane::Plane;

/// The effect; its values live in [`Settings`].
pub struct BayerMosaic;

pub(super) const SPECS: &[ParamSpec] = &[
    ParamSpec::choice(
        "pattern",
        &["none", "RGGB", "BGGR", "GRBG", "GBRG"],
        "colours of the upper left 2x2 pixels, row by row",
    )
    .fit(Fit::choice().trial(Law::Option, 0.25, 1.0)),
    ParamSpec::choice("demosaic", &["bilinear", "malvar_he_cutler"], "how the others are filled in")
        .beside(&["pattern"])
        .fit(Fit::choice().trial(Law::Option, -1.0, 1.0)),
];

const PATTERN: Choice = Choice::of("bayer_mosaic", SPECS, "pattern");
const DEMOSAIC: Choice = Choice::of("bayer_mosaic", SPECS, "demosaic");

/// Column and row of the red pixel in each block of 2x2; `None` without a mosaic.
fn red(settings: &Settings) -> Option<[usize; 2]> {
    match settings.chosen(PATTERN)? {
        "RGGB" => Some([0, 0]),
        "GRBG" => Some([1, 0]),
        "GBRG" => Some([0, 1]),
        "BGGR" => Some([1, 1]),
        _ => None,
    }
}

fn is_malvar(settings: &Settings) -> bool {
    settings.chosen(DEMOSAIC) == Some("malvar_he_cutler")
}

/// Channel of the filter before a pixel.
fn channel([x, y]: [usize; 2], red: [usize; 2]) -> usize {
    match ((x + red[0]) % 2, (y + red[1]) % 2) {
        (0, 0) => 0,
        (1, 1) => 2,
        _ => 1,
    }
}

/// Mirrored about the outermost pixels, which keeps the colours of the filters in place.
fn mirrored(place: i64, side: usize) -> usize {
    let last = side as i64 - 1;
    (last - (last - place.abs()).abs()).clamp(0, last) as usize
}

/// Sums over the neighbours of a pixel.
struct Neighbours {
    own: f32,
    row: f32,
    column: f32,
    diagonal: f32,
    far_row: f32,
    far_column: f32,
}

/// The other colours of a pixel, by where their filters are: beside it and above, diagonally, in its row, in its
/// column.
struct Filled {
    cross: f32,
    diagonal: f32,
    row: f32,
    column: f32,
}

fn bilinear(n: &Neighbours) -> Filled {
    Filled {
        cross: 0.25 * (n.row + n.column),
        diagonal: 0.25 * n.diagonal,
        row: 0.5 * n.row,
        column: 0.5 * n.column,
    }
}

fn malvar_he_cutler(n: &Neighbours) -> Filled {
    let far = n.far_row + n.far_column;
    Filled {
        cross: 0.125 * (4.0 * n.own + 2.0 * (n.row + n.column) - far),
        diagonal: 0.125 * (6.0 * n.own + 2.0 * n.diagonal - 1.5 * far),
        row: 0.125 * (5.0 * n.own + 4.0 * n.row - n.far_row - n.diagonal + 0.5 * n.far_column),
        column: 0.125 * (5.0 * n.own + 4.0 * n.column - n.far_column - n.diagonal + 0.5 * n.far_row),
    }
}

/// Twin of `glsl/bayer_mosaic.comp`.
fn reference(source: &Plane<f32>, settings: &Settings, _: &Parameters) -> Plane<f32> {
    let Some(red) = red(settings) else { return source.clone() };
    filled(source, red, is_malvar(settings))
}

/// Px on each side that the filters reach.
const BORDER: usize = 2;

/// What each pixel has behind its filter, with a border that is mirrored about the outermost pixels.
fn behind_filters(source: &Plane<f32>, red: [usize; 2]) -> Vec<f32> {
    let places = |side: usize| -> Vec<usize> {
        (0..side + 2 * BORDER).map(|i| mirrored(i as i64 - BORDER as i64, side)).collect()
    };
    let (columns, rows) = (places(source.width), places(source.height));
    let of = |(&y, &x): (&usize, &usize)| source.pixel(x, y)[channel([x, y], red)];
    rows.iter().flat_map(|y| columns.iter().map(move |x| (y, x))).map(of).collect()
}

fn filled(source: &Plane<f32>, red: [usize; 2], malvar: bool) -> Plane<f32> {
    let fill = if malvar { malvar_he_cutler } else { bilinear };
    let (seen, across) = (behind_filters(source, red), source.width + 2 * BORDER);
    gaussian::filter(source, |x, y| {
        let own = (y + BORDER) * across + x + BORDER;
        let at = |dx: isize, dy: isize| seen[own.wrapping_add_signed(dy * across as isize + dx)];
        let n = Neighbours {
            own: at(0, 0),
            row: at(-1, 0) + at(1, 0),
            column: at(0, -1) + at(0, 1),
            diagonal: (at(-1, -1) + at(1, -1)) + (at(-1, 1) + at(1, 1)),
            far_row: if malvar { at(-2, 0) + at(2, 0) } else { 0.0 },
            far_column: if malvar { at(0, -2) + at(0, 2) } else { 0.0 },
        };
        let f = fill(&n);
        let red_row = (y + red[1]).is_multiple_of(2);
        match channel([x, y], red) {
            0 => [n.own, f.cross, f.diagonal],
            2 => [f.diagonal, f.cross, n.own],
            _ if red_row => [f.row, n.own, f.column],
            _ => [f.column, n.own, f.row],
        }
    })
}

fn passes(settings: &Settings) -> Vec<Pass> {
    let [x, y] = red(settings).unwrap_or_default();
    let constants = [(x + 2 * y) as u32, u32::from(is_malvar(settings))];
    vec![Pass { file: "bayer_mosaic.comp", constants, run: [1, 1] }]
}

/// The same for each pattern, on average over its four pixels.
fn spread(settings: &Settings) -> &'static Spread {
    static BOTH: [LazyLock<Spread>; 2] = [
        LazyLock::new(|| Spread::behind(|source| filled(source, [0, 0], false))),
        LazyLock::new(|| Spread::behind(|source| filled(source, [0, 0], true))),
    ];
    &BOTH[usize::from(is_malvar(settings))]
}

impl BayerMosaic {
    /// What each pixel has behind its filter, shape `[height, width, 1]`, of what the converter delivers of all
    /// colours; `None` without a mosaic.
    pub fn raw(settings: &Settings, converted: &Plane<f32>) -> Option<Plane<f32>> {
        let red = red(settings)?;
        let own = |x: usize, y: usize| [converted.pixel(x, y)[channel([x, y], red)]];
        Some(Plane::from_fn(converted.width, converted.height, own))
    }

    /// Whether there is a mosaic.
    pub fn is_there(settings: &Settings) -> bool {
        red(settings).is_some()
    }
}

impl Effect for BayerMosaic {
    fn id(&self) -> &'static str {
        "bayer_mosaic"
    }

    fn specs(&self) -> &'static [ParamSpec] {
        SPECS
    }

    fn stage(&self) -> Stage {
        Stage::Pixel(Domain::RawDn, Domain::RawDn)
    }

    fn variant(&self, settings: &Settings) -> u32 {
        u32::from(red(settings).is_some())
    }

    fn fills_mosaic(&self) -> bool {
        true
    }

    fn moments(&self) -> Moments {
        Moments::Mosaic(spread)
    }

    fn work(&self) -> Work {
        Work::Neighbourhood { passes, reference }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Intrinsics, ScanOrder, ShutterTiming};
    use crate::chain::{Packed, Value, View};

    fn demosaicked(source: &Plane<f32>, pattern: &'static str, demosaic: &'static str) -> Plane<f32> {
        let mut settings = Settings::default();
        settings.set(&BayerMosaic, "pattern", Value::Choice(pattern)).expect("known");
        settings.set(&BayerMosaic, "demosaic", Value::Choice(demosaic)).expect("known");
        let view = View {
            intrinsics: Intrinsics { width: 8, height: 8, fx: 8.0, fy: 8.0, cx: 4.0, cy: 4.0 },
            shutter: ShutterTiming {
                start_s: 0.0,
                exposure_time_s: 0.0,
                readout_time_s: 0.0,
                scan_order: ScanOrder::default(),
                line_count: 8,
            },
            frame: 0,
            seed: 0,
        };
        let packed = Packed::new(&[], &settings, &view);
        reference(source, &settings, &packed.parameters(0))
    }

    /// Inside the picture both are exact on planes; each pixel keeps its own colour; the pattern says which.
    #[test]
    fn slopes_are_filled_in_exactly_and_own_colours_kept() {
        let source = Plane::from_fn(12, 10, |x, y| {
            let v = 0.02 * x as f32 + 0.03 * y as f32;
            [v, v + 0.25, v + 0.5, 1.0]
        });
        for (pattern, first) in [("RGGB", 0), ("BGGR", 2), ("GRBG", 1), ("GBRG", 1)] {
            for demosaic in ["bilinear", "malvar_he_cutler"] {
                let seen = demosaicked(&source, pattern, demosaic);
                assert_eq!(seen.pixel(0, 0)[first], source.pixel(0, 0)[first], "{pattern}");
                for (x, y) in (2..8).flat_map(|y| (2..10).map(move |x| (x, y))) {
                    for c in 0..3 {
                        let (got, want) = (seen.pixel(x, y)[c], source.pixel(x, y)[c]);
                        assert!(
                            (got - want).abs() < 1e-5,
                            "{pattern} {demosaic} ({x}, {y}) {c}: {got} {want}"
                        );
                    }
                }
            }
        }
        // Control: the second red of the first row of GRBG stands at x = 1, so a wrong pattern keeps another colour.
        let (right, wrong) =
            (demosaicked(&source, "GRBG", "bilinear"), demosaicked(&source, "GBRG", "bilinear"));
        assert_eq!(right.pixel(1, 0)[0], source.pixel(1, 0)[0]);
        assert_ne!(wrong.pixel(1, 0)[2], wrong.pixel(1, 0)[0]);
        assert_ne!(right.data, wrong.data);
    }

    /// What the better one is for: a grey edge keeps its grey.
    #[test]
    fn malvar_colours_edges_less() {
        let source = Plane::from_fn(16, 16, |x, y| {
            let v = if x + y < 15 { 0.2 } else { 0.8 };
            [v, v, v, 1.0]
        });
        let error = |demosaic| {
            let seen = demosaicked(&source, "RGGB", demosaic);
            seen.data.iter().zip(&source.data).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>()
        };
        let (malvar, bilinear) = (error("malvar_he_cutler"), error("bilinear"));
        assert!(malvar < 0.7 * bilinear, "{malvar} {bilinear}");
    }
}
