//! What Table 1 says: lines, a Markdown table beside the paper's, files.

use std::fmt::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};
use shutterbug::plane::write_png_atomic;

use super::cells::{Cell, METHODS, SAMPLES, SIZES};
use super::chart;
use super::peers_bounds::{Bounded, Bounds};
use super::raster16::{SAME_PICTURE_DB, WAYS, Way};

/// The paper's times, ms, on a GeForce 8800 GTX; the size of its picture is not given.
pub const PAPER: [[Option<f64>; 4]; 3] = [
    [Some(6.632), Some(39.114), Some(151.424), None],
    [None, Some(13.436), Some(14.372), Some(15.153)],
    [None, None, None, Some(16.266)],
];
/// The paper's only time of the generic model, ms: what it took with 16 samples and five lights.
pub const MOONSHOT_MS: f64 = 16.266;

/// The whole result.
#[derive(Serialize, Deserialize)]
pub struct Table {
    pub device: String,
    pub driver: String,
    /// `LP_NUM_THREADS`.
    pub threads: String,
    /// On a software device all times are CPU times.
    #[serde(rename = "software_device")]
    pub software: bool,
    /// Over one, five and fifteen minutes, at the start.
    pub load: String,
    pub quick: bool,
    pub cells: Vec<Cell>,
    pub extra: Extra,
}

/// What stands beside the table.
#[derive(Default, Serialize, Deserialize)]
pub struct Extra {
    /// Size, frames in flight, frames a second of the generic model.
    pub throughput: Vec<([u32; 2], u32, f64)>,
    /// 16 samples by one pass, and by four.
    pub raster_16: Vec<Way>,
    /// Rates of the device.
    pub rates: Bounds,
    /// Passes of the generic model at 240 samples against their bounds, by size.
    pub bounds: Vec<([u32; 2], Vec<Bounded>)>,
}

/// One cell in words.
pub fn line(c: &Cell) -> String {
    let mut text = format!(
        "{:12} {:3} {:4}x{:<4} device {:8.2} ms (p95 {:8.2}), waited {:8.2}, host {:8.2}, cpu {:8.2}, taps {:6.2}, \
         {} frames, margin {:?}:",
        c.method,
        c.samples,
        c.width,
        c.height,
        c.ms_median,
        c.ms_p95,
        c.wait_ms_median,
        c.host_ms_median,
        c.cpu_ms_mean,
        c.taps_mean,
        c.frames,
        c.margin_px
    );
    for pass in &c.passes {
        write!(text, " {} {:.2}", pass.name, pass.ms_median).expect("strings grow");
    }
    text
}

impl Table {
    fn find(&self, method: &str, samples: u32, size: [u32; 2]) -> Option<&Cell> {
        self.cells.iter().find(|c| c.method == method && c.samples == samples && [c.width, c.height] == size)
    }

    fn ratio(
        &self,
        over: (&str, u32),
        under: (&str, u32),
        size: [u32; 2],
        of: fn(&Cell) -> f64,
    ) -> Option<f64> {
        let get = |(method, samples)| self.find(method, samples, size).map(of);
        Some(get(over)? / get(under)?)
    }

    /// The tables.
    pub fn markdown(&self) -> String {
        let unit = if self.software { "CPU time, ms" } else { "GPU time, ms" };
        let mut text = format!(
            "Device: {}; driver: {}; LP_NUM_THREADS={}; load at the start: {}.\n\
             16 samples a pixel, five lights, 73 objects, 11984 triangles; median of frames of a panning camera. \
             {unit}.\n",
            self.device, self.driver, self.threads, self.load
        );
        for size in SIZES {
            if self.cells.iter().all(|c| [c.width, c.height] != size) {
                continue;
            }
            write!(
                text,
                "\n{}x{} | 1 | 6 | 24 | 240 samples | mean taps at 240\n---|---|---|---|---|---\n",
                size[0], size[1]
            )
            .expect("strings grow");
            for (row, method) in METHODS.into_iter().enumerate() {
                write!(text, "{method}").expect("strings grow");
                for (column, samples) in SAMPLES.into_iter().enumerate() {
                    let ours = self
                        .find(method, samples, size)
                        .map_or("-".to_owned(), |c| format!("{:.1} (p95 {:.1})", c.ms_median, c.ms_p95));
                    let paper = PAPER[row][column].map_or(String::new(), |p| format!(" [{p}]"));
                    write!(text, " | {ours}{paper}").expect("strings grow");
                }
                let taps = self.find(method, 240, size).map_or(0.0, |c| c.taps_mean);
                writeln!(text, " | {taps:.2}").expect("strings grow");
            }
        }
        text += "\nIn brackets: the paper's, on a GeForce 8800 GTX.\n";
        self.ratios(&mut text);
        self.split(&mut text);
        self.beside(&mut text);
        text
    }

