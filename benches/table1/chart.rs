//! Table 1 as a picture: time over the number of samples, both logarithmic, a line a method and size.

use std::error::Error;

use plotters::prelude::*;
use plotters::style::register_font;
use shutterbug::plane::Plane;

use super::cells::{METHODS, SAMPLES, SIZES};
use super::report::{PAPER, Table};

const SIZE: (u32, u32) = (900, 520);
const INK: [RGBColor; 3] = [RGBColor(205, 30, 30), RGBColor(30, 60, 210), RGBColor(10, 130, 40)];

/// Draws the chart.
pub fn draw(table: &Table) -> Result<Plane<u8>, Box<dyn Error>> {
    register_font("sans-serif", FontStyle::Normal, epaint_default_fonts::HACK_REGULAR)
        .map_err(|_| "the font")?;
    let mut data = vec![255u8; (SIZE.0 * SIZE.1 * 3) as usize];
    {
        let area = BitMapBackend::with_buffer(&mut data, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let title =
            format!("Table 1 on {} ({})", table.device, if table.software { "CPU time" } else { "GPU time" });
        let (low, high) = span(table);
        let mut chart = ChartBuilder::on(&area)
            .caption(title, ("sans-serif", 16))
            .margin(12)
            .x_label_area_size(36)
            .y_label_area_size(60)
            .build_cartesian_2d((0.9f64..300.0).log_scale(), (low..high).log_scale())?;
        chart.configure_mesh().x_desc("samples (logarithmic)").y_desc("ms a frame (logarithmic)").draw()?;
        for (m, method) in METHODS.into_iter().enumerate() {
            for (s, size) in SIZES.into_iter().enumerate() {
                let points: Vec<(f64, f64)> = table
                    .cells
                    .iter()
                    .filter(|c| c.method == method && [c.width, c.height] == size)
                    .map(|c| (f64::from(c.samples), c.ms_median))
                    .collect();
                let style = ShapeStyle {
                    color: INK[m].mix(0.45 + 0.25 * s as f64),
                    filled: true,
                    stroke_width: 1 + s as u32,
                };
                chart
                    .draw_series(LineSeries::new(points.clone(), style).point_size(3))?
                    .label(format!("{method} {}x{}", size[0], size[1]))
                    .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
            }
            let paper = SAMPLES.iter().zip(PAPER[m]).filter_map(|(s, p)| Some((f64::from(*s), p?)));
            chart
                .draw_series(paper.map(|at| Cross::new(at, 6, INK[m].stroke_width(2))))?
                .label(format!("{method}, the paper's GPU"))
                .legend(move |(x, y)| Cross::new((x + 9, y), 5, INK[m].stroke_width(2)));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperLeft)
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.4))
            .label_font(("sans-serif", 11))
            .draw()?;
        area.present()?;
    }
    Ok(Plane { width: SIZE.0 as usize, height: SIZE.1 as usize, channels: 3, data })
}

fn span(table: &Table) -> (f64, f64) {
    let all = || table.cells.iter().map(|c| c.ms_median);
    (0.6 * all().fold(6.0, f64::min), 2.0 * all().fold(200.0, f64::max))
}
