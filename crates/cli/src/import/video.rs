//! Videos, by way of the programs ffprobe and ffmpeg: the one says when each frame is shown, the other decodes it.

use std::io::{ErrorKind, Read as _};
use std::path::{Path, PathBuf};

use super::Damage;
use super::contents::Body;
use super::pixels::{PictureFile, file_of};
use super::program::Running;
use super::wire::Fault;
use shutterbug::error::{Error, Result, counted, one_line};
use shutterbug::plane::{MAX_PIXELS, MAX_SIDE_PX};

/// Most frames of a video: a day and a half at 30 a second.
const MAX_FRAMES: usize = 1 << 22;
/// Words of ffmpeg's that say that a part of the file is missing or spoiled.
const DAMAGE: [&str; 10] = [
    "partial file",
    "prematurely",
    "runcat",
    "Invalid data",
    "rror while decoding",
    "orrupt",
    "oncealing",
    "moov atom",
    "Error splitting",
    "non-existing",
];

/// Codecs that make a picture of any bytes, chosen by the name of a file alone: characters on a screen.
const TEXT: [&str; 4] = ["ansi", "bintext", "idf", "xbin"];

/// A video and what ffprobe says of it.
#[derive(Clone, Debug)]
pub(super) struct Video {
    pub(super) path: PathBuf,
    size: [u32; 2],
    pub(super) codec: String,
    pub(super) pixels: String,
    /// When each frame is shown, ns, in the order of decoding.
    pub(super) times_ns: Vec<i64>,
    /// Frames that its container speaks of, where it does.
    stated: Option<usize>,
    pub(super) turned: bool,
    pub(super) damage: Option<String>,
}

/// The first line of what a program said, without the path.
fn first_line(said: &str, path: &Path) -> String {
    let shown = format!("file:{}", path.display());
    let line = said.lines().map(|l| l.replace(&shown, "the file")).find(|l| !l.trim().is_empty());
    // `[h264 @ 0x55a69fc1f5c0]`: where in memory it works is nobody's concern.
    let line = line.map(|l| match (l.find(" @ 0x"), l.find(']')) {
        (Some(from), Some(to)) if from < to => format!("{}{}", &l[..from], &l[to..]),
        _ => l,
    });
    one_line(line.unwrap_or_default().trim()).chars().take(200).collect()
}

