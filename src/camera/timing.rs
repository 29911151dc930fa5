//! When each line of the sensor is exposed.
//!
//! The paper (eq. 1, 5, 6) counts time in frames and takes the readout to last a whole one; here everything is in
//! seconds: line i of N in scan order starts at `start_s + readout_time_s i / N` and integrates for `exposure_time_s`.

use std::fmt;

/// The order in which lines are read. For the two horizontal orders a line is a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum ScanOrder {
    /// Row 0 first.
    #[default]
    TopToBottom,
    /// The last row first.
    BottomToTop,
    /// Column 0 first.
    LeftToRight,
    /// The last column first.
    RightToLeft,
}

impl ScanOrder {
    /// All orders, in the order of the contract.
    pub const ALL: [Self; 4] = [Self::TopToBottom, Self::BottomToTop, Self::LeftToRight, Self::RightToLeft];

    /// The name in `camera.toml` and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::TopToBottom => "top_to_bottom",
            Self::BottomToTop => "bottom_to_top",
            Self::LeftToRight => "left_to_right",
            Self::RightToLeft => "right_to_left",
        }
    }

    /// The order of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|o| o.name() == name)
    }

    /// Whether a line is a row of the picture (else a column).
    pub fn lines_are_rows(self) -> bool {
        matches!(self, Self::TopToBottom | Self::BottomToTop)
    }

    /// Number of lines of a picture.
    pub fn line_count(self, width: u32, height: u32) -> u32 {
        if self.lines_are_rows() { height } else { width }
    }

    /// Place in scan order of the line that holds pixel (x, y).
    pub fn line_of(self, x: u32, y: u32, width: u32, height: u32) -> u32 {
        match self {
            Self::TopToBottom => y,
            Self::BottomToTop => height - 1 - y,
            Self::LeftToRight => x,
            Self::RightToLeft => width - 1 - x,
        }
    }
}

impl fmt::Display for ScanOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Shutter of one frame. `start_s` is the START of exposure of the first line read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShutterTiming {
    /// Start of exposure of the first line read, s on the capture's clock.
    pub start_s: f64,
    /// How long every line integrates, s; 0 = an instant.
    pub exposure_time_s: f64,
    /// N times the delay between lines, s; 0 = global shutter.
    pub readout_time_s: f64,
    /// Which line is read first.
    pub scan_order: ScanOrder,
    /// Number of lines N.
    pub line_count: u32,
}

impl ShutterTiming {
    /// Delay from one line's start to the next one's, s.
    pub fn line_delay_s(&self) -> f64 {
        self.readout_time_s / f64::from(self.line_count)
    }

    /// Start of exposure of the line at place `line` in scan order, s.
    pub fn line_start_s(&self, line: u32) -> f64 {
        self.start_s + self.readout_time_s * f64::from(line) / f64::from(self.line_count)
    }

    /// Middle of the exposure of the line at place `line` in scan order, s.
    pub fn line_middle_s(&self, line: u32) -> f64 {
        self.line_start_s(line) + 0.5 * self.exposure_time_s
    }

    /// End of exposure of the last line read, s.
    pub fn end_s(&self) -> f64 {
        self.line_start_s(self.line_count - 1) + self.exposure_time_s
    }

    /// The instant half way between the first line's start and the last line's end, s.
    pub fn middle_s(&self) -> f64 {
        0.5 * (self.start_s + self.end_s())
    }
}
