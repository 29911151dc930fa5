//! `curves.png` and `curves.html`: detection over strength, a panel an effect.

use std::path::Path;

use minijinja::context;
use plotters::prelude::*;

use super::curve_result::{Curve, CurveResult};
use crate::calibrate::chart::{canvas, fault, label};
use crate::report::{PictureBudget, data_uri, environment};
use shutterbug::error::Result;
use shutterbug::plane::{Plane, write_atomic};

/// Size of a panel, px, and panels side by side.
const PANEL: [u32; 2] = [330, 210];
const COLUMNS: usize = 3;
const LINE: RGBColor = RGBColor(11, 95, 180);

/// The chart: the share that was detected over the strength (logarithmic), with Wilson's intervals.
///
/// # Errors
/// A chart that cannot be drawn.
pub(super) fn chart(curves: &[Curve]) -> Result<Plane<u8>> {
    let columns = curves.len().clamp(1, COLUMNS);
    let rows = curves.len().max(1).div_ceil(columns);
    canvas(PANEL[0] * columns as u32, PANEL[1] * rows as u32, |area| {
        for (curve, panel) in curves.iter().zip(area.split_evenly((rows, columns))) {
            draw(curve, &panel)?;
        }
        Ok(())
    })
}

fn draw(curve: &Curve, area: &DrawingArea<BitMapBackend<'_>, plotters::coord::Shift>) -> Result<()> {
    let strengths = || curve.points.iter().map(|p| p.strength);
    let (from, to) = (strengths().fold(f64::INFINITY, f64::min), strengths().fold(0.0, f64::max));
    let (from, to) = (from * 0.8, to * 1.25);
    label(area, &curve.effect, (46, 4), 15)?;
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_top(24)
        .x_label_area_size(34)
        .y_label_area_size(38)
        .build_cartesian_2d((from..to).log_scale(), 0.0..1.02)
        .map_err(fault)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_labels(4)
        .y_labels(5)
        .x_desc(curve.measure.as_str())
        .y_desc("detected")
        .x_label_formatter(&|v| crate::report::number(*v))
        .label_style(("sans-serif", 12))
        .draw()
        .map_err(fault)?;
    let at = curve.points.iter().map(|p| (p.strength, p.rate));
    chart.draw_series(LineSeries::new(at.clone(), LINE.stroke_width(2))).map_err(fault)?;
    let bars = curve.points.iter().map(|p| {
        PathElement::new(vec![(p.strength, p.rate_ci95[0]), (p.strength, p.rate_ci95[1])], LINE.mix(0.45))
    });
    chart.draw_series(bars).map_err(fault)?;
    chart.draw_series(at.map(|p| Circle::new(p, 3, LINE.filled()))).map_err(fault)?;
    Ok(())
}

/// Writes the page; `curves.png` lies in the folder.
///
/// # Errors
/// A picture that cannot be read, a page that cannot be written.
pub(super) fn write(result: &CurveResult, out: &Path) -> Result<()> {
    let picture = data_uri(out, "curves.png", PictureBudget::for_total(0))?;
    let mut environment = environment();
    environment.add_template("curves.html", include_str!("curves.html")).expect("a constant template");
    let template = environment.get_template("curves.html").expect("just added");
    let data = minijinja::Value::from(minijinja::value::Serde(result));
    let html = template
        .render(context! { result => data, picture })
        .expect("the template fits its data: see the tests");
    write_atomic(&out.join("curves.html"), html.as_bytes())
}
