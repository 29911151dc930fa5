//! `simulate`: frames in which nothing of the scene is seen, for want of light or for too much of it, are named.

use shutterbug::chain::{Settings, View};
use shutterbug::effects;
use shutterbug::engine::Frame;
use shutterbug::error::counted;
use shutterbug::plane::Plane;
use shutterbug::reference::chain;

/// Most frames that are named.
const MOST_NAMED: usize = 5;
/// How far two pictures of the same light may differ, DN: device and twin round apart.
const ROUNDING_DN: u8 = 1;

/// Mean from which on a frame has seen light, DN: a sensor delivers no quarter of white in the dark. Such frames do not
/// cost the twin's time.
const LIT_DN: u64 = 64;
/// Most values that are not white, one in so many, of a frame that shows nothing but white.
const NOT_WHITE: u64 = 100;

/// Looks for frames that are what the sensor delivers with no light at all: the noise of a dark frame is no scene.
#[derive(Default)]
pub(super) struct Darkness {
    /// Sum of all values of a frame without light, once one was made.
    typical: Option<u64>,
    /// Places of the frames found.
    dark: Vec<usize>,
    /// Places of frames that are white nearly everywhere.
    white: Vec<usize>,
    looked_at: usize,
}

impl Darkness {
    /// Looks at a frame that was made with these settings.
    pub(super) fn look(&mut self, frame: &Frame, settings: &Settings, view: &View) {
        self.looked_at += 1;
        let picture = &frame.picture;
        let sum = |p: &Plane<u8>| p.data.iter().map(|v| u64::from(*v)).sum::<u64>();
        let (seen, values) = (sum(picture), picture.data.len() as u64);
        // A frame that is brighter by half a step in each value has seen light; the others are looked at closely.
        let is_lit = |typical: u64| seen > typical + values / 2;
        if seen > LIT_DN * values {
            // So many white values make a bright sum: other frames need no second look.
            let is_bright = 255 * (NOT_WHITE - 1) * values < NOT_WHITE * seen;
            let not_white = || picture.data.iter().filter(|v| **v < 255).count() as u64;
            if is_bright && NOT_WHITE * not_white() < values {
                self.white.push(frame.index as usize);
            }
            return;
        }
        if self.typical.is_some_and(is_lit) {
            return;
        }
        let none = Plane::new(picture.width, picture.height, 4);
        let unlit = chain::picture(effects::LIST, settings, view, &none);
        if is_lit(*self.typical.get_or_insert_with(|| sum(&unlit))) {
            return;
        }
        if picture.data.iter().zip(&unlit.data).all(|(a, b)| a.abs_diff(*b) <= ROUNDING_DN) {
            self.dark.push(frame.index as usize);
        }
    }

    /// A sentence on the frames of each kind that were found; `stems` are the names of all frames.
    pub(super) fn said(&self, stems: &[String]) -> Vec<String> {
        let named = |frames: &[usize]| {
            let first = frames.iter().take(MOST_NAMED).map(|&f| format!("frame {f} ({})", stems[f]));
            let more = if frames.len() > MOST_NAMED { ", ..." } else { "" };
            format!("{}{more}", first.collect::<Vec<_>>().join(", "))
        };
        let all = counted(self.looked_at, "frame", "frames");
        let mut said = Vec::new();
        if !self.dark.is_empty() {
            said.push(format!(
                "nothing of the scene is seen in {} of {all}, as if there were no light: {}; is the camera outside of \
                 the room, does it look away, or are all materials black?",
                self.dark.len(),
                named(&self.dark)
            ));
        }
        if !self.white.is_empty() {
            said.push(format!(
                "{} of {all} are white nearly everywhere: {}; are materials (Kd up to 1), lamps or the exposure gain \
                 too bright?",
                self.white.len(),
                named(&self.white)
            ));
        }
        said
    }
}
