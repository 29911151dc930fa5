//! `--method exact`: the picture of a camera with a rolling shutter and an exposure from one render.
//!
//! The shutter is in the projection (`exact_place.comp`): each vertex is projected at the time of the line it lands on,
//! so one render has the right time in every line and nothing is resampled. The blur gathers from the supersampled
//! picture along the path of what is there over its line's exposure (`exact_gather.comp`).

mod blur;
mod cut;
mod cuts;
mod still;
mod times;
mod uncover;

use std::collections::HashMap;
use std::sync::Arc;

use crate::camera::{Intrinsics, ShutterTiming};
use crate::engine::flight::Room;
use crate::engine::frame::FrameRequest;
use crate::engine::scene::lens::Channel;
use crate::engine::scene::margin::larger;
use crate::engine::scene::{Choices, Renderer, Shot, Stage, covered_span_s};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Context, Location, Recorder, RenderArea, Usage};
use crate::raster::{
    Geometry, KnotRow, Mesh, MotionGroups, Place, PlacePush, RasterInput, RasterTarget, RelativeRow,
    SceneBuffers, View, relative_rows,
};
use blur::{Blur, Part, orientation};
use cut::Limits;
use cuts::{Cuts, Placeable, Source, Span};
use still::Still;
use times::{BlurReach, exposures, lines_of, measure_reach, place_push};
use uncover::Bounds;

/// Most knots of a frame.
const MAX_KNOTS: usize = 129;
/// Error of matrices taken for linear between knots, px.
const KNOT_ERROR_PX: f64 = 0.01;

/// Motion groups whose numbers, plus one, are exact in the half floats of the colour's alpha.
const MAX_GROUPS: usize = 2047;
/// Frames whose reach is kept.
const MAX_KEPT_REACHES: usize = 4096;

/// How the method renders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactOptions {
    /// Largest distance between a drawn edge and the curve that the shutter makes of it, px; twice that where blur
    /// hides it. Triangles are cut for it.
    pub chord_px: f64,
    /// Most triangles that cutting may make (the distance above is doubled until they suffice).
    pub most_triangles: u32,
}

impl Default for ExactOptions {
    fn default() -> Self {
        Self { chord_px: 0.05, most_triangles: 400_000 }
    }
}

/// The method.
struct Exact {
    still: Option<Still>,
    blur: Option<Blur>,
    place: Place,
    /// The knots of each frame in flight.
    knots: Vec<Buffer>,
    whole: Placeable,
    cuts: Cuts,
    mesh: Mesh,
    groups: MotionGroups,
    bounds: Bounds,
    /// By what frames were looked at already.
    known: HashMap<Key, BlurReach>,
    options: ExactOptions,
}

/// Everything that the reach of a frame's blur depends on, bit by bit.
type Key = ([u64; 3], bool);

/// The resources of a frame in flight in each set of images.
struct Input {
    raster: RasterInput,
    camera: Buffer,
    relative: Buffer,
}

impl Input {
    fn new(stage: &Stage, target: &RasterTarget, groups: usize) -> Result<Self> {
        let context: &Arc<Context> = &stage.context;
        let upload = |name: &str, bytes: usize| {
            Buffer::new(context, name, bytes as u64, Usage::Storage, Location::Upload)
        };
        let camera = Buffer::new(context, "exact camera", 16, Usage::Texels, Location::Upload)?;
        let lines = target.size[0].max(target.size[1]) as usize;
        let relative = upload("relatives", groups * lines * size_of::<RelativeRow>())?;
        let raster = target.bind_exact(&stage.buffers, &camera)?;
        Ok(Self { raster, camera, relative })
    }
}

impl Choices for ExactOptions {
    fn make(
        &self,
        stage: &Stage,
        room: &mut Room<'_>,
        expected: &[FrameRequest],
    ) -> Result<Box<dyn Renderer>> {
        let mut exact = Exact::new(stage, *self, room, expected)?;
        exact.expect(stage, room, expected)?;
        Ok(Box::new(exact))
    }

