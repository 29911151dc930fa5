//! The engines, and what is kept of their work.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;

use crate::diagnose::evidence::quality::Quality;
use shutterbug::camera::ScanOrder;
use shutterbug::engine::{Engine, EngineOptions, ExactOptions, Frame, FrameRequest, Method};
use shutterbug::error::Result;
use shutterbug::plane::Plane;

/// Most bytes of larger pictures that are kept, and of delivered ones.
pub(super) const KEPT_BYTES: usize = 256 << 20;

/// The engines, by quality. An engine's pictures depend, in their last bits, on the frames before them (how triangles
/// are cut, how far images reach).
#[derive(Default)]
pub(crate) struct Engines {
    pub(crate) delivered: [Option<Engine>; 3],
    /// Of larger pictures, with the margin in px: what triangles are cut to differs by quality too.
    pub(crate) wide: [Option<(u32, Engine)>; 4],
}

impl Engines {
    /// As if nothing had been rendered.
    pub(crate) fn forget(&mut self) -> Result<()> {
        let wide = self.wide.iter_mut().flatten().map(|(_, engine)| engine);
        self.delivered.iter_mut().flatten().chain(wide).try_for_each(Engine::forget)
    }
}

/// What renders leave behind.
#[derive(Default)]
pub(crate) struct Bench {
    pub(crate) wide: Wide,
    pub(crate) cache: HashMap<Key, (u64, Arc<Plane<f32>>)>,
    pub(crate) developed: Developed,
    pub(crate) clock: u64,
}

impl Bench {
    /// All pictures go.
    pub(crate) fn clear(&mut self) {
        self.cache.clear();
        self.developed.clear();
        self.wide.kept.clear();
    }
}

/// Place, how well, times, order of lines, and the set-up and lens.
pub(crate) type Key = (usize, Quality, [u64; 3], ScanOrder, Vec<u64>);

/// Where every part of every pixel of the delivered picture is read in the wider one, px of the delivered one.
#[derive(Clone)]
pub(crate) struct Places {
    /// Parts a pixel, along each axis.
    pub(crate) parts: usize,
    pub(crate) at: Arc<Vec<[f32; 2]>>,
}

/// What is kept of the larger picture.
#[derive(Default)]
pub(crate) struct Wide {
    /// Px beyond each side.
    pub(crate) margin_px: u32,
    pub(crate) map: Option<(Vec<u64>, Places)>,
    /// Larger pictures by what they show, in the order of their last use.
    pub(crate) kept: HashMap<Key, (u64, Arc<Plane<f32>>)>,
    clock: u64,
}

impl Wide {
    /// As if nothing had been rendered, with a margin.
    pub(crate) fn begin(&mut self, margin_px: u32) {
        (self.map, self.margin_px) = (None, margin_px);
        self.kept.clear();
    }

    /// A larger picture that is kept.
    pub(crate) fn recall(&mut self, key: &Key) -> Option<Arc<Plane<f32>>> {
        self.clock += 1;
        let entry = self.kept.get_mut(key)?;
        entry.0 = self.clock;
        Some(entry.1.clone())
    }

    /// Keeps a larger picture, in the place of those that nobody has asked for longest.
    pub(crate) fn keep(&mut self, key: Key, plane: Arc<Plane<f32>>) {
        let most = (KEPT_BYTES / (4 * plane.data.len()).max(1)).max(1);
        while self.kept.len() >= most {
            let oldest = self.kept.iter().min_by_key(|(_, (used, _))| *used).map(|(key, _)| key.clone());
            self.kept.remove(&oldest.expect("not empty"));
        }
        self.clock += 1;
        self.kept.insert(key, (self.clock, plane));
    }
}

/// Place, how well it is rendered, whether by the engine's own lens, the frame's light, and the point.
pub(crate) type PictureKey = (usize, Quality, bool, u64, Vec<u64>);

/// By frame and draw: differences, DN.
pub(crate) type Flipped = Vec<Vec<Arc<Plane<f32>>>>;

/// Delivered pictures by what they show, with the time of their last use.
#[derive(Default)]
pub(crate) struct Developed {
    kept: HashMap<PictureKey, (u64, Arc<Plane<f32>>)>,
    clock: u64,
    /// By what they show, the last first.
    pub(crate) flipped: Vec<(String, Flipped)>,
}

impl Developed {
    pub(crate) fn clear(&mut self) {
        self.kept.clear();
        self.flipped.clear();
    }

    pub(crate) fn recall(&mut self, key: &PictureKey) -> Option<Arc<Plane<f32>>> {
        self.clock += 1;
        let entry = self.kept.get_mut(key)?;
        entry.0 = self.clock;
        Some(entry.1.clone())
    }

    /// Keeps a picture. Where there is no more room the half that nobody has asked for longest goes.
    pub(crate) fn keep(&mut self, key: PictureKey, plane: Arc<Plane<f32>>) {
        let most = (KEPT_BYTES / (4 * plane.data.len()).max(1)).max(8);
        if self.kept.len() >= most {
            let mut ages: Vec<u64> = self.kept.values().map(|(age, _)| *age).collect();
            let middle = ages.len() / 2;
            let oldest = *ages.select_nth_unstable(middle).1;
            self.kept.retain(|_, (age, _)| *age > oldest);
        }
        self.clock += 1;
        self.kept.insert(key, (self.clock, plane));
    }
}

/// How scenes are rendered.
pub(crate) fn options(quality: Quality) -> EngineOptions {
    // A thing right before the lens is cut into as many triangles as there may be, and vertices cost as much as pixels.
    let (samples, chord_px, most_triangles) = match quality {
        Quality::Coarse => (1, 0.4, 25_000),
        Quality::Fit => (4, 0.1, 100_000),
        Quality::Fine | Quality::Finest => (16, 0.05, 400_000),
    };
    EngineOptions {
        method: Method::Exact(ExactOptions { chord_px, most_triangles }),
        samples,
        // A second one is no faster (42 to 46 s, both ways, for a lens in 12 frames), and takes its images once more.
        frames_in_flight: 1,
        ..EngineOptions::default()
    }
}

/// Renders several frames; linear radiance, shape `[height, width, 3]`. Frames in four channels, which take a third
/// more, are never more than are in flight.
pub(super) fn in_flight(engine: &mut Engine, requests: &[FrameRequest]) -> Result<Vec<Plane<f32>>> {
    let mut tickets = VecDeque::new();
    let mut done = Vec::new();
    for request in requests {
        if tickets.len() == engine.frames_in_flight() {
            done.push(radiance(engine.collect(tickets.pop_front().expect("not empty"))?));
        }
        tickets.push_back(engine.submit(request)?);
    }
    for ticket in tickets {
        done.push(radiance(engine.collect(ticket)?));
    }
    Ok(done)
}

/// In place: four channels and three of a large picture would be as much again.
fn radiance(frame: Frame) -> Plane<f32> {
    let Plane { width, height, mut data, .. } = frame.radiance.expect("radiance was asked for");
    for i in 0..width * height {
        data.copy_within(4 * i..4 * i + 3, 3 * i);
    }
    data.truncate(3 * width * height);
    data.shrink_to_fit();
    Plane { width, height, channels: 3, data }
}
