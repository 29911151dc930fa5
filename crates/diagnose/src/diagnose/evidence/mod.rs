//! What there is to judge by: the real frames of a capture, checked, and split into those that fits see, those that a
//! search chooses by, and those that are scored once, for the report.

pub(super) mod blocks;
pub(super) mod budget;
pub(super) mod quality;

use std::path::Path;
use std::sync::Arc;

use shutterbug::capture::Capture;
use shutterbug::error::{Error, Result, counted};
use shutterbug::plane::{Plane, read_rgb8};

use crate::diagnose::report::LeftOut;
use budget::Budget;

/// Fewest frames that can be split into frames to fit and frames to judge.
const FEWEST_FRAMES: usize = 4;
/// Smallest side of frames that can be judged, px: two blocks of a compressed picture.
pub(crate) const LEAST_SIDE_PX: u32 = 16;
/// Most frames to fit, to choose by and to report: more add time and hardly any certainty.
const MOST: [usize; 3] = [6, 4, 8];
/// The same of large pictures, which show so much more each.
const MOST_LARGE: [usize; 3] = [4, 2, 4];
/// Px from which on a picture is large.
const LARGE_PX: usize = 640 * 480 * 2;
/// Most px of all frames together that are held, but for those that the parts need: a diagnosis takes about 100 bytes a
/// px.
const MOST_PX_IN_ALL: usize = 24 << 20;
/// Px of the frames that are scored at a time: what a camera may do to each is drawn several times.
const SCORED_PX: usize = 8 << 20;
/// Px of the frames of which is held what a model says of every value: 200 bytes a px, and 80 of the frame before them.
const JUDGED_PX: usize = 3 << 20;
/// Frames a block: two, so that frame-to-frame differences exist within the held-out ones.
pub(crate) const BLOCK: usize = 2;

/// A frame that can be compared.
#[derive(Clone, Debug)]
pub(crate) struct RealFrame {
    /// Its place in `frames.csv`.
    pub index: usize,
    /// Its timestamp, s.
    pub start_s: f64,
    /// DN, shape `[height, width, 3]`.
    pub dn: Arc<Plane<f32>>,
}

/// A frame as it was read.
struct ReadFrame {
    index: usize,
    start_s: f64,
    picture: Arc<Plane<u8>>,
}

/// The frames that can be compared.
#[derive(Clone, Debug)]
pub(crate) struct Evidence {
    /// In the order of `frames.csv`.
    pub frames: Vec<RealFrame>,
    /// Places in `frames` of those that fits may see.
    pub fit: Vec<usize>,
    /// Places in `frames` of those that a search chooses by.
    pub choose: Vec<usize>,
    /// Places in `frames` of those that are scored for the report, once.
    pub report: Vec<usize>,
    /// Frames that are not used.
    pub left_out: Vec<LeftOut>,
    /// How far before its timestamp and after it every used frame has poses, s.
    pub reach_s: [f64; 2],
    /// What a reader should know.
    pub warnings: Vec<String>,
}

impl Evidence {
    /// Reads the real frames of a capture from a folder.
    ///
    /// # Errors
    /// A missing folder, pictures that cannot be read or have another size, fewer than four usable frames.
    pub(crate) fn read(capture: &Capture, folder: &Path, budget: &Budget) -> Result<Self> {
        let expected = "the real frames that frames.csv names, as PNG or JPEG";
        if !folder.is_dir() {
            return Err(Error::input(folder, None, "no such folder", expected));
        }
        let k = &capture.camera.intrinsics;
        if k.width.min(k.height) < LEAST_SIDE_PX {
            let found = format!("a camera of {}x{} px", k.width, k.height);
            let expected = format!("at least {LEAST_SIDE_PX} px a side, or nothing can be told apart");
            return Err(Error::input(&capture.camera.path, None, found, expected));
        }
        let (mut frames, mut left_out) = (Vec::new(), Vec::new());
        for (index, entry) in capture.frames.iter().enumerate() {
            budget.go_on()?;
            let path = folder.join(&entry.filename);
            let mut skip = |why: String| {
                left_out.push(LeftOut { index, filename: entry.filename.clone(), why });
            };
            if !path.exists() {
                skip("no such file".to_owned());
                continue;
            }
            // A still that is divided into parts is read once.
            let before =
                frames.last().filter(|f: &&ReadFrame| capture.frames[f.index].filename == entry.filename);
            if let Some(picture) = before.map(|f| f.picture.clone()) {
                frames.push(ReadFrame { index, start_s: entry.start_s, picture });
                continue;
            }
            let picture = read_rgb8(&path)?;
            if (picture.width, picture.height) != (k.width as usize, k.height as usize) {
                let found = format!("a picture of {}x{} px", picture.width, picture.height);
                let expected =
                    format!("{}x{} px, as {} says", k.width, k.height, capture.camera.path.display());
                return Err(Error::input(&path, None, found, expected));
            }
            if let Some(why) = useless(&picture) {
                skip(why.to_owned());
                continue;
            }
            frames.push(ReadFrame { index, start_s: entry.start_s, picture: Arc::new(picture) });
        }
        let reach_s = keep_covered(capture, &mut frames, &mut left_out);
        if frames.len() < FEWEST_FRAMES {
            let why: Vec<_> = left_out.iter().take(3).map(|l| format!("{}: {}", l.filename, l.why)).collect();
            let found =
                format!("{} ({})", counted(frames.len(), "usable frame", "usable frames"), why.join(", "));
            let expected = format!("at least {FEWEST_FRAMES}: some to fit, others to judge");
            return Err(Error::input(folder, None, found, expected));
        }
        let px = k.width as usize * k.height as usize;
        let split = keep_few(capture, px, &mut frames, &mut left_out);
        let frames = in_dn(frames);
        let warnings = warnings(capture, left_out.len());
        let [fit, choose, report] = split;
        Ok(Self { frames, fit, choose, report, left_out, reach_s, warnings })
    }
}

