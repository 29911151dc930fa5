//! The lens, for every method. It acts in the vertex stage (`lens.glsl`): each vertex is placed where the lens images
//! it on the sensor. So lines and motion are in the sensor's own coordinates, and the colour is not resampled.
//! Triangles are cut so that their straight edges stay near the curves that the lens makes of them.
//!
//! Lateral chromatic aberration draws the frame once for each colour, through a lens of that colour's magnification.

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3, Vec3};

use crate::assert_push_layout;
use crate::camera::{Distortion, ExtendedLens, Intrinsics, Lens, Pose};
use crate::chain::Settings;
use crate::effects::{ChromaticAberration, LensDistortion};
use crate::engine::flight::Room;
use crate::engine::frame::FrameRequest;
use crate::engine::scene::Stage;
use crate::error::Result;
use crate::gpu::{BindGroup, Bound, ComputePipeline, Format, Image, ImageSpec, Recorder};
use crate::kernels::kernel;
use crate::raster::{Drawn, Geometry, LensPush, Mesh, MotionGroups};
use crate::scene::Vertex;

/// Largest distance of an edge from its curve where every instant is drawn by itself, px.
const CHORD_PX: f64 = 0.03;
/// Most triangles that cutting may make; the distance above is doubled until they suffice.
const MAX_TRIANGLES: usize = 400_000;
/// Samples of the path over its span, and most of them in frames.
const PATH_SAMPLES: usize = 16;
const FRAME_SAMPLES: usize = 48;
/// Corners nearer to the picture's plane than this, or behind it, make an edge long, m.
const NEAREST_M: f64 = 0.1;

/// What the settings say of the lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensKey {
    distortion: Distortion,
    scales: [f64; 3],
}

impl LensKey {
    /// The model and its coefficients.
    pub(crate) fn distortion(&self) -> Distortion {
        self.distortion
    }

    /// Sizes of red, green and blue.
    pub(crate) fn scales(&self) -> [f64; 3] {
        self.scales
    }

    /// `None`: the ideal pinhole.
    pub(crate) fn of(settings: &Settings) -> Option<Self> {
        let key = Self {
            distortion: LensDistortion::distortion(settings),
            scales: ChromaticAberration::scales(settings),
        };
        (key.distortion != Distortion::None || key.scales != [1.0; 3]).then_some(key)
    }
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct MergePush {
    size: [u32; 2],
    channel: u32,
}
assert_push_layout!("chromatic_merge.comp", MergePush { size, channel });

/// One drawing of a frame: all of it, or what one colour sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Channel {
    /// Size against green.
    pub(crate) magnification: f64,
    /// The colour it is drawn for: 0, 1, 2.
    merge: Option<u32>,
}

/// A lens, and everything that depends on it.
pub(crate) struct LensStage {
    key: LensKey,
    /// Of the camera that it was made for.
    intrinsics: Intrinsics,
    pub(crate) extended: ExtendedLens,
    pub(crate) chords: Chords,
    /// Triangles for the methods that draw instants; made when first asked for.
    geometry: Option<Geometry>,
    merge: Option<Merge>,
}

/// Puts colours together that were made one after another.
pub(crate) struct Merge {
    group: BindGroup,
    kernel: ComputePipeline,
    _kept: Image,
}

impl LensStage {
    /// The lens of `key` for frames like `expected`.
    ///
    /// # Errors
    /// [`crate::Error::LensFolds`]; out of memory.
    pub(crate) fn new(
        stage: &Stage,
        key: LensKey,
        expected: &[FrameRequest],
        room: &mut Room<'_>,
    ) -> Result<Self> {
        let extended = ExtendedLens::new(Lens::new(stage.intrinsics, key.distortion)?);
        let groups = MotionGroups::new(&stage.scene);
        let frames: Vec<_> = expected.iter().map(|r| (r.shutter.start_s, r.shutter.end_s())).collect();
        let chords = Chords::new(stage, &groups, &extended, &frames);
        let merge = if key.scales == [1.0; 3] { None } else { Some(Merge::new(room)?) };
        Ok(Self { key, intrinsics: stage.intrinsics, extended, chords, geometry: None, merge })
    }

