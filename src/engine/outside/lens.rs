//! Effects that a frame from outside was rendered without: lens distortion, lateral colour, a focal length that differs
//! from the nominal one, a camera that is mounted askew. All of them change where a pixel looks. So they act in the
//! warp, which reads the colour once for all of them. They also decide how large the picture's margin must be.

use glam::{DQuat, DVec2, DVec3};

use crate::camera::{ExtendedLens, Intrinsics, Lens, Pose, ShutterTiming, Trajectory};
use crate::chain::Settings;
use crate::effects::{FocalLengthError, PoseOffset};
use crate::engine::scene::lens::LensKey;
use crate::error::Result;

/// Where nothing is shown, px: no picture is as large.
const NOWHERE_PX: f32 = -1e6;
/// Distance of the border's places that are looked at, px.
const BORDER_STEP_PX: usize = 8;

/// What the settings say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutsideLens {
    key: Option<LensKey>,
    /// The pinhole that the frame is taken with.
    camera: Intrinsics,
    /// The true camera within the nominal one.
    turn: DQuat,
}

impl OutsideLens {
    /// `None`: nothing but the nominal pinhole.
    pub fn of(settings: &Settings, nominal: &Intrinsics) -> Option<Self> {
        let camera = FocalLengthError::apply(settings, nominal);
        let own = Self { key: LensKey::of(settings), camera, turn: PoseOffset::rotation(settings) };
        (own != Self { key: None, camera: *nominal, turn: DQuat::IDENTITY }).then_some(own)
    }

    /// Sizes of red, green and blue; one where they are alike.
    pub(super) fn scales(&self) -> Vec<f64> {
        match self.key.map_or([1.0; 3], |k| k.scales()) {
            [r, g, b] if r == g && g == b => vec![r],
            scales => scales.to_vec(),
        }
    }

    /// Its rays.
    ///
    /// # Errors
    /// [`crate::Error::LensFolds`].
    pub(super) fn rays(&self) -> Result<Rays> {
        let distortion = self.key.map_or(crate::camera::Distortion::None, |k| k.distortion());
        let lens = ExtendedLens::new(Lens::new(self.camera, distortion)?);
        Ok(Rays { lens: Some(lens), camera: self.camera, turn: self.turn })
    }
}

/// Where pixels look.
pub(super) struct Rays {
    /// `None`: a pinhole.
    lens: Option<ExtendedLens>,
    camera: Intrinsics,
    turn: DQuat,
}

impl Rays {
    /// Those of a pinhole.
    pub(super) fn pinhole(camera: &Intrinsics) -> Self {
        Self { lens: None, camera: *camera, turn: DQuat::IDENTITY }
    }

    fn centre(&self) -> DVec2 {
        DVec2::new(self.camera.cx, self.camera.cy)
    }

    /// Direction in the nominal camera in which a place of the sensor looks, in a colour of that size.
    pub(super) fn ray(&self, sensor_px: DVec2, scale: f64) -> DVec3 {
        let Some(extended) = &self.lens else { return self.turn * self.camera.ray(sensor_px) };
        let centre = self.centre();
        let mut at = centre + (sensor_px - centre) / scale;
        // Red or blue may look a px beyond what the lens is known for: then the nearest ray that there is.
        let ideal = loop {
            match extended.lens().undistort_px(at) {
                Some(ideal) => break ideal,
                None => at = centre + (at - centre) * 0.999,
            }
        };
        self.turn * self.camera.ray(ideal)
    }

    /// Where the sensor shows a direction of the nominal camera, px.
    fn shows(&self, direction: DVec3, scale: f64) -> Option<DVec2> {
        let own = self.turn.conjugate() * direction;
        let at = match &self.lens {
            Some(lens) => lens.project(own)?,
            None => self.camera.project(own)?,
        };
        Some(self.centre() + (at - self.centre()) * scale)
    }

    /// By pixel of the result where it looks in the nominal picture `wider` (its margin included), and by pixel of that
    /// picture where the sensor shows it: two floats each, px.
    pub(super) fn tables(&self, wider: &Intrinsics, scale: f64) -> [Vec<[f32; 2]>; 2] {
        let (width, height) = (self.camera.width, self.camera.height);
        let centre_of = |x: usize, y: usize| DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        let ideal = table([width, height], |x, y| {
            let seen = wider.project(self.ray(centre_of(x, y), scale));
            seen.map_or([NOWHERE_PX; 2], |p| [p.x as f32, p.y as f32])
        });
        let sensed = table([wider.width, wider.height], |x, y| {
            let shown = self.shows(wider.ray(centre_of(x, y)), scale);
            shown.map_or([NOWHERE_PX; 2], |p| [p.x as f32, p.y as f32])
        });
        [ideal, sensed]
    }

    /// Places along the border of the sensor, px.
    fn border(&self) -> Vec<DVec2> {
        let (w, h) = (self.camera.width as usize, self.camera.height as usize);
        let along = |side: usize| (0..side).step_by(BORDER_STEP_PX).chain([side - 1]).map(|i| i as f64 + 0.5);
        let row = |y: f64| along(w).map(move |x| DVec2::new(x, y));
        let rows = row(0.5).chain(row(h as f64 - 0.5));
        let columns = along(h).flat_map(|y| [DVec2::new(0.5, y), DVec2::new(w as f64 - 0.5, y)]);
        rows.chain(columns).collect()
    }
}