    /// Its own cut triangles.
    fn draws_instants(&self) -> bool {
        false
    }
}

impl Renderer for Exact {
    fn margin_px(&self) -> [u32; 2] {
        self.blur.as_ref().map_or([0; 2], |b| b.margin_px)
    }

    fn fits(&mut self, stage: &Stage, request: &FrameRequest) -> bool {
        !self.needs_cut(stage, request) && !self.needs_images(stage, request)
    }

    fn fit(&mut self, stage: &Stage, room: &mut Room<'_>, request: &FrameRequest) -> Result<()> {
        if self.needs_images(stage, request) {
            let have = self.margin_px();
            let BlurReach { margin_px: needed, uncovered, .. } = self.reach(stage, request);
            let uncovers = uncovered.is_some() || self.blur.as_ref().is_some_and(|b| b.uncover.is_some());
            self.make_images(stage, room, request, (larger(needed, have), uncovers))?;
        }
        self.fit_cut(stage, request)
    }

    fn forget_lens(&mut self) {
        self.cuts.forget();
        self.known.clear();
    }

    fn forget(&mut self) {
        self.forget_lens();
        (self.still, self.blur) = (None, None);
    }

    fn submit(&mut self, mut shot: Shot<'_>) -> Result<()> {
        let (stage, request, index) = (shot.stage, shot.request, shot.slot.index);
        let blurs = request.shutter.exposure_time_s > 0.0;
        let reach = self.reach(stage, request);
        let camera = stage.intrinsics.with_margin(if blurs { self.margin_px() } else { [0; 2] });
        let view = View { camera: &camera, path: shot.path };
        let (push, part) = self.write_inputs(stage, index, &view, &request.shutter, reach);
        let ending = shot.ending();
        let bent = push.knot_count > 1 || stage.lens.is_some();
        let seen = (span(request), reach.hides_chords());
        let cut = bent.then(|| self.cuts.of(seen, lines(request))).flatten();
        let drawn = Drawn { placeable: cut.unwrap_or(&self.whole), index, camera, push, part };
        shot.submit(&ending, false, |recorder, channel| {
            self.record(stage, recorder, &request.shutter, &drawn, channel);
        })
    }
}

/// What a frame is drawn from.
struct Drawn<'a> {
    placeable: &'a Placeable,
    /// The frame's slot.
    index: usize,
    /// With the margin.
    camera: Intrinsics,
    push: PlacePush,
    part: Part,
}

impl Exact {
    fn new(stage: &Stage, options: ExactOptions, room: &Room<'_>, expected: &[FrameRequest]) -> Result<Self> {
        let groups = MotionGroups::new(&stage.scene);
        if groups.count() > MAX_GROUPS {
            let why = "method exact keeps their numbers in half floats".to_owned();
            let (value, limit) = (groups.count() as u64, MAX_GROUPS as u64);
            return Err(Error::Limit { what: "number of objects that move", value, limit, why });
        }
        let scene = &stage.scene;
        let vertex = |i: u32| {
            let vertex = scene.vertices[i as usize];
            crate::scene::Vertex { object: groups.of_object(vertex.object), ..vertex }
        };
        let mesh = Mesh::joined(vertex, &scene.indices, &scene.draws);
        let place = Place::new(&stage.context, &stage.buffers)?;
        let knots = room.slots.iter().map(|_| {
            let bytes = groups.count() * MAX_KNOTS * size_of::<KnotRow>();
            Buffer::new(&stage.context, "knots", bytes as u64, Usage::StorageTexels, Location::Upload)
        });
        let knots = knots.collect::<Result<Vec<_>>>()?;
        Ok(Self {
            still: None,
            blur: None,
            whole: Placeable::new(stage, &place, &knots, &mesh)?,
            place,
            knots,
            cuts: Cuts::new(expected.iter().map(span).collect()),
            bounds: Bounds::new(&mesh, &groups),
            mesh,
            groups,
            known: HashMap::new(),
            options,
        })
    }

