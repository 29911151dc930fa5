//! The light of photographs that were taken one by one: a board held at another angle to the lamps is brighter or
//! darker, and no parameter of a camera stands for that.

use rayon::prelude::*;

use super::forward::Forward;
use super::model::Theta;
use crate::diagnose::evidence::Evidence;
use crate::diagnose::evidence::quality::Quality;
use shutterbug::error::Result;
use shutterbug::plane::{Plane, srgb_decode};

/// Standard deviation of the logarithm below which frames count as lit alike.
const LEAST_SPREAD: f64 = 0.02;

/// Light of each frame (by place) over that of the middle one, from the mean linear radiance of what is compared; all 1
/// where frames are lit alike.
///
/// # Errors
/// Those of renders.
pub(crate) fn lights(
    forward: &mut Forward,
    evidence: &Evidence,
    theta: &Theta,
    masks: Option<&[Plane<f32>]>,
) -> Result<Vec<f64>> {
    let all: Vec<usize> = (0..evidence.frames.len()).collect();
    let simulated = forward.simulate(&all, theta, Quality::Fit)?;
    let ratios = all.par_iter().map(|&at| {
        let open = |i: usize| masks.is_none_or(|m| m[at].data[i / 3] > 0.5);
        let mean = |dn: &Plane<f32>| {
            let values = dn.data.iter().enumerate().filter(|(i, _)| open(*i));
            values.map(|(_, v)| f64::from(srgb_decode(v / 255.0))).sum::<f64>()
        };
        forward.light[at] * mean(&evidence.frames[at].dn).max(1e-6) / mean(&simulated[at]).max(1e-6)
    });
    Ok(over_the_middle(ratios.collect()))
}

fn over_the_middle(ratios: Vec<f64>) -> Vec<f64> {
    let n = ratios.len() as f64;
    let mut sorted = ratios.clone();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted[sorted.len() / 2];
    let logs: Vec<f64> = ratios.iter().map(|r| (r / middle).ln()).collect();
    let mean = logs.iter().sum::<f64>() / n;
    let spread = (logs.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / n).sqrt();
    if spread < LEAST_SPREAD { vec![1.0; ratios.len()] } else { logs.into_iter().map(f64::exp).collect() }
}

/// What is said of it.
pub(crate) fn said(light: &[f64]) -> Option<String> {
    let (least, most) = light.iter().fold((f64::INFINITY, 0.0f64), |(a, b), l| (a.min(*l), b.max(*l)));
    (most > least).then(|| {
        format!(
            "the light differs from photograph to photograph ({least:.2} to {most:.2} of the middle one): frames are \
             compared at equal light, which `simulate` does not make"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_light_is_one_and_unequal_light_is_told() {
        assert_eq!(over_the_middle(vec![0.5, 0.505, 0.495]), vec![1.0; 3]);
        let told = over_the_middle(vec![0.4, 0.5, 0.6]);
        assert!((told[0] - 0.8).abs() < 1e-12 && told[1] == 1.0 && (told[2] - 1.2).abs() < 1e-12, "{told:?}");
        assert!(said(&told).is_some() && said(&[1.0, 1.0]).is_none());
    }
}