    fn ratios(&self, text: &mut String) {
        type Of = fn(&Cell) -> f64;
        let by: [(&str, Of); 2] = [("device", |c| c.ms_median), ("process CPU", |c| c.cpu_ms_mean)];
        *text += "\nratio | size | clock | ours | goal | paper\n---|---|---|---|---|---\n";
        for size in SIZES {
            for (clock, of) in by {
                let rows = [
                    ("generic 240 / velocity 240", ("generic", 240), ("velocity", 240), "<= 1.03", 1.073),
                    ("velocity 240 / velocity 6", ("velocity", 240), ("velocity", 6), "<= 1.03", 1.128),
                    ("accumulation 24 / velocity 24", ("accumulation", 24), ("velocity", 24), ">= 18", 10.54),
                ];
                for (name, over, under, goal, paper) in rows {
                    if let Some(ours) = self.ratio(over, under, size, of) {
                        writeln!(
                            text,
                            "{name} | {}x{} | {clock} | {ours:.3} | {goal} | {paper}",
                            size[0], size[1]
                        )
                        .expect("strings grow");
                    }
                }
            }
        }
        if let Some(c) = self.find("generic", 240, SIZES[0]) {
            writeln!(
                text,
                "\nGeneric model, 16 samples, five lights, 320x240: {:.2} ms by the device, {:.2} by the \
                host (goal: under {MOONSHOT_MS}).",
                c.ms_median, c.host_ms_median
            )
            .expect("strings grow");
        }
    }

    fn split(&self, text: &mut String) {
        *text += "\nPasses, ms, at 240 samples (accumulation: 24):\n\n";
        for c in self.cells.iter().filter(|c| c.samples == if c.method == "accumulation" { 24 } else { 240 })
        {
            let passes: Vec<String> =
                c.passes.iter().map(|p| format!("{} {:.2}", p.name, p.ms_median)).collect();
            let quality = c.psnr_db.map_or(String::new(), |db| format!("; {db:.1} dB against 64 renders"));
            writeln!(text, "* {} {}x{}: {}{quality}", c.method, c.width, c.height, passes.join(", "))
                .expect("strings grow");
        }
    }

    fn beside(&self, text: &mut String) {
        *text += "\n";
        for (size, in_flight, fps) in &self.extra.throughput {
            writeln!(
                text,
                "* generic model, {}x{}, {in_flight} in flight: {fps:.2} frames a second",
                size[0], size[1]
            )
            .expect("strings grow");
        }
        if !self.extra.raster_16.is_empty() {
            self.sixteen(text);
        }
        if self.extra.rates.copy_bytes_per_s > 0.0 {
            self.bounds(text);
        }
    }

    fn bounds(&self, text: &mut String) {
        writeln!(
            text,
            "\n{}. What a pass must read and write at least, and the ratio of its time to the larger \
            bound (aim for gather and noise together: 1.5).",
            self.extra.rates.line()
        )
        .expect("strings grow");
        for (size, rows) in &self.extra.bounds {
            write!(text, "\ngeneric 240, {}x{}: {}", size[0], size[1], Bounded::HEAD).expect("strings grow");
            rows.iter().for_each(|row| *text += &row.row());
        }
    }

    fn sixteen(&self, text: &mut String) {
        *text += "\n\
                  16 samples a pixel, rasterized and added up | size | least ms | median | CPU ms | times as long | \
                  PSNR to the second, dB\n---|---|---|---|---|---|---\n";
        for way in &self.extra.raster_16 {
            let first = self.extra.raster_16.iter().find(|w| w.size == way.size).expect("itself at least");
            writeln!(
                text,
                "{} | {}x{} | {:.2} | {:.2} | {:.1} | {:.2} | {:.1}{}",
                way.name,
                way.size[0],
                way.size[1],
                way.ms_least,
                way.ms_median,
                way.cpu_ms_median,
                way.ms_least / first.ms_least,
                way.psnr_db,
                if way.name != WAYS[0] && way.psnr_db < SAME_PICTURE_DB {
                    " ANOTHER PICTURE: no ratio with it counts"
                } else {
                    ""
                }
            )
            .expect("strings grow");
        }
        *text += "(goal: with lights in a storage buffer 2.5 times as long)\n";
    }

    /// Writes `table1.json`, `table1.md` and `table1.png`.
    pub fn write(&self, folder: &Path) {
        std::fs::create_dir_all(folder).expect("target/bench can be made");
        let json = serde_json::to_string_pretty(self).expect("numbers and names");
        std::fs::write(folder.join("table1.json"), json + "\n").expect("target/bench is writable");
        std::fs::write(folder.join("table1.md"), self.markdown()).expect("target/bench is writable");
        match chart::draw(self) {
            Ok(picture) => {
                write_png_atomic(&folder.join("table1.png"), &picture).expect("target/bench is writable")
            }
            Err(error) => eprintln!("no chart: {error}"),
        }
    }
}
