//! Noise that simulated frames have themselves. What is named is that of the differences, and so of both sides: what
//! one pixel of a simulated frame is above its neighbours by noise, the difference to the real frame is below them.

use crate::diagnose::evidence::Evidence;
use crate::diagnose::evidence::quality::Quality;
use crate::diagnose::judge::noise::NOISES;
use crate::diagnose::search::Search;
use crate::diagnose::search::found::Found;
use shutterbug::error::Result;
use shutterbug::plane::Plane;
use shutterbug::plane::stats::median;

/// Frames that are looked at.
const MOST_FRAMES: usize = 6;
/// From this share of the variance on, what is named is 15 % too strong: more than its interval tells. What a warp or a
/// lens leaves of texture looks like a smaller share (0.12 in a picture of 160x120 px that was off by 16 DN).
const SHARE: f64 = 0.25;
/// From this share on the real frames have hardly any noise, less than a third of the simulated ones': no camera's.
const HARDLY_ANY: f64 = 0.9;
/// Side of the places of which the quieter half is looked at, px.
const PLACE_PX: usize = 8;

/// Says so where noise is named, and the simulated frames have more than a little of it.
///
/// # Errors
/// No time is left.
pub(crate) fn of_simulation(
    search: &mut Search<'_>,
    found: &Found,
    evidence: &Evidence,
) -> Result<Option<String>> {
    if !found.set.iter().any(|name| NOISES.contains(name)) {
        return Ok(None);
    }
    let frames: Vec<usize> = evidence.report.iter().copied().take(MOST_FRAMES).collect();
    let simulated = search.forward.pictures(&frames, &found.fit.theta, Quality::Fit)?;
    let pairs: Vec<_> =
        frames.iter().zip(&simulated).map(|(at, s)| (&*evidence.frames[*at].dn, &**s)).collect();
    let share = of_both(&pairs);
    tracing::debug!("share of the differences' variance that the simulated frames' noise makes: {share:.3}");
    Ok((share > SHARE).then(|| said(share)))
}

fn said(share: f64) -> String {
    if share > HARDLY_ANY {
        return "the noise that is named is that of the simulated frames: the real ones have hardly any. Are --sim and \
                --real exchanged?"
            .to_owned();
    }
    format!(
        "the simulated frames have noise of their own, {:.0} % of the variance by which they differ from the real \
         ones in quiet places: the noise that is named is that of both sides together. Switch the simulation's noise \
         off, or compare with --unpaired",
        100.0 * share
    )
}

/// Share of the variance of differences (real less simulated) that the simulated frame has the opposite of.
fn of_both(pairs: &[(&Plane<f32>, &Plane<f32>)]) -> f64 {
    let (mut common, mut all) = (0.0, 0.0);
    for (real, simulated) in pairs {
        let places: Vec<[f64; 3]> = sums(real, simulated);
        let quiet = median(places.iter().map(|p| p[0]));
        for p in places.iter().filter(|p| p[0] <= quiet) {
            common -= p[1];
            all += p[2];
        }
    }
    if all > 0.0 { common / all } else { 0.0 }
}

/// By place: sums over its pixels of the square of what the simulated frame is above its neighbours in a row, of that
/// times the same of the difference, and of the square of the latter.
fn sums(real: &Plane<f32>, simulated: &Plane<f32>) -> Vec<[f64; 3]> {
    let (across, down) = (real.width / PLACE_PX, real.height / PLACE_PX);
    let mut out = vec![[0.0; 3]; across * down];
    for (x, y) in
        (0..down * PLACE_PX).flat_map(|y| (1..(across * PLACE_PX).saturating_sub(1)).map(move |x| (x, y)))
    {
        let green = |plane: &Plane<f32>, x: usize| f64::from(plane.data[3 * (y * plane.width + x) + 1]);
        let above = |plane: &Plane<f32>| green(plane, x) - 0.5 * (green(plane, x - 1) + green(plane, x + 1));
        let s = above(simulated);
        let d = above(real) - s;
        let place = &mut out[y / PLACE_PX * across + x / PLACE_PX];
        for (to, v) in place.iter_mut().zip([s * s, s * d, d * d]) {
            *to += v;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use shutterbug::chain::rng::random_normal;

    #[test]
    fn noise_of_a_simulation_is_told_from_its_texture() {
        let frame = |seed: u32, sigma: f32| {
            Plane::from_fn(160, 120, |x, y| {
                let texture =
                    20.0 * (0.9 * x as f32).sin() * f32::from(u8::from(y < 60)) + 3.0 * (x % 3) as f32;
                let noise = random_normal([x as u32, y as u32], 0, seed, [1, 2]);
                [0, 1, 2].map(|c| (120.0 + texture + sigma * noise[c]).round())
            })
        };
        let share = |sim: f32, real: f32| of_both(&[(&frame(1, real), &frame(2, sim))]);
        assert!((share(2.0, 2.0) - 0.5).abs() < 0.05, "{}", share(2.0, 2.0));
        assert!((share(2.0, 4.0) - 0.2).abs() < 0.05, "{}", share(2.0, 4.0));
        assert!(said(share(2.0, 0.0)).ends_with("exchanged?"), "{}", share(2.0, 0.0));
        assert!(!said(share(2.0, 1.0)).ends_with("exchanged?"), "control: {}", share(2.0, 1.0));
        assert!(share(0.0, 2.0).abs() < 0.05, "control: {}", share(0.0, 2.0));
    }
}
