//! Where the gap lies, in the two or three most telling sentences.

use crate::diagnose::expect::compared::Compared;
use crate::diagnose::report::{Bin, Where};
use shutterbug::plane::stats::median;

/// Most sentences.
const MOST: usize = 3;

/// A sentence, and how much it tells: a share of the gap, or a change in units of it.
type Said = Option<(f64, String)>;

/// The two or three most telling facts; `nothing`: there is no gap.
pub(crate) fn sentences(places: &Where, frames: &[Compared<'_>], nothing: bool) -> Vec<String> {
    let total: f64 = places.by_channel.iter().map(|b| b.before * b.weight).sum();
    if nothing || total <= 0.0 {
        return vec![format!("The frames differ by {total:.2} DN on average, evenly, and mostly at edges.")];
    }
    let mut said: Vec<(f64, String)> = Vec::new();
    said.extend(edges(frames, total));
    said.extend(profiles(places, total));
    said.sort_by(|a, b| b.0.total_cmp(&a.0));
    said.into_iter().take(MOST).map(|s| s.1).collect()
}

/// What the profiles tell, each on its own.
fn profiles(places: &Where, total: f64) -> Vec<(f64, String)> {
    let all = [
        trend(&places.by_row, total, "from the top row to the bottom row"),
        trend(&places.by_column, total, "from the left column to the right one"),
        trend(&places.by_radius, total, "from the middle of the picture to its corners"),
        trend(&places.by_speed, total, "from content at rest to the fastest"),
        trend(&places.by_intensity, total, "from dark to bright"),
        trend(&places.by_frame, total, "from the first frames to the last"),
        apart(&places.by_direction, total, "content that moves towards", " (degrees clockwise from right)"),
        apart(&places.by_object, total, "what the scene calls", ""),
        channels(&places.by_channel, total),
        frequency(&places.by_frequency),
        bias(&places.by_channel, total),
    ];
    all.into_iter().flatten().collect()
}

/// Share of the gap on edges, and what their speed does to it.
fn edges(frames: &[Compared<'_>], total: f64) -> Said {
    let speed = |f: &Compared<'_>, x: usize, y: usize| {
        let v = f.sharp.velocity.pixel(x, y);
        v[0].hypot(v[1])
    };
    // Edges: gap, number; those that are fast: gap, number; all.
    let (mut on, mut fast, mut all) = ([0.0f64; 2], [0.0f64; 2], [0.0f64; 2]);
    let limit = median(frames.iter().flat_map(|f| {
        let (w, h) = (f.real.width, f.real.height);
        (0..h).step_by(4).flat_map(move |y| (0..w).step_by(4).map(move |x| f64::from(speed(f, x, y))))
    }));
    let limit = (limit as f32 / 10.0).round() * 10.0;
    for f in frames {
        for y in 1..f.real.height {
            for x in 1..f.real.width {
                if f.mask.is_some_and(|m| m.pixel(x, y)[0] <= 0.5) {
                    continue;
                }
                let (here, left, above) =
                    (f.before.pixel(x, y), f.before.pixel(x - 1, y), f.before.pixel(x, y - 1));
                let edge = (0..3).any(|c| (here[c] - left[c]).abs().max((here[c] - above[c]).abs()) > 12.0);
                let gap: f64 = (0..3).map(|c| f64::from((f.real.pixel(x, y)[c] - here[c]).abs())).sum();
                let add = |sum: &mut [f64; 2]| *sum = [sum[0] + gap, sum[1] + 1.0];
                add(&mut all);
                if edge {
                    add(&mut on);
                    if speed(f, x, y) > limit {
                        add(&mut fast);
                    }
                }
            }
        }
    }
    let part = |of: [f64; 2]| [of[0] / all[0].max(1e-9), of[1] / all[1].max(1.0)];
    let ([share, area], [fast_share, fast_area]) = (part(on), part(fast));
    if share <= 2.0 * area || total <= 0.0 {
        return None;
    }
    let (slow_gap, slow_area) = (share - fast_share, area - fast_area);
    let quick = limit >= 20.0 && fast_share / fast_area.max(1e-9) > 1.5 * slow_gap / slow_area.max(1e-9);
    let text = if quick && fast_share > 0.6 * share {
        format!(
            "{:.0} % of the difference lies on edges that move faster than {limit:.0} px/s, which cover {:.0} % of the \
             picture.",
            100.0 * fast_share,
            100.0 * fast_area
        )
    } else {
        format!(
            "{:.0} % of the difference lies on edges, which cover {:.0} % of the picture.",
            100.0 * share,
            100.0 * area
        )
    };
    Some((share, text))
}

/// A profile that grows or falls along its axis, if it does so clearly.
fn trend(bins: &[Bin], total: f64, along: &str) -> Said {
    let third = bins.len() / 3;
    if third == 0 {
        return None;
    }
    let (first, last) = (mean(&bins[..third]), mean(&bins[bins.len() - third..]));
    let size = (last - first).abs() / total;
    let word = if last > first { "grows" } else { "falls" };
    (size > 0.3 && last.max(first) > 1.4 * last.min(first))
        .then(|| (size, format!("The mean absolute difference {word} {along}: {first:.1} to {last:.1} DN.")))
}

fn mean(bins: &[Bin]) -> f64 {
    let weight: f64 = bins.iter().map(|b| b.weight).sum();
    bins.iter().map(|b| b.before * b.weight).sum::<f64>() / weight.max(1e-9)
}

/// A bin that holds much more of the gap than of the picture.
fn apart(bins: &[Bin], total: f64, what: &str, more: &str) -> Said {
    let share = |b: &Bin| b.before * b.weight / total;
    let most = bins.iter().max_by(|a, b| share(a).total_cmp(&share(b)))?;
    (bins.len() > 1 && share(most) > 0.35 && share(most) > 1.6 * most.weight).then(|| {
        let text = format!(
            "{:.0} % of the difference lies on {what} {}{more}, which covers {:.0} % of the picture.",
            100.0 * share(most),
            most.label,
            100.0 * most.weight
        );
        (share(most), text)
    })
}

fn channels(bins: &[Bin], total: f64) -> Said {
    let by = |a: &&Bin, b: &&Bin| a.before.total_cmp(&b.before);
    let (least, most) = (bins.iter().min_by(by)?, bins.iter().max_by(by)?);
    (most.before > 1.4 * least.before).then(|| {
        let text = format!(
            "The difference is widest in {} ({:.1} DN) and narrowest in {} ({:.1} DN).",
            most.label, most.before, least.label, least.before
        );
        ((most.before - least.before) / total, text)
    })
}

fn frequency(bins: &[Bin]) -> Said {
    let sum: f64 = bins.iter().map(|b| b.before).sum();
    let most = bins.iter().max_by(|a, b| a.before.total_cmp(&b.before))?;
    let share = most.before / sum.max(1e-9);
    // An even spread over six bands is a sixth each.
    (share > 0.4).then(|| {
        let what = if most.to >= f64::MAX {
            "smooth: it varies over more than 16 px".to_owned()
        } else {
            format!("in {}", most.label)
        };
        (share, format!("{:.0} % of the difference is {what}.", 100.0 * share))
    })
}

fn bias(bins: &[Bin], total: f64) -> Said {
    let bias: f64 = bins.iter().map(|b| b.bias_before * b.weight).sum();
    let word = if bias > 0.0 { "brighter" } else { "darker" };
    (bias.abs() > 0.4 * total).then(|| {
        (bias.abs() / total, format!("The real frames are {word} by {:.1} DN on average.", bias.abs()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bins(values: &[f64]) -> Vec<Bin> {
        let bin = |(i, v): (usize, &f64)| Bin {
            from: i as f64,
            to: i as f64 + 1.0,
            label: format!("bin {i}"),
            before: *v,
            after: 0.0,
            bias_before: -*v,
            bias_after: 0.0,
            weight: 1.0 / values.len() as f64,
        };
        values.iter().enumerate().map(bin).collect()
    }

    #[test]
    fn each_axis_is_said_where_it_tells_and_not_where_it_is_even() {
        let (steep, even) = (bins(&[1.0, 4.0, 10.0]), bins(&[5.0, 5.0, 5.0]));
        type Axis = (fn(&mut Where) -> &mut Vec<Bin>, &'static str);
        let axes: [Axis; 10] = [
            (|w| &mut w.by_row, "bottom row"),
            (|w| &mut w.by_column, "right one"),
            (|w| &mut w.by_radius, "corners"),
            (|w| &mut w.by_speed, "fastest"),
            (|w| &mut w.by_intensity, "dark to bright"),
            (|w| &mut w.by_frame, "first frames to the last"),
            (|w| &mut w.by_direction, "moves towards bin 2"),
            (|w| &mut w.by_object, "scene calls bin 2"),
            (|w| &mut w.by_channel, "widest in bin 2 (10.0 DN)"),
            (|w| &mut w.by_frequency, "67 % of the difference is in bin 2"),
        ];
        for (axis, words) in axes {
            let mut places = Where::default();
            *axis(&mut places) = steep.clone();
            let said = profiles(&places, 5.0);
            assert!(said.iter().any(|s| s.1.contains(words)), "{words}: {said:?}");
            *axis(&mut places) = even.clone();
            let said = profiles(&places, 5.0);
            assert!(!said.iter().any(|s| s.1.contains(words)), "{words}: {said:?}");
        }
        let places = Where { by_channel: even, ..Where::default() };
        let said = sentences(&places, &[], false);
        assert_eq!(said, ["The real frames are darker by 5.0 DN on average."]);
        assert!(sentences(&places, &[], true)[0].contains("5.00 DN"));
    }
}