impl Video {
    /// Asks ffprobe.
    ///
    /// # Errors
    /// No ffprobe; a file in which it finds no video; a video that is too large.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let entries = "stream=codec_name,width,height,pix_fmt,time_base,nb_frames:stream_side_data=rotation:\
                       frame=best_effort_timestamp";
        let arguments = ["-select_streams", "v:0", "-show_entries", entries, "-of", "compact", "-i"];
        let mut running = Running::start("ffprobe", &arguments, path)?;
        let mut text = Vec::new();
        running.by_ref().take(1 << 30).read_to_end(&mut text).map_err(|e| Error::io(path, "probe", e))?;
        let (well, said) = running.end();
        let text = String::from_utf8_lossy(&text);
        let mut video = Self::of(path, &text)?;
        if video.size == [0; 2] || video.times_ns.is_empty() {
            let why = first_line(&said, path);
            let found = format!("no video that ffprobe reads ({why})");
            let expected = "MCAP, a ROS bag, a folder of EuRoC, TUM or KITTI, KITTI's poses, or a video";
            return Err(Error::input(path, None, found, expected));
        }
        if TEXT.contains(&video.codec.as_str()) {
            let found =
                format!("no video: ffprobe takes the bytes for characters of a screen ({})", video.codec);
            let expected = "MCAP, a ROS bag, a folder of EuRoC, TUM or KITTI, KITTI's poses, or a video";
            return Err(Error::input(path, None, found, expected));
        }
        let [width, height] = video.size;
        if width.max(height) > MAX_SIDE_PX || u64::from(width) * u64::from(height) > MAX_PIXELS {
            let found = format!("frames of {width}x{height} px");
            return Err(Error::input(
                path,
                None,
                found,
                format!("at most {MAX_SIDE_PX} px a side, {MAX_PIXELS} px"),
            ));
        }
        video.damage = damage(&said, path).or_else(|| (!well).then(|| "ffprobe failed".to_owned()));
        Ok(video)
    }

    /// Reads lines `stream|key=value|...` and `frame|best_effort_timestamp=N`.
    fn of(path: &Path, text: &str) -> Result<Self> {
        let mut video = Self {
            path: path.to_owned(),
            size: [0; 2],
            codec: String::new(),
            pixels: String::new(),
            times_ns: Vec::new(),
            stated: None,
            turned: false,
            damage: None,
        };
        let (mut base, mut ticks) = ((1, 1), Vec::new());
        for line in text.lines() {
            let value = |key: &str| line.split('|').find_map(|p| p.strip_prefix(key)?.strip_prefix('='));
            if line.starts_with("frame|") {
                ticks.push(value("best_effort_timestamp").and_then(|t| t.parse::<i64>().ok()));
            } else if line.starts_with("stream|") {
                let side = |key: &str| value(key).and_then(|v| v.parse().ok()).unwrap_or(0);
                video.size = [side("width"), side("height")];
                value("codec_name").unwrap_or_default().clone_into(&mut video.codec);
                value("pix_fmt").unwrap_or_default().clone_into(&mut video.pixels);
                video.stated = value("nb_frames").and_then(|n| n.parse().ok());
                video.turned = line.contains("rotation=") && !line.contains("rotation=0");
                let parts = value("time_base").and_then(|v| v.split_once('/'));
                base = parts.and_then(|(n, d)| Some((n.parse().ok()?, d.parse().ok()?))).unwrap_or((1, 1));
            }
            if ticks.len() > MAX_FRAMES {
                let found = format!("more than {MAX_FRAMES} frames");
                return Err(Error::input(path, None, found, "a shorter video"));
            }
        }
        let (num, den): (i64, i64) = base;
        let ns = |t: i64| i128::from(t) * i128::from(num) * 1_000_000_000 / i128::from(den.max(1));
        // A frame without a time is one after that of the frame before; such a video is rare and is said to be so
        // later.
        let mut last = 0;
        for tick in ticks {
            last = tick.and_then(|t| i64::try_from(ns(t)).ok()).unwrap_or(last);
            video.times_ns.push(last);
        }
        Ok(video)
    }

    /// What there is, one line and a few numbers.
    pub(super) fn listing(&self) -> String {
        let (first, last) =
            (self.times_ns.first().copied().unwrap_or(0), self.times_ns.last().copied().unwrap_or(0));
        let span_s = (last - first) as f64 * 1e-9;
        let rate = if span_s > 0.0 { (self.times_ns.len() - 1) as f64 / span_s } else { 0.0 };
        let mut steps: Vec<i64> = self.times_ns.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_unstable();
        let step = |i: usize| steps.get(i).copied().unwrap_or(0) as f64 * 1e-6;
        format!(
            "{}: video, {} {} {}x{}, {}, {span_s:.3} s from {:.3} s on, {rate:.3} Hz, steps of {:.3} to {:.3} \
             ms\n",
            one_line(&self.path.display().to_string()),
            one_line(&self.codec),
            one_line(&self.pixels),
            self.size[0],
            self.size[1],
            counted(self.times_ns.len(), "frame", "frames"),
            first as f64 * 1e-9,
            step(0),
            step(steps.len().saturating_sub(1)),
        )
    }

    /// What is wrong with a video of which so many frames can be read.
    pub(super) fn broken(&self, frames: usize, damage: Option<&str>) -> Option<Damage> {
        let stated = self.stated.filter(|s| *s > frames);
        let why = match (stated, damage) {
            (None, None) => return None,
            (Some(n), None) => format!("{n} are announced"),
            (None, Some(said)) => format!("ffmpeg says: {said}"),
            (Some(n), Some(said)) => format!("{n} are announced; ffmpeg says: {said}"),
        };
        let found = format!(
            "a video that breaks off or is damaged, after {} ({why}); what can be read was imported",
            counted(frames, "frame", "frames")
        );
        Some((found, "a whole video".to_owned()))
    }

    /// Decodes all frames: number, size, and values (grey or RGB) of each. What came to light is returned.
    pub(super) fn each(
        &self,
        visit: &mut dyn FnMut(usize, [u32; 3], Vec<u8>) -> Result<()>,
    ) -> Result<Option<Damage>> {
        let grey = self.pixels.starts_with("gray");
        let format = if grey { "gray" } else { "rgb24" };
        let channels = if grey { 1 } else { 3 };
        let size = [self.size[0], self.size[1], channels];
        let bytes = size.iter().map(|s| *s as usize).product::<usize>();
        let mut result = (0, false, String::new());
        // Which of the two names an ffmpeg knows depends on its age.
        for passthrough in ["-fps_mode", "-vsync"] {
            let arguments = [
                "-noautorotate",
                "-i",
                "-map",
                "0:v:0",
                passthrough,
                "passthrough",
                "-sws_flags",
                "accurate_rnd+full_chroma_int",
                "-pix_fmt",
                format,
                "-f",
                "rawvideo",
                "-",
            ];
            let mut running = Running::start("ffmpeg", &arguments, &self.path)?;
            let mut frames = 0;
            loop {
                let mut values = vec![0; bytes];
                match running.read_exact(&mut values) {
                    Ok(()) => visit(frames, size, values)?,
                    Err(e) if e.kind() == ErrorKind::UnexpectedEof => break,
                    Err(e) => return Err(Error::io(&self.path, "decode", e)),
                }
                frames += 1;
            }
            let (well, said) = running.end();
            result = (frames, well, said);
            if frames > 0 || !result.2.contains("fps_mode") {
                break;
            }
        }
        let (frames, well, said) = result;
        let failed = (!well).then(|| first_line(&said, &self.path));
        let fewer = frames < self.times_ns.len();
        let damage = damage(&said, &self.path)
            .or(failed)
            .or_else(|| fewer.then(|| "fewer frames than before".to_owned()));
        Ok(damage.and_then(|said| self.broken(frames, Some(&said))))
    }
}

fn damage(said: &str, path: &Path) -> Option<String> {
    let line = said.lines().find(|l| DAMAGE.iter().any(|d| l.contains(d)))?;
    Some(first_line(line, path))
}

/// A decoded frame as PNG.
pub(super) fn png_of(
    [width, height, channels]: [u32; 3],
    values: &[u8],
) -> std::result::Result<PictureFile, Fault> {
    let encoding = if channels == 1 { "mono8" } else { "rgb8" }.to_owned();
    let (step, data) = (width * channels, std::borrow::Cow::Borrowed(values));
    file_of(&Body::Raw { width, height, encoding, big_endian: false, step, data })
}
