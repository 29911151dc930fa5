//! What the ladder says: numbers, a table, a picture.

use std::fmt;
use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;
use shutterbug::gpu::PassTime;
use shutterbug::plane::{Plane, write_png_atomic};

use super::picture;
use super::takes::Family;

/// One method on one scene.
#[derive(Serialize)]
pub struct Row {
    pub scene: String,
    pub family: Family,
    pub method: String,
    /// Levels of 255.
    pub rmse: f64,
    pub psnr_db: f64,
    pub worst_line_time_us: f64,
    pub invalid_share: f64,
    pub ms_median: f64,
    pub plain_render_ms_median: f64,
    /// Time of all threads of the process a frame, which other work on the machine hardly changes; 0 where unknown.
    pub cpu_ms: f64,
    pub plain_cpu_ms: f64,
    /// Least time of all passes but placing, rasterizing, resolving and reading the colour, ms: motion and warp.
    pub post_ms: f64,
    #[serde(skip)]
    pub picture: Plane<u8>,
    #[serde(skip)]
    pub reference: Plane<u8>,
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "| {} | {} | {:.3} | {:.1} | {:.0} | {:.4} | {:.1} | {:.1} | {:.2} | {:.2} | {:.1} |",
            self.scene,
            self.method,
            self.rmse,
            self.psnr_db,
            self.worst_line_time_us,
            self.invalid_share,
            self.ms_median,
            self.plain_render_ms_median,
            self.ms_median / self.plain_render_ms_median,
            self.cpu_ms / self.plain_cpu_ms,
            self.post_ms
        )
    }
}

/// CPU time of this process so far, ms (Linux; ticks of 10 ms).
pub fn cpu_ms() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks = |i: usize| fields.get(i).and_then(|f| f.parse::<f64>().ok()).unwrap_or(0.0);
    10.0 * (ticks(11) + ticks(12))
}

/// Least time of every pass over frames.
pub fn keep_least(passes: &mut Vec<PassTime>, times: &[PassTime]) {
    for time in times {
        match passes.iter_mut().find(|p| p.name == time.name) {
            Some(pass) => pass.ms = pass.ms.min(time.ms),
            None => passes.push(time.clone()),
        }
    }
}

/// See [`Row::post_ms`].
pub fn post_ms(passes: &[PassTime]) -> f64 {
    const PICTURE: [&str; 5] = ["exact_place", "raster", "resolve", "finish", "readback"];
    passes.iter().filter(|p| !PICTURE.contains(&p.name)).map(|p| p.ms).sum()
}

/// In words.
pub fn passes(passes: &[PassTime]) -> String {
    passes.iter().map(|p| format!("{} {:.1}", p.name, p.ms)).collect::<Vec<_>>().join(", ")
}

/// Sorts.
pub fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The largest error in time of any line, us: per line the shift in time that, through the reference's derivative
/// (pictures `step_s` before and after), explains most of the difference. Lines in which too little changes say
/// nothing.
pub fn worst_line_time_us(
    (got, want): (&Plane<u8>, &Plane<u8>),
    (before, after): (&Plane<u8>, &Plane<u8>),
    step_s: f64,
) -> f64 {
    let mut worst = 0.0_f64;
    for y in 0..want.height {
        let (mut product, mut square) = (0.0, 0.0);
        let values = got.row(y).iter().zip(want.row(y)).zip(before.row(y).iter().zip(after.row(y)));
        for ((&got, &want), (&before, &after)) in values {
            let slope = (f64::from(after) - f64::from(before)) / (2.0 * step_s);
            product += slope * (f64::from(got) - f64::from(want));
            square += slope * slope;
        }
        // Two levels a millisecond, root mean square.
        if square > (2000.0_f64).powi(2) * want.row(y).len() as f64 {
            worst = worst.max((product / square).abs() * 1e6);
        }
    }
    worst
}

/// Writes all four files; the table.
pub fn write(folder: &Path, rows: &[Row], device: &str, renders: u32) -> String {
    std::fs::create_dir_all(folder).expect("target/bench can be made");
    let json = serde_json::to_string_pretty(rows).expect("numbers and names");
    std::fs::write(folder.join("ladder.json"), json).expect("target/bench is writable");
    let mut table =
        format!("Device: {device}. Reference: accumulation of {renders} renders, 16 samples a pixel.\n\n");
    table += "| scene | method | rmse | psnr_db | worst_line_time_us | invalid_share | ms | plain ms | ratio | cpu \
        ratio | post ms |\n";
    table += "|---|---|---|---|---|---|---|---|---|---|---|\n";
    for row in rows {
        writeln!(table, "{row}").expect("strings grow");
    }
    table += &compact(rows);
    std::fs::write(folder.join("ladder.md"), &table).expect("target/bench is writable");
    let shown: Vec<&Row> = rows.iter().filter(|r| r.method == "exact" || r.method == "fast").collect();
    write_png_atomic(&folder.join("ladder.png"), &picture::sheet(&shown)).expect("target/bench is writable");
    let typical: Vec<&Row> = FAILURES
        .iter()
        .filter_map(|(method, scene)| rows.iter().find(|r| r.method == *method && r.scene == *scene))
        .collect();
    write_png_atomic(&folder.join("failures.png"), &picture::failures(&typical))
        .expect("target/bench is writable");
    table
}

/// Where each method typically fails.
const FAILURES: [(&str, &str); 4] = [
    ("paper", "acceleration_both"),
    ("fast", "checkers_parallax_both"),
    ("exact", "object_blur"),
    ("accumulation_6", "robot_both"),
];

/// What fits a page: a line a scene, decibels for shutter, blur and both; the CPU time of `exact` over a plain render's
/// and the time of `fast`'s motion and warp over that of the paper's.
fn compact(rows: &[Row]) -> String {
    const METHODS: [&str; 5] = ["paper", "fast", "exact", "accumulation_6", "accumulation_24"];
    const EFFECTS: [&str; 3] = ["shutter", "blur", "both"];
    let mut scenes: Vec<&str> = Vec::new();
    for row in rows {
        let name = row.scene.rsplit_once('_').map_or(row.scene.as_str(), |(name, _)| name);
        if !scenes.contains(&name) {
            scenes.push(name);
        }
    }
    let mut table = "\n| scene | ".to_owned() + &METHODS.join(" | ") + " | exact / plain | fast / paper |\n";
    table += &("|---".repeat(METHODS.len() + 3) + "|\n");
    for scene in scenes {
        let find = |method: &str, effect: &str| {
            rows.iter().find(|r| r.method == method && r.scene == format!("{scene}_{effect}"))
        };
        let each = |value: &dyn Fn(&str) -> Option<String>| {
            EFFECTS.map(|e| value(e).unwrap_or_else(|| "-".to_owned())).join(", ")
        };
        write!(table, "| {scene} |").expect("strings grow");
        for method in METHODS {
            let decibels = each(&|e| find(method, e).map(|r| format!("{:.1}", r.psnr_db)));
            write!(table, " {decibels} |").expect("strings grow");
        }
        let cost = each(&|e| find("exact", e).map(|r| format!("{:.2}", r.cpu_ms / r.plain_cpu_ms)));
        let warp = |e: &str| Some(find("fast", e)?.post_ms / find("paper", e)?.post_ms);
        let warp = each(&|e| warp(e).map(|ratio| format!("{ratio:.1}")));
        writeln!(table, " {cost} | {warp} |").expect("strings grow");
    }
    table
}
