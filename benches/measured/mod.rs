//! The page of a bench that ran as a whole: `docs/measurements/NAME.md` and `NAME.svg`, made of its numbers.

use std::fmt::Write;
use std::path::Path;
use std::process::Command;

/// Writes page and chart of a whole run. `text`: what the bench says of it, in Markdown; `bars`: figures of the chart,
/// by name, in `unit`.
pub fn write_page(name: &str, device: &str, text: &str, (bars, unit): (&[(String, f64)], &str)) {
    let Some(root) = root() else { return eprintln!("no page: docs/ is not here") };
    let folder = root.join("docs/measurements");
    let load = load_average();
    let commit = said("git", &["describe", "--always", "--dirty"]);
    let date = said("date", &["-u", "+%Y-%m-%d %H:%M UTC"]);
    let page = format!(
        "# Measured: `{name}`\n\n`cargo bench --bench {name}` writes this page when it has run as a whole.\n\n\
         {date}, commit {commit}, {device}.\n\
         Load of the machine over 1, 5 and 15 minutes: {load}.\n\n\
         ![Times of {name}]({name}.svg)\n\n{}\n",
        text.trim()
    );
    std::fs::create_dir_all(&folder).expect("docs/measurements can be made");
    std::fs::write(folder.join(format!("{name}.svg")), chart(bars, unit)).expect("docs is writable");
    std::fs::write(folder.join(format!("{name}.md")), page).expect("docs is writable");
    println!("page: docs/measurements/{name}.md");
}

/// Load of the machine over 1, 5 and 15 minutes.
pub fn load_average() -> String {
    let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split(' ').take(3).collect::<Vec<_>>().join(", ")
}

/// The sources with the pages. Benches of other crates lie in folders below it.
fn root() -> Option<&'static Path> {
    let is_root = |folder: &&Path| folder.join("docs/SUMMARY.md").is_file();
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().find(is_root)
}

/// What a program prints; "unknown" where it cannot be asked.
fn said(program: &str, arguments: &[&str]) -> String {
    let done = Command::new(program).args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output();
    let text = done
        .ok()
        .filter(|d| d.status.success())
        .map(|d| String::from_utf8_lossy(&d.stdout).trim().to_owned());
    text.unwrap_or_else(|| "unknown".to_owned())
}

/// Height of a row, width of the names and of the bars, px.
const ROW_PX: f64 = 16.0;
const NAMES_PX: f64 = 420.0;
const BARS_PX: f64 = 480.0;

/// Bars on a logarithmic scale, one a figure; what is not above 0 has none.
fn chart(figures: &[(String, f64)], unit: &str) -> String {
    let above = || figures.iter().map(|(_, value)| *value).filter(|v| *v > 0.0);
    let low = above().reduce(f64::min).unwrap_or(1.0).log10().floor();
    let high = above().reduce(f64::max).unwrap_or(1.0).log10().ceil().max(low + 1.0);
    let [width, height] = [NAMES_PX + BARS_PX + 80.0, ROW_PX * (figures.len() as f64 + 2.0)];
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
         font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n"
    );
    let x_of = |value: f64| NAMES_PX + BARS_PX * (value.log10() - low) / (high - low);
    for decade in low as i32..=high as i32 {
        let (x, value) = (x_of(10f64.powi(decade)), 10f64.powi(decade));
        writeln!(svg, "<path d=\"M{x} {ROW_PX}V{height}\" stroke=\"#ccc\"/>").expect("strings grow");
        writeln!(svg, "<text x=\"{x}\" y=\"11\" text-anchor=\"middle\">{value} {unit}</text>")
            .expect("strings grow");
    }
    for (i, (name, value)) in figures.iter().enumerate() {
        let y = ROW_PX * (i as f64 + 1.0);
        let (bar, text_y) = (f64::max(x_of(value.max(10f64.powf(low))) - NAMES_PX, 0.0), y + 0.75 * ROW_PX);
        let name = name.replace('&', "&amp;").replace('<', "&lt;");
        writeln!(
            svg,
            "<text x=\"{}\" y=\"{text_y}\" text-anchor=\"end\">{name}</text><rect x=\"{NAMES_PX}\" y=\"{}\" \
             width=\"{bar:.1}\" height=\"{}\" fill=\"#36c\"/><text x=\"{:.1}\" y=\"{text_y}\">{value:.3}</text>",
            NAMES_PX - 6.0,
            y + 3.0,
            ROW_PX - 5.0,
            NAMES_PX + bar + 4.0,
        )
        .expect("strings grow");
    }
    svg + "</svg>\n"
}