/// What a reader should know of the capture and its frames.
fn warnings(capture: &Capture, left_out: usize) -> Vec<String> {
    let mut all = capture.camera.warnings.clone();
    // A shutter is a candidate: it may be open until the next frame.
    let gaps = capture.gap_warnings(capture.camera.frame_period_s);
    gaps.iter().for_each(|gap| tracing::warn!("{gap}"));
    all.extend(gaps);
    if left_out > 0 {
        let of = counted(capture.frames.len(), "frame was", "frames were");
        all.push(format!("{left_out} of {of} left out"));
    }
    all
}

impl Evidence {
    /// Frames without times: all to fit, to choose by and to report.
    pub(crate) fn of_frames(frames: impl Iterator<Item = Arc<Plane<f32>>>) -> Self {
        let one = |(index, dn)| RealFrame { index, start_s: 0.0, dn };
        let frames: Vec<RealFrame> = frames.enumerate().map(one).collect();
        let all: Vec<usize> = (0..frames.len()).collect();
        Self {
            frames,
            fit: all.clone(),
            choose: all.clone(),
            report: all,
            left_out: Vec::new(),
            reach_s: [0.0; 2],
            warnings: Vec::new(),
        }
    }
}

impl Evidence {
    /// How many frames of this size are scored at a time.
    pub(crate) fn at_a_time(&self) -> usize {
        (SCORED_PX / self.frame_px()).max(BLOCK)
    }

    /// Of how many of them is held what a model says of every value.
    pub(crate) fn judged_at_a_time(&self) -> usize {
        (JUDGED_PX / self.frame_px()).clamp(1, rayon::current_num_threads().max(2))
    }

    fn frame_px(&self) -> usize {
        self.frames.first().map_or(1, |f| f.dn.width * f.dn.height).max(1)
    }
}

/// At most `most` of the frames, from all over them.
pub(crate) fn spread_out(frames: &[usize], most: usize) -> Vec<usize> {
    let n = frames.len().min(most);
    (0..n).map(|i| frames[i * frames.len() / n]).collect()
}

#[cfg(test)]
impl Evidence {
    /// One frame, to fit, to choose by and to report.
    pub(crate) fn of_one(dn: Plane<f32>) -> Self {
        Self::of_frames(std::iter::once(Arc::new(dn)))
    }
}

/// Why nothing can be seen in a picture, if so.
pub(crate) fn useless(picture: &Plane<u8>) -> Option<&'static str> {
    let share = |f: fn(u8) -> bool| {
        picture.data.iter().filter(|&&v| f(v)).count() as f64 / picture.data.len().max(1) as f64
    };
    if share(|v| v <= 2) > 0.995 {
        Some("all black")
    } else if share(|v| v >= 254) > 0.98 {
        Some("all saturated")
    } else {
        None
    }
}

