//! The figure of an edge: its profile, and the response that follows from it.

use plotters::prelude::*;

use super::chart::{Area, INK, canvas, fault};
use super::edge::Edge;
use shutterbug::error::Result;
use shutterbug::plane::Plane;

const SIZE: (u32, u32) = (1000, 420);
const FONT: &str = "sans-serif";

/// Draws it.
///
/// # Errors
/// A chart that cannot be drawn.
pub fn edge_figure(edge: &Edge) -> Result<Plane<u8>> {
    let reach = edge.profile.iter().map(|p| p[0].abs()).fold(1.0, f64::max).min(12.0);
    let profile: Vec<(f64, f64)> =
        edge.profile.iter().filter(|p| p[0].abs() <= reach).map(|p| (p[0], p[1])).collect();
    let response: Vec<(f64, f64)> = edge.mtf.iter().enumerate().map(|(i, m)| (0.01 * i as f64, *m)).collect();
    let top = response.iter().map(|p| p.1).fold(1.0, f64::max) * 1.05;
    canvas(SIZE.0, SIZE.1, |area| {
        let halves = area.split_evenly((1, 2));
        curve(
            &halves[0],
            "encoded value over distance from the edge, px",
            (-reach..reach, 0.0..1.02),
            &profile,
        )?;
        curve(&halves[1], "response (MTF) over cycles a px", (0.0..1.0, 0.0..top), &response)
    })
}

fn curve(
    area: &Area<'_>,
    title: &str,
    (x, y): (std::ops::Range<f64>, std::ops::Range<f64>),
    points: &[(f64, f64)],
) -> Result<()> {
    let mut chart = ChartBuilder::on(area)
        .caption(title, (FONT, 17))
        .margin(10)
        .x_label_area_size(34)
        .y_label_area_size(44)
        .build_cartesian_2d(x, y)
        .map_err(fault)?;
    chart.configure_mesh().light_line_style(WHITE).label_style((FONT, 13)).draw().map_err(fault)?;
    chart.draw_series(LineSeries::new(points.iter().copied(), INK[2].stroke_width(2))).map_err(fault)?;
    Ok(())
}