    /// Whether it is the lens of frames with these settings; of a camera with these intrinsics.
    pub(crate) fn is_of(&self, key: LensKey, intrinsics: &Intrinsics) -> bool {
        self.key == key && self.intrinsics == *intrinsics
    }

    /// Cuts the scene for methods that draw it as it stands.
    pub(crate) fn cut(&mut self, stage: &Stage) -> Result<()> {
        let scene = &stage.scene;
        let groups = MotionGroups::new(scene);
        let mesh = Mesh::joined(|i| scene.vertices[i as usize], &scene.indices, &scene.draws);
        let mut allowed_px = CHORD_PX;
        let cut = loop {
            let long = |a: &Vertex, b: &Vertex| {
                self.chords.is_long(groups.of_object(a.object) as usize, a, b, allowed_px)
            };
            match mesh.split(long, MAX_TRIANGLES.max(mesh.triangle_count())) {
                Some(cut) => break cut,
                None if allowed_px > 1e3 => break mesh,
                None => allowed_px *= 2.0,
            }
        };
        let to = cut.triangle_count();
        tracing::info!(
            "{} triangles cut into {to} for the lens: {allowed_px} px at most",
            scene.indices.len() / 3
        );
        self.geometry = Some(Geometry::new(&stage.context, &cut)?);
        Ok(())
    }
}

impl Merge {
    pub(crate) fn new(room: &mut Room<'_>) -> Result<Self> {
        let (context, radiance) = (room.context, room.radiance);
        let spec = ImageSpec::storage(radiance.spec().size, Format::Rgba32f);
        let kept = Image::new(context, "red and blue", spec)?;
        room.prepare([&kept])?;
        let kernel = ComputePipeline::new(context, const { kernel("chromatic_merge.comp") })?;
        let group =
            kernel.bind(&[("radiance", Bound::Storage(radiance)), ("kept", Bound::Storage(&kept))])?;
        Ok(Self { group, kernel, _kept: kept })
    }

    /// Keeps what was made for a colour: 0, 2, and at last 1, with which the others come back.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, size: [u32; 2], channel: u32) {
        recorder.mark("chromatic_merge");
        recorder.dispatch(&self.kernel, &self.group, &MergePush { size, channel }, size);
    }
}

impl Stage {
    /// The drawings that a frame needs, in order.
    pub(crate) fn channels(&self) -> Vec<Channel> {
        match &self.lens {
            Some(LensStage { merge: Some(_), key, .. }) => {
                [0, 2, 1].map(|c| Channel { magnification: key.scales[c], merge: Some(c as u32) }).to_vec()
            }
            _ => vec![Channel { magnification: 1.0, merge: None }],
        }
    }

    /// Scene, triangles and lens of a drawing.
    pub(crate) fn drawn(&self, channel: Channel) -> Drawn<'_> {
        Drawn {
            scene: &self.buffers,
            geometry: self.lens.as_ref().and_then(|l| l.geometry.as_ref()),
            lens: self.lens.as_ref().map(|l| (&l.extended, channel.magnification)),
        }
    }

    /// The lens of a drawing into an attachment of `size`, margin included.
    pub(crate) fn lens_push(&self, channel: Channel, size: [u32; 2]) -> LensPush {
        let push = |l: &LensStage| LensPush::new(&l.extended, size, channel.magnification);
        self.lens.as_ref().map_or(LensPush::NONE, push)
    }

    /// Keeps what a drawing left in the radiance, or puts the colours together after the last one.
    pub(crate) fn merge(&self, recorder: &mut Recorder<'_>, channel: Channel) {
        let merge = self.lens.as_ref().and_then(|l| l.merge.as_ref());
        if let (Some(merge), Some(colour)) = (merge, channel.merge) {
            let size = [self.intrinsics.width, self.intrinsics.height];
            merge.record(recorder, size, colour);
        }
    }
}

impl Channel {
    /// What the sharp planes show: green.
    pub(crate) const GREEN: Self = Self { magnification: 1.0, merge: None };
}