/// Drops frames near the ends of the trajectory, where no candidate about time could be rendered, as long as enough
/// remain. Returns how far before and after their timestamps the rest has poses. A camera at rest has one pose a frame:
/// between them lies no motion, and no candidate about time is rendered.
fn keep_covered(capture: &Capture, frames: &mut Vec<ReadFrame>, left_out: &mut Vec<LeftOut>) -> [f64; 2] {
    if capture.camera.static_camera {
        return [0.0; 2];
    }
    let paths = std::iter::once(&capture.trajectory)
        .chain(capture.scene.objects.iter().filter_map(|o| o.trajectory.as_deref()));
    let (first_s, last_s) = paths
        .map(|t| t.span_s())
        .fold((f64::NEG_INFINITY, f64::INFINITY), |a, b| (a.0.max(b.0), a.1.min(b.1)));
    let period_s = capture.camera.frame_period_s;
    for (before, after) in [(0.55, 2.0), (0.3, 1.5), (0.1, 1.0), (0.0, 0.5)] {
        let inside = |f: &ReadFrame| {
            f.start_s - before * period_s >= first_s && f.start_s + after * period_s <= last_s
        };
        let kept = frames.iter().filter(|f| inside(f)).count();
        if kept >= FEWEST_FRAMES + 4 || (kept >= FEWEST_FRAMES && kept + 2 >= frames.len()) {
            for f in frames.iter().filter(|f| !inside(f)) {
                let filename = capture.frames[f.index].filename.clone();
                let why = "too near the trajectory's end to render a shutter or an offset in time".to_owned();
                left_out.push(LeftOut { index: f.index, filename, why });
            }
            frames.retain(inside);
            break;
        }
    }
    let before = frames.iter().map(|f| f.start_s - first_s).fold(f64::INFINITY, f64::min);
    let after = frames.iter().map(|f| last_s - f.start_s).fold(f64::INFINITY, f64::min);
    [before.clamp(0.0, 10.0), after.clamp(0.0, 10.0)]
}

/// Of so many frames those that there is memory for: what the parts need, and as many others, evenly.
fn kept(count: usize, parts: &[Vec<usize>; 3], px: usize) -> Vec<usize> {
    let needed = |i: &usize| parts.iter().any(|part| part.contains(i));
    let room = (MOST_PX_IN_ALL / px.max(1)).saturating_sub(parts.iter().map(Vec::len).sum());
    let rest: Vec<usize> = (0..count).filter(|i| !needed(i)).collect();
    let more = room.min(rest.len());
    let others: Vec<usize> = (0..more).map(|i| rest[i * rest.len() / more]).collect();
    (0..count).filter(|i| needed(i) || others.contains(i)).collect()
}

/// Splits frames as [`split`] does; what there is no memory for is left out.
fn keep_few(
    capture: &Capture,
    px: usize,
    frames: &mut Vec<ReadFrame>,
    left_out: &mut Vec<LeftOut>,
) -> [Vec<usize>; 3] {
    let parts = split(frames.len(), px);
    let kept = kept(frames.len(), &parts, px);
    let dropped = (0..frames.len()).filter(|i| !kept.contains(i));
    left_out.extend(dropped.map(|i| {
        let index = frames[i].index;
        let why = format!("{} frames of this size say enough: not compared", kept.len());
        LeftOut { index, filename: capture.frames[index].filename.clone(), why }
    }));
    let mut place = 0..;
    frames.retain(|_| place.next().is_some_and(|i| kept.contains(&i)));
    let now = |i: usize| kept.iter().position(|k| *k == i);
    parts.map(|part| part.into_iter().filter_map(now).collect())
}

/// Pictures as numbers; one that stands for several frames is held once.
fn in_dn(frames: Vec<ReadFrame>) -> Vec<RealFrame> {
    let mut out: Vec<RealFrame> = Vec::new();
    let mut last: Option<Arc<Plane<u8>>> = None;
    for ReadFrame { index, start_s, picture } in frames {
        let same = last.as_ref().is_some_and(|l| Arc::ptr_eq(l, &picture));
        let dn = match out.last() {
            Some(before) if same => before.dn.clone(),
            _ => Arc::new(picture.to_f32()),
        };
        out.push(RealFrame { index, start_s, dn });
        last = Some(picture);
    }
    out
}

/// Blocks of two frames, to fit or not by Thue and Morse's sequence, which never settles into a period: of a flicker
/// that repeats every four frames blocks in turn would show the fit one half only. Of those that are not to fit, blocks
/// in turn are to choose by. Thinned evenly where there are many; what is left over is reported too. `px`: of a
/// picture.
fn split(count: usize, px: usize) -> [Vec<usize>; 3] {
    // Blocks of one where two would leave fewer than two blocks on a side.
    let block = if count >= 4 * BLOCK { BLOCK } else { 1 };
    let most = if px >= LARGE_PX { MOST_LARGE } else { MOST };
    let (fit, rest): (Vec<usize>, Vec<usize>) = (0..count).partition(|i| (i / block).count_ones() % 2 == 0);
    let in_turn: Vec<&[usize]> = rest.chunks(block).collect();
    let fit = thin(fit, most[0], block);
    let choose = thin(in_turn.iter().step_by(2).copied().flatten().copied().collect(), most[1], block);
    let left: Vec<usize> = (0..count).filter(|i| !fit.contains(i) && !choose.contains(i)).collect();
    let report = thin(left, most[2], block);
    [fit, choose, report]
}