    /// Makes what frames like these need, once for all of them.
    fn expect(&mut self, stage: &Stage, room: &mut Room<'_>, expected: &[FrameRequest]) -> Result<()> {
        let (mut margin_px, mut uncovers) = ([0; 2], false);
        for request in expected {
            let reach = self.reach(stage, request);
            margin_px = [0, 1].map(|i| reach.margin_px[i].max(margin_px[i]));
            uncovers |= reach.uncovered.is_some();
        }
        if let Some(first) = expected.iter().find(|r| r.shutter.exposure_time_s > 0.0) {
            self.make_images(stage, room, first, (margin_px, uncovers))?;
        }
        if let Some(longest) = expected.iter().max_by(|a, b| readout_s(a).total_cmp(&readout_s(b))) {
            self.fit(stage, room, longest)?;
        }
        for request in expected {
            self.fit_cut(stage, request)?;
        }
        Ok(())
    }

    fn needs_cut(&mut self, stage: &Stage, request: &FrameRequest) -> bool {
        let bends = readout_s(request) > 0.0 || stage.lens.is_some();
        let seen = (span(request), self.reach(stage, request).hides_chords());
        bends && self.cuts.of(seen, lines(request)).is_none()
    }

    fn needs_images(&mut self, stage: &Stage, request: &FrameRequest) -> bool {
        if request.shutter.exposure_time_s <= 0.0 {
            return self.still.is_none();
        }
        let BlurReach { margin_px: needed, uncovered, .. } = self.reach(stage, request);
        let lacks = |b: &Blur| {
            uncovered.is_some() && b.uncover.is_none() || (0..2).any(|i| needed[i] > b.margin_px[i])
        };
        self.blur.as_ref().is_none_or(lacks)
    }

    fn fit_cut(&mut self, stage: &Stage, request: &FrameRequest) -> Result<()> {
        if !self.needs_cut(stage, request) {
            return Ok(());
        }
        let seen = (span(request), self.reach(stage, request).hides_chords());
        let limits = Limits { chord_px: self.options.chord_px, most: self.options.most_triangles as usize };
        let (place, knots, mesh, groups) = (&self.place, &self.knots[..], &self.mesh, &self.groups);
        let source = Source { place, knots, mesh, groups, limits };
        self.cuts.make(stage, &source, seen, lines(request))
    }

    fn make_images(
        &mut self,
        stage: &Stage,
        room: &mut Room<'_>,
        request: &FrameRequest,
        extent: ([u32; 2], bool),
    ) -> Result<()> {
        let count = self.groups.count();
        if request.shutter.exposure_time_s > 0.0 {
            // The old images go first: they are large.
            self.blur = None;
            self.blur = Some(Blur::new(stage, room, count, extent)?);
        } else {
            self.still = Some(Still::new(stage, room, count)?);
        }
        Ok(())
    }

    /// How far the blur of a frame reaches; kept, since frames are asked about more than once.
    fn reach(&mut self, stage: &Stage, request: &FrameRequest) -> BlurReach {
        let shutter = &request.shutter;
        let numbers = [shutter.start_s, shutter.exposure_time_s, shutter.readout_time_s];
        let key = (numbers.map(f64::to_bits), request.static_camera);
        if let Some(reach) = self.known.get(&key) {
            return *reach;
        }
        // A stream without end must not fill the memory.
        if self.known.len() >= MAX_KEPT_REACHES {
            self.known.clear();
        }
        let uncovered = self.bounds.uncover(stage, &self.groups, request);
        let reach = BlurReach { uncovered, ..measure_reach(stage, request) };
        self.known.insert(key, reach);
        reach
    }