/// How far straight edges are from the curves that the lens makes of them.
pub(crate) struct Chords {
    /// Camera from motion group at each of the times that are looked at.
    poses: Vec<Vec<Pose>>,
    extended: ExtendedLens,
    focal_px: f64,
    /// Largest second derivative anywhere.
    most_bend: f64,
    /// Of all rays of ideal radius up to [`ExtendedLens::radius`].
    cone: Cone,
}

impl Chords {
    fn new(stage: &Stage, groups: &MotionGroups, extended: &ExtendedLens, frames: &[(f64, f64)]) -> Self {
        let path = &stage.trajectory;
        let stride = (3 * frames.len()).div_ceil(FRAME_SAMPLES).max(1);
        let mut times: Vec<f64> =
            frames.iter().step_by(stride).flat_map(|&(from, to)| [from, 0.5 * (from + to), to]).collect();
        let (from_s, to_s) = path.span_s();
        if from_s.is_finite() && to_s.is_finite() {
            let step_s = (to_s - from_s) / (PATH_SAMPLES - 1) as f64;
            times.extend((0..PATH_SAMPLES).map(|i| (from_s + step_s * i as f64).min(to_s)));
        }
        let poses = |group: usize| {
            let covered = times.iter().filter(|t| path.covers(**t, **t) && groups.covers(group, **t));
            covered
                .map(|&t| path.pose_at(t).inverse().then_from(&groups.world_from_object(group, t)))
                .collect()
        };
        let k: &Intrinsics = &stage.intrinsics;
        Self {
            poses: (0..groups.count()).map(poses).collect(),
            extended: extended.clone(),
            focal_px: k.fx.max(k.fy),
            most_bend: extended.bend(0.0, f64::INFINITY),
            cone: Cone::new(extended.radius().atan()),
        }
    }

    /// Whether an edge of that group is further from its curve than allowed, seen from any of the poses.
    pub(crate) fn is_long(&self, group: usize, a: &Vertex, b: &Vertex, allowed_px: f64) -> bool {
        let at_m = |v: &Vertex| Vec3::from(v.position_m).as_dvec3();
        let (a, b) = (at_m(a), at_m(b));
        let half_m = 0.5 * (b - a).length();
        let exceeds = |pose: &Pose| self.exceeds(pose.transform(a), pose.transform(b), half_m, allowed_px);
        self.poses[group].iter().any(exceeds)
    }

    /// Whether the chord between two camera points is off by more than allowed; what the lens's cone does not hold is
    /// not.
    fn exceeds(&self, a: DVec3, b: DVec3, half_m: f64, allowed_px: f64) -> bool {
        // Square of the normalised length up to which every chord is near enough.
        let harmless = 8.0 * allowed_px / (self.focal_px * self.most_bend);
        if a.z.min(b.z) < NEAREST_M {
            let length = 2.0 * half_m / NEAREST_M;
            return length * length > harmless && !self.cone.misses(0.5 * (a + b), half_m);
        }
        let flat = |p: DVec3| DVec2::new(p.x / p.z, p.y / p.z);
        let (from, to) = (flat(a), flat(b));
        let length_squared = (to - from).length_squared();
        if length_squared <= harmless || self.cone.misses(0.5 * (a + b), half_m) {
            return false;
        }
        let at = (-from.dot(to - from) / length_squared).clamp(0.0, 1.0);
        let low = from.lerp(to, at).length();
        if low > self.extended.radius() {
            return false;
        }
        let bend = self.extended.bend(low, from.length().max(to.length()));
        self.focal_px * bend * length_squared / 8.0 > allowed_px
    }
}

/// A cone around the camera's axis, of up to 90 degrees to either side.
pub(crate) struct Cone {
    sin: f64,
    cos: f64,
}

impl Cone {
    pub(crate) fn new(half_angle_rad: f64) -> Self {
        let (sin, cos) = half_angle_rad.min(std::f64::consts::FRAC_PI_2).sin_cos();
        Self { sin, cos }
    }

    /// Whether all of a ball lies outside; not certain for balls behind the camera, which may count as inside.
    pub(crate) fn misses(&self, middle: DVec3, radius_m: f64) -> bool {
        middle.truncate().length() * self.cos - middle.z * self.sin > radius_m
    }
}