/// Periods, in frames, whose phases a choice of frames should show.
const PERIODS: std::ops::RangeInclusive<usize> = 3..=6;
/// Most blocks among which a choice is sought.
const MOST_BLOCKS: usize = 12;

/// Of many frames a few: blocks that show the most phases of anything that repeats, and leave the shortest gaps.
fn thin(places: Vec<usize>, most: usize, block: usize) -> Vec<usize> {
    let blocks: Vec<_> = places.chunks(block).collect();
    let count = blocks.len().min(MOST_BLOCKS);
    let spread: Vec<&[usize]> = (0..count).map(|i| blocks[i * blocks.len() / count]).collect();
    let wanted = (most / block).min(count);
    let chosen = |set: u32| -> Vec<usize> {
        (0..count).filter(|i| set >> i & 1 == 1).flat_map(|i| spread[i].to_vec()).collect()
    };
    (0..1u32 << count)
        .filter(|set| set.count_ones() as usize == wanted)
        .map(chosen)
        .max_by_key(|frames| (fewest_phases(frames), std::cmp::Reverse(longest_gap(frames, &places))))
        .unwrap_or_default()
}

/// Phases of the period of which frames show fewest.
fn fewest_phases(frames: &[usize]) -> usize {
    let phases = |period: usize| (0..period).filter(|p| frames.iter().any(|f| f % period == *p)).count();
    PERIODS.map(phases).min().unwrap_or(0)
}

/// Most frames from one that is shown to the next, and to the ends of `all`.
fn longest_gap(frames: &[usize], all: &[usize]) -> usize {
    let ends = all.first().into_iter().chain(frames).chain(all.last());
    let ends: Vec<usize> = ends.copied().collect();
    ends.windows(2).map(|w| w[1] - w[0]).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_split_shares_no_frame_and_keeps_all_parts() {
        for (count, px) in (4..200).flat_map(|n| [(n, 320 * 240), (n, 1280 * 960)]) {
            let parts = split(count, px);
            let [fit, choose, report] = &parts;
            assert!(fit.len() >= 2 && !choose.is_empty() && !report.is_empty(), "{count}: {parts:?}");
            let mut all: Vec<usize> = parts.concat();
            assert!(all.iter().all(|&f| f < count));
            all.sort_unstable();
            all.dedup();
            assert_eq!(all.len(), fit.len() + choose.len() + report.len(), "{count}: {parts:?}");
            let most = if px < LARGE_PX { MOST } else { MOST_LARGE };
            assert!(parts.iter().zip(most).all(|(p, m)| p.len() <= m), "{count}: {parts:?}");
        }
    }

    #[test]
    fn of_many_large_frames_those_that_a_part_needs_are_kept() {
        let full_hd = 1920 * 1080;
        let parts = split(60, full_hd);
        let kept_of_60 = kept(60, &parts, full_hd);
        assert!(parts.concat().iter().all(|i| kept_of_60.contains(i)), "{parts:?} {kept_of_60:?}");
        assert!(kept_of_60.len() * full_hd <= MOST_PX_IN_ALL, "{}", kept_of_60.len());
        // Of 24 megapixels there is room for the parts alone; of small pictures for all.
        assert_eq!(kept(20, &split(20, 24 << 20), 24 << 20).len(), split(20, 24 << 20).concat().len());
        assert_eq!(kept(60, &split(60, 640 * 480), 640 * 480).len(), 60);
    }

    #[test]
    fn what_repeats_every_few_frames_is_seen_whole_by_the_fit() {
        for count in [12, 13, 14, 16, 20, 60] {
            let [fit, ..] = split(count, 320 * 240);
            assert!(fewest_phases(&fit) >= 3, "{count} frames: {fit:?}");
            assert!(longest_gap(&fit, &[0, count - 1]) <= count / 2 + 1, "{count} frames: {fit:?}");
        }
        assert!(fewest_phases(&[0, 1, 4, 5, 8, 9]) == 2, "control: blocks in turn");
    }

    #[test]
    fn black_and_white_pictures_are_useless_and_dark_ones_are_not() {
        let grey = |v: u8| Plane { width: 10, height: 10, channels: 3, data: vec![v; 300] };
        assert_eq!(useless(&grey(1)), Some("all black"));
        assert_eq!(useless(&grey(255)), Some("all saturated"));
        assert_eq!(useless(&grey(8)), None);
    }
}
