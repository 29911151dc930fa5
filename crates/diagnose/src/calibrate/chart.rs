//! Charts: drawn by `plotters` into pixels, with a font of our own, so that no font of the machine is needed.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::register_font;

use super::noise::Calibration;
use super::ptc::Bin;
use shutterbug::error::{Error, Result};
use shutterbug::plane::Plane;

/// Colours of the channels, dark enough on white.
pub const INK: [RGBColor; 3] = [RGBColor(205, 30, 30), RGBColor(10, 130, 40), RGBColor(30, 60, 210)];
const FONT: &str = "sans-serif";

/// The area of a picture that charts are drawn on.
pub type Area<'a> = DrawingArea<BitMapBackend<'a>, Shift>;

/// Any failure of a chart as an error of the picture.
pub fn fault(error: impl std::fmt::Display) -> Error {
    Error::Picture { path: "chart".into(), action: "encode", reason: error.to_string() }
}

/// Makes the font known to `plotters`; more than once does no harm.
fn font() -> Result<()> {
    register_font(FONT, FontStyle::Normal, epaint_default_fonts::HACK_REGULAR)
        .map_err(|_| fault("the built-in font cannot be read"))
}

/// A white picture that `draw` fills.
///
/// # Errors
/// Those of `draw`.
pub fn canvas(width: u32, height: u32, draw: impl FnOnce(&Area<'_>) -> Result<()>) -> Result<Plane<u8>> {
    font()?;
    let mut data = vec![255u8; (width * height * 3) as usize];
    {
        let area = BitMapBackend::with_buffer(&mut data, (width, height)).into_drawing_area();
        area.fill(&WHITE).map_err(fault)?;
        draw(&area)?;
        area.present().map_err(fault)?;
    }
    Ok(Plane { width: width as usize, height: height as usize, channels: 3, data })
}

/// A line of text at a place of the area.
///
/// # Errors
/// A text that cannot be drawn.
pub fn label(area: &Area<'_>, text: &str, at: (i32, i32), size: u32) -> Result<()> {
    area.draw(&Text::new(text.to_owned(), at, (FONT, size))).map_err(fault)
}

/// Histograms of the channels of a difference over the usable pixels, in 0 to 255, each divided by its largest count,
/// over +-`reach`.
///
/// # Errors
/// A chart that cannot be drawn.
pub fn histograms(area: &Area<'_>, title: &str, d: &Plane<f32>, usable: &[bool], reach: f64) -> Result<()> {
    const BINS: usize = 81;
    let mut counts = [[0.0f64; BINS]; 3];
    let mut sigma = [[0.0f64; 2]; 3];
    for i in (0..usable.len()).filter(|i| usable[*i]) {
        for c in 0..3 {
            let v = 255.0 * f64::from(d.data[i * 3 + c]);
            sigma[c][0] += 1.0;
            sigma[c][1] += v * v;
            let at = ((v / reach + 1.0) * 0.5 * BINS as f64).floor();
            if (0.0..BINS as f64).contains(&at) {
                counts[c][at as usize] += 1.0;
            }
        }
    }
    let mut chart = ChartBuilder::on(area)
        .caption(title, (FONT, 16))
        .margin(8)
        .x_label_area_size(34)
        .y_label_area_size(44)
        .build_cartesian_2d(-reach..reach, 0.0..1.08)
        .map_err(fault)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_labels(7)
        .y_labels(5)
        .x_desc("difference, of 255")
        .y_desc("count / largest")
        .label_style((FONT, 13))
        .draw()
        .map_err(fault)?;
    for c in 0..3 {
        let largest = counts[c].iter().fold(1.0f64, |a, b| a.max(*b));
        let points = counts[c]
            .iter()
            .enumerate()
            .map(|(k, n)| ((2.0 * (k as f64 + 0.5) / BINS as f64 - 1.0) * reach, n / largest));
        let variance = sigma[c][1] / f64::max(sigma[c][0], 1.0) / 2.0;
        chart
            .draw_series(LineSeries::new(points, INK[c].stroke_width(2)))
            .map_err(fault)?
            .label(format!("{} var {variance:.2}", ["R", "G", "B"][c]))
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], INK[c].stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .label_font((FONT, 13))
        .draw()
        .map_err(fault)
}

/// The photon transfer curves of real and simulated frames: linear values above, encoded values below, one column a
/// channel. Shape `[960, 1500, 3]`.
///
/// # Errors
/// A chart that cannot be drawn.
pub fn photon_transfer(c: &Calibration) -> Result<Plane<u8>> {
    canvas(1500, 960, |area| {
        let panels = area.split_evenly((2, 3));
        for channel in 0..3 {
            transfer_panel(&panels[channel], c, channel, true)?;
            transfer_panel(&panels[3 + channel], c, channel, false)?;
        }
        Ok(())
    })
}

/// The 95 % interval of a variance that is known from so many pixels for one.
fn bar((x, y): (f64, f64), share: f64, ink: RGBColor) -> PathElement<(f64, f64)> {
    let half = 1.96 * y * (2.0 * share).sqrt();
    PathElement::new([(x, y - half), (x, y + half)], ink.stroke_width(1))
}

fn transfer_panel(area: &Area<'_>, c: &Calibration, channel: usize, linear: bool) -> Result<()> {
    let scale =
        |b: &Bin| if linear { (b.mean_linear, 1e6 * b.variance_linear) } else { (b.mean_dn, b.variance_dn2) };
    let (real, simulated) = (&c.real.curves[channel], &c.simulated.curves[channel]);
    let highest = real.iter().chain(simulated).map(|b| scale(b).1).fold(1e-9, f64::max);
    let right = if linear { 1.0 } else { 255.0 };
    let name = ["red", "green", "blue"][channel];
    let what = if linear { "linear values" } else { "encoded values" };
    let mut chart = ChartBuilder::on(area)
        .caption(format!("{name}, {what}"), (FONT, 18))
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..right, 0.0..1.25 * highest)
        .map_err(fault)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_desc(if linear { "mean, fraction of full scale" } else { "mean, of 255" })
        .y_desc(if linear { "variance, 1e-6" } else { "variance, of 255 squared" })
        .x_labels(6)
        .label_style((FONT, 14))
        .draw()
        .map_err(fault)?;
    let effective = c.real.neighbours[channel].effective_pixels;
    let bars = real.iter().map(|b| bar(scale(b), effective / b.count, INK[channel]));
    chart.draw_series(bars).map_err(fault)?;
    let point = |b: &Bin, ink: ShapeStyle| Circle::new(scale(b), 4, ink);
    let ink = INK[channel];
    chart
        .draw_series(
            real.iter().map(|b| point(b, if b.cut_off { ink.stroke_width(1) } else { ink.filled() })),
        )
        .map_err(fault)?
        .label("real (hollow: cut off)")
        .legend(move |(x, y)| Circle::new((x + 7, y), 4, ink.filled()));
    let line = simulated.iter().map(scale);
    chart
        .draw_series(LineSeries::new(line, BLACK.stroke_width(2)))
        .map_err(fault)?
        .label("simulated")
        .legend(|(x, y)| PathElement::new([(x, y), (x + 14, y)], BLACK.stroke_width(2)));
    if let (true, Some(fit)) = (linear, &c.real.fits[channel]) {
        let at = |x: f64| (x, 1e6 * (fit.intercept.value + fit.slope.value * x));
        let grey = RGBColor(150, 150, 150);
        chart
            .draw_series(LineSeries::new([at(0.0), at(1.0)], grey.stroke_width(1)))
            .map_err(fault)?
            .label(format!("line: {:.0} e- at white", fit.full_well_e.value))
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], grey.stroke_width(1)));
    }
    chart
        .configure_series_labels()
        .position(if linear { SeriesLabelPosition::UpperLeft } else { SeriesLabelPosition::UpperRight })
        .background_style(WHITE.mix(0.8))
        .label_font((FONT, 13))
        .draw()
        .map_err(fault)
}
