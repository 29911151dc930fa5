use super::*;
use std::path::Path;

/// A slanted edge as the chain makes it: pixels are means over 8x8 points, then a Gaussian, the encoding, and an
/// unsharp mask.
fn picture(sigma: f64, mask: Option<[f64; 2]>, slant: f64) -> Plane<f32> {
    let n = 96;
    let light = Plane::from_fn(n, n, |x, y| {
        let inside = |i: usize| {
            let (sx, sy) = (
                x as f64 + (i % 16) as f64 / 16.0 + 1.0 / 32.0,
                y as f64 + (i / 16) as f64 / 16.0 + 1.0 / 32.0,
            );
            f64::from(u8::from(sx - 48.3 > slant * (sy - 48.0)))
        };
        let share = (0..256).map(inside).sum::<f64>() / 256.0;
        [(0.1 + 0.4 * share) as f32]
    });
    let blurred = if sigma > 0.0 { blur(&light, sigma) } else { light };
    let mut encoded = blurred;
    encoded.data.iter_mut().for_each(|v| *v = Encoding::Srgb.encode(*v));
    if let Some([amount, radius]) = mask {
        let soft = blur(&encoded, radius);
        encoded.data.iter_mut().zip(&soft.data).for_each(|(v, s)| *v += amount as f32 * (*v - s));
    }
    encoded
}

fn blur(plane: &Plane<f32>, sigma: f64) -> Plane<f32> {
    let reach = (4.0 * sigma).ceil() as i64;
    let weights: Vec<f64> = (-reach..=reach).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let whole: f64 = weights.iter().sum();
    let along = |p: &Plane<f32>, dx: i64, dy: i64| {
        Plane::from_fn(p.width, p.height, |x, y| {
            let at = |k: i64| {
                let u = (x as i64 + k * dx).clamp(0, p.width as i64 - 1) as usize;
                let v = (y as i64 + k * dy).clamp(0, p.height as i64 - 1) as usize;
                f64::from(p.pixel(u, v)[0])
            };
            [((-reach..=reach).zip(&weights).map(|(k, w)| w * at(k)).sum::<f64>() / whole) as f32]
        })
    };
    along(&along(plane, 1, 0), 0, 1)
}

fn edge(picture: &Plane<f32>) -> Edge {
    measure_edge(picture, [8, 8, 80, 80], Encoding::Srgb, Path::new("edge")).expect("an edge")
}

#[test]
fn blur_and_response_are_those_of_the_closed_form() {
    for (sigma, slant) in [(0.6, 0.09), (1.2, -0.15), (2.0, 0.3)] {
        let found = edge(&picture(sigma, None, slant));
        assert!(
            // The oracle's Gaussian is a sum over pixels, narrower than its name by a hundredth of a px.
            (found.defocus_sigma_px.value - sigma).abs() < 0.03 * sigma + 0.01,
            "{sigma}: {:?}",
            found.defocus_sigma_px
        );
        assert!(found.sharpening.is_none(), "{sigma}: {:?}", found.sharpening);
        // A square pixel and a Gaussian.
        for f in [0.05f64, 0.1, 0.2] {
            let should = (PI * f).sin() / (PI * f) * (-2.0 * (PI * f * sigma).powi(2)).exp();
            let is = found.mtf[(100.0 * f).round() as usize];
            assert!((is - should).abs() < 0.02, "{sigma} at {f}: {is} for {should}");
        }
        // Control: of half as much blur it would be another.
        let other = (-2.0 * (PI * 0.2 * 0.5 * sigma).powi(2)).exp() * (PI * 0.2f64).sin() / (PI * 0.2);
        assert!((found.mtf[20] - other).abs() > 0.03);
    }
}

/// One colour rises across the edge and another falls, as from yellow to blue.
#[test]
fn colours_of_an_edge_are_mixed_as_light() {
    let sigma = 1.2;
    let one = picture(sigma, None, 0.15);
    let falling = |v: f32| Encoding::Srgb.encode(0.7 - Encoding::Srgb.decode(v));
    let coloured = Plane::from_fn(one.width, one.height, |x, y| {
        let v = one.pixel(x, y)[0];
        [v, v, falling(v)]
    });
    let off = |picture: &Plane<f32>| (edge(picture).defocus_sigma_px.value - sigma).abs();
    assert!(off(&coloured) < 0.03 * sigma + 0.01, "{:?}", edge(&coloured).defocus_sigma_px);
    // Control: the mean of encoded values is another edge's.
    let mean = Plane::from_fn(one.width, one.height, |x, y| [coloured.pixel(x, y).iter().sum::<f32>() / 3.0]);
    assert!(off(&mean) > 0.05 * sigma, "{:?}", edge(&mean).defocus_sigma_px);
}

#[test]
fn sharpening_is_told_from_blur() {
    let found = edge(&picture(1.0, Some([0.8, 1.5]), 0.1));
    let [amount, radius] = found.sharpening.expect("sharpened");
    assert!((amount.value - 0.8).abs() < 0.08 && (radius.value - 1.5).abs() < 0.15, "{amount:?} {radius:?}");
    assert!((found.defocus_sigma_px.value - 1.0).abs() < 0.06, "{:?}", found.defocus_sigma_px);
}

#[test]
fn what_is_no_slanted_edge_is_refused() {
    let flat = Plane::from_fn(64, 64, |_, _| [0.5f32]);
    let said = |p: &Plane<f32>, r: Region| {
        measure_edge(p, r, Encoding::Srgb, Path::new("edge")).expect_err("refused").to_string()
    };
    assert!(said(&flat, [0, 0, 64, 64]).contains("no straight edge"));
    assert!(said(&flat, [10, 0, 64, 64]).contains("inside of the picture"));
    let upright = Plane::from_fn(64, 64, |x, _| [if x < 32 { 0.2f32 } else { 0.7 }]);
    assert!(said(&upright, [0, 0, 64, 64]).contains("0.0 degrees"));
}