    /// One colour of a frame.
    fn record(
        &self,
        stage: &Stage,
        recorder: &mut Recorder<'_>,
        shutter: &ShutterTiming,
        drawn: &Drawn<'_>,
        channel: Channel,
    ) {
        let Drawn { placeable, index, camera, part, .. } = drawn;
        let blurs = shutter.exposure_time_s > 0.0;
        let area = RenderArea { x: 0, y: 0, width: camera.width, height: camera.height };
        let scene = (&stage.buffers, &placeable.geometry);
        let lens = stage.lens_push(channel, [camera.width, camera.height]);
        let push = PlacePush { lens, ..drawn.push };
        if let (Some(blur), Some(area)) = (&self.blur, part.uncovered) {
            let knot_count = push.knot_count as usize;
            let pushes = uncover::INSTANTS
                .map(|tau| PlacePush { lens, ..place_push(camera, shutter, knot_count, tau) });
            self.draw_uncovered(recorder, blur, scene, (placeable, *index), &pushes, area);
        }
        recorder.mark("exact_place");
        self.place.record(recorder, &placeable.geometry, &placeable.groups[*index], &push);
        recorder.mark("raster");
        match (&self.blur, &self.still) {
            (Some(blur), _) if blurs => {
                blur.target.draw_exact(recorder, scene, &blur.inputs[*index].raster, area);
                blur.record(stage, recorder, *index, shutter, &Part { channel, ..*part });
            }
            (_, Some(still)) => {
                still.target.draw_exact(recorder, scene, &still.inputs[*index].raster, area);
                still.record(stage, recorder);
            }
            _ => unreachable!("`fit` made the images of this kind of frame"),
        }
    }

    /// The pictures of the begin and the end of the exposure.
    fn draw_uncovered(
        &self,
        recorder: &mut Recorder<'_>,
        blur: &Blur,
        scene: (&SceneBuffers, &Geometry),
        (placeable, slot): (&Placeable, usize),
        pushes: &[PlacePush; 2],
        area: RenderArea,
    ) {
        let Some(uncover) = &blur.uncover else { return };
        recorder.mark("exact_uncover");
        for (instant, push) in pushes.iter().enumerate() {
            self.place.record(recorder, &placeable.geometry, &placeable.groups[slot], push);
            uncover.draw(recorder, scene, (slot, instant), area);
        }
    }

    fn write_inputs(
        &mut self,
        stage: &Stage,
        slot: usize,
        view: &View<'_>,
        shutter: &ShutterTiming,
        reach: BlurReach,
    ) -> (PlacePush, Part) {
        let rolls = shutter.readout_time_s > 0.0 && shutter.line_count > 1;
        let times = if rolls || reach.uncovered.is_some() {
            self.groups.knot_times_s(view, (shutter.start_s, shutter.end_s()), KNOT_ERROR_PX, MAX_KNOTS)
        } else {
            vec![shutter.middle_s()]
        };
        let (rows, eye) = self.groups.knot_rows(view, &times);
        let blurs = shutter.exposure_time_s > 0.0;
        let input = match (&mut self.blur, &mut self.still) {
            (Some(blur), _) if blurs => &mut blur.inputs[slot],
            (_, Some(still)) => &mut still.inputs[slot],
            _ => unreachable!("`fit` made the images of this kind of frame"),
        };
        self.knots[slot].write(0, &rows);
        input.camera.write(0, &[eye]);
        let mut line_count = 1;
        if blurs {
            let exposures = exposures(view, shutter, times.len(), covered_span_s(stage, view.path));
            line_count = if rolls { lines_of(view.camera, shutter) as usize } else { 1 };
            let (_, reversed) = orientation(shutter.scan_order);
            input.relative.write(0, &relative_rows(&self.groups, view, &exposures, (line_count, reversed)));
        }
        let part = Part {
            line_count: line_count as u32,
            exposure_s: shutter.exposure_time_s,
            reach_px: reach.reach_px,
            uncovered: reach.uncovered_area(view.camera, self.margin_px()).filter(|_| blurs),
            channel: Channel::GREEN,
        };
        (place_push(view.camera, shutter, times.len(), 0.0), part)
    }
}

fn span(request: &FrameRequest) -> Span {
    (request.shutter.start_s, request.shutter.end_s())
}

fn lines(request: &FrameRequest) -> (f64, bool) {
    (readout_s(request), request.shutter.scan_order.lines_are_rows())
}

fn readout_s(request: &FrameRequest) -> f64 {
    request.shutter.readout_time_s
}
