//! Coordinates of charts: data to places in a box of px, with round ticks. What is drawn there is the template's
//! business.

use serde::Serialize;

/// The box of a chart's data, px; labels stand outside it.
const WIDTH: f64 = 380.0;
/// See [`WIDTH`].
const HEIGHT: f64 = 150.0;

/// A mark on an axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tick {
    /// Distance from the origin of the box, px.
    pub at: f64,
    /// What stands there.
    pub label: String,
}

/// One line of a chart.
#[derive(Clone, Debug, Serialize)]
pub struct Series {
    /// Class of the style sheet, and the key of the legend.
    pub name: &'static str,
    /// `x,y x,y ...` as SVG's `points` wants them; y runs down.
    pub points: String,
}

/// A chart, ready to be drawn.
#[derive(Clone, Debug, Serialize)]
pub struct Chart {
    /// Size of the box, px.
    pub width: f64,
    /// See `width`.
    pub height: f64,
    /// Left to right.
    pub x_ticks: Vec<Tick>,
    /// Bottom to top; `at` counts from the TOP.
    pub y_ticks: Vec<Tick>,
    /// The lines.
    pub series: Vec<Series>,
}

/// A line chart of several series over the same x, y from 0 (or the smallest value, if that is negative). Values that
/// are not finite leave a gap of no width: the line goes on from its neighbours.
pub fn line_chart(x: &[f64], series: &[(&'static str, Vec<f64>)]) -> Chart {
    let all = || series.iter().flat_map(|(_, v)| v.iter().copied()).filter(|v| v.is_finite());
    let (low, high) = (all().fold(0.0, f64::min), all().fold(0.0, f64::max));
    let y = Scale::new(low, if high > low { high } else { low + 1.0 });
    let (first, last) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    let (first, last) = if last > first { (first, last) } else { (first - 0.5, first + 0.5) };
    let x_at = |v: f64| WIDTH * (v - first) / (last - first);
    let y_at = |v: f64| HEIGHT * (1.0 - (v - y.low) / (y.high - y.low));
    let line = |(name, values): &(&'static str, Vec<f64>)| {
        let points = x.iter().zip(values).filter(|(x, v)| x.is_finite() && v.is_finite());
        let points: Vec<_> = points.map(|(x, v)| format!("{:.1},{:.1}", x_at(*x), y_at(*v))).collect();
        Series { name, points: points.join(" ") }
    };
    let x_scale = Scale::new(first, last);
    let x_ticks = x_scale.ticks().filter(|t| first <= *t && *t <= last);
    Chart {
        width: WIDTH,
        height: HEIGHT,
        x_ticks: x_ticks.map(|t| Tick { at: x_at(t), label: super::number(t) }).collect(),
        y_ticks: y.ticks().map(|t| Tick { at: y_at(t), label: super::number(t) }).collect(),
        series: series.iter().map(line).collect(),
    }
}

/// A span widened to round numbers.
struct Scale {
    low: f64,
    high: f64,
    step: f64,
}

impl Scale {
    /// About five steps of 1, 2 or 5 times a power of ten.
    fn new(low: f64, high: f64) -> Self {
        let raw = (high - low) / 5.0;
        let power = 10f64.powf(raw.log10().floor());
        let factor = [1.0, 2.0, 5.0, 10.0].into_iter().find(|f| f * power >= raw * 0.999).unwrap_or(10.0);
        let step = factor * power;
        Self { low: (low / step).floor() * step, high: (high / step).ceil() * step, step }
    }

    fn ticks(&self) -> impl Iterator<Item = f64> + '_ {
        let count = ((self.high - self.low) / self.step).round().clamp(0.0, 20.0) as usize;
        (0..=count).map(|i| self.low + i as f64 * self.step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_end_at_round_numbers_that_hold_the_data() {
        for (low, high, ticks) in [
            (0.0, 7.1, vec![0.0, 2.0, 4.0, 6.0, 8.0]),
            (0.0, 0.041, vec![0.0, 0.01, 0.02, 0.03, 0.04, 0.05]),
            (-3.0, 3.0, vec![-4.0, -2.0, 0.0, 2.0, 4.0]),
        ] {
            let got: Vec<_> = Scale::new(low, high).ticks().collect();
            assert_eq!(got.len(), ticks.len(), "{got:?}");
            assert!(got.iter().zip(&ticks).all(|(a, b)| (a - b).abs() < 1e-12), "{got:?}");
        }
    }

    #[test]
    fn the_largest_value_is_inside_and_nan_draws_nothing() {
        let chart = line_chart(&[0.0, 1.0, 2.0], &[("before", vec![1.0, f64::NAN, 10.0])]);
        assert_eq!(chart.series[0].points, "0.0,135.0 380.0,0.0");
        // One point, or none, or only zeros: no division by zero.
        for values in [vec![], vec![0.0], vec![f64::NAN]] {
            let x: Vec<f64> = (0..values.len()).map(|i| i as f64).collect();
            let chart = line_chart(&x, &[("before", values)]);
            let text = serde_json::to_string(&chart).expect("plain data");
            assert!(!text.contains("null") && !text.contains("NaN"), "{text}");
        }
    }
}