/// On this thread alone: those of a pool are not there in a forked child.
fn table(size: [u32; 2], entry: impl Fn(usize, usize) -> [f32; 2]) -> Vec<[f32; 2]> {
    let [width, height] = size.map(|s| s as usize);
    (0..width * height).map(|i| entry(i % width, i / width)).collect()
}

/// Where the border of the sensor looks: what margins are reckoned from. A lens is inverted there, so frames of one
/// camera share it.
pub struct BorderRays {
    nominal: Intrinsics,
    lens: Option<OutsideLens>,
    /// Places, px, and the ray of each colour there.
    places: Vec<(DVec2, Vec<DVec3>)>,
}

impl BorderRays {
    /// Of a camera whose pictures are rendered with the pinhole `nominal`, without margin, and without `lens`.
    ///
    /// # Errors
    /// [`crate::Error::LensFolds`].
    pub fn new(nominal: &Intrinsics, lens: Option<&OutsideLens>) -> Result<Self> {
        let (rays, scales) = match lens {
            Some(lens) => (lens.rays()?, lens.scales()),
            None => (Rays::pinhole(nominal), vec![1.0]),
        };
        let of = |px: DVec2| (px, scales.iter().map(|&scale| rays.ray(px, scale)).collect());
        Ok(Self {
            nominal: *nominal,
            lens: lens.copied(),
            places: rays.border().into_iter().map(of).collect(),
        })
    }

    /// Whether it is that of such a camera.
    pub(super) fn is_of(&self, nominal: &Intrinsics, lens: Option<&OutsideLens>) -> bool {
        self.nominal == *nominal && self.lens.as_ref() == lens
    }
}

/// Columns and rows that a picture must hold beyond each side, so that nothing that is read lies beyond it.
pub struct MarginNeed<'a> {
    /// Where the sensor's border looks.
    pub border: &'a BorderRays,
    /// Nothing that comes in at the border is nearer than this, m; infinite: only turns are reckoned with.
    pub nearest_m: f64,
}

impl MarginNeed<'_> {
    /// What lies where the camera sees `ray` while it stands at `moved` from where the picture was rendered.
    fn beyond(&self, moved: &Pose, ray: DVec3, most: &mut DVec2) {
        let nominal = &self.border.nominal;
        let size = DVec2::new(f64::from(nominal.width), f64::from(nominal.height));
        let far = moved.rotation * ray;
        let near = far + moved.translation_m / self.nearest_m;
        for point in [far, near] {
            let beyond = match nominal.project(point) {
                Some(p) => (0.5 - p).max(p - (size - 0.5)),
                None => size,
            };
            *most = most.max(beyond);
        }
    }

    fn whole(most: DVec2) -> [u32; 2] {
        // A rounding of the last digits asks for no column of its own.
        most.to_array().map(|px| (px - 1e-3).ceil().clamp(0.0, 1e6) as u32)
    }

    /// For a frame whose poses are known, from pictures of these instants.
    ///
    /// # Panics
    /// If there is no picture, or the poses do not cover the frame and all of them.
    pub fn of_frame(&self, path: &Trajectory, pictures_s: &[f64], shutter: &ShutterTiming) -> [u32; 2] {
        let colors: Vec<_> = pictures_s.iter().map(|&t| (t, path.pose_at(t))).collect();
        let order = shutter.scan_order;
        let (w, h) = (self.border.nominal.width, self.border.nominal.height);
        let count = f64::from(order.line_count(w, h));
        let mut most = DVec2::ZERO;
        // Places of one line follow each other.
        let (mut of_s, mut moved) = ([f64::NAN; 3], [Pose::IDENTITY; 3]);
        for (px, rays) in &self.border.places {
            let line = f64::from(order.line_of(px.x as u32, px.y as u32, w, h));
            let start_s = shutter.start_s + shutter.readout_time_s * line / count;
            for (i, share) in [0.0, 0.5, 1.0].into_iter().enumerate() {
                let time_s = (start_s + share * shutter.exposure_time_s).min(shutter.end_s());
                if time_s != of_s[i] {
                    // Every line has the border of the picture that is nearest in time.
                    let away = |t: &f64| (t - time_s).abs();
                    let nearest = colors.iter().min_by(|a, b| away(&a.0).total_cmp(&away(&b.0)));
                    let (_, color) = nearest.expect("a picture");
                    (of_s[i], moved[i]) = (time_s, color.relative(&path.pose_at(time_s)));
                }
                rays.iter().for_each(|ray| self.beyond(&moved[i], *ray, &mut most));
            }
        }
        Self::whole(most)
    }

    /// For any motion that turns by no more than `angle_rad` and moves by no more than `distance_m` between the colour
    /// and any line.
    pub fn of_bound(&self, angle_rad: f64, distance_m: f64) -> [u32; 2] {
        let steps = [-1.0, 0.0, 1.0];
        let every =
            steps.iter().flat_map(|&x| steps.iter().flat_map(move |&y| steps.map(|z| DVec3::new(x, y, z))));
        let ways: Vec<_> = every.map(|v| v.normalize_or_zero()).collect();
        let mut most = DVec2::ZERO;
        for turn in &ways {
            let rotation = DQuat::from_scaled_axis(*turn * angle_rad);
            for way in &ways {
                let moved = Pose { rotation, translation_m: *way * distance_m };
                for ray in self.border.places.iter().flat_map(|(_, rays)| rays) {
                    self.beyond(&moved, *ray, &mut most);
                }
            }
        }
        Self::whole(most)
    }
}
