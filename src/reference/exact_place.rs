//! `--method exact`: where the camera sees a vertex at the time of the line that the vertex lands on. Twin of
//! `glsl/exact_place.comp`.

use glam::{Mat3, Mat4, Vec2, Vec3, Vec4};

/// Push constants of the kernel, lens aside.
#[derive(Clone, Copy, Debug)]
pub struct Push {
    /// Rows a motion group; 1: an instant.
    pub knot_count: u32,
    /// Earliest and latest place in time, in knots.
    pub place_low: f32,
    /// See `place_low`.
    pub place_high: f32,
    /// Place of the line through a point of the picture: `dot(place_from_ndc, ndc) + place_offset`.
    pub place_from_ndc: Vec2,
    /// See `place_from_ndc`.
    pub place_offset: f32,
    /// Nearest distance that is drawn, m.
    pub near_m: f32,
}

/// A motion group at one of the knots.
#[derive(Clone, Copy, Debug)]
pub struct Knot {
    /// Projection.
    pub clip_from_object: Mat4,
    /// World moved so that a fixed camera is its origin.
    pub centred_from_object: Mat4,
    /// The camera in that world, m.
    pub eye_m: Vec3,
}

/// A vertex as the scene has it.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// In its object's frame, m.
    pub position_m: Vec3,
    /// In its object's frame.
    pub normal: Vec3,
    /// Motion group.
    pub group: u32,
}

/// What the vertex stage reads of it.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// x, y and w of clip space; z is the near distance for every vertex.
    pub clip_xyw: Vec3,
    /// In the centred world, m.
    pub position_m: Vec3,
    /// In the world, as long as it was.
    pub normal: Vec3,
    /// Camera at that time, m.
    pub eye_m: Vec3,
}

/// Steps of the search.
const STEPS: usize = 3;

/// Places one vertex. `lens` takes clip space of the ideal picture to that of the sensor.
///
/// # Panics
/// If the vertex's group has no knots.
pub fn exact_place(push: &Push, knots: &[Knot], vertex: &Vertex, lens: &dyn Fn(Vec4) -> Vec4) -> Placed {
    let first = (vertex.group * push.knot_count) as usize;
    let search = Search { push, knots: &knots[first..first + push.knot_count as usize], lens };
    let position = vertex.position_m.extend(1.0);
    if push.knot_count == 1 {
        let knot = &search.knots[0];
        return placed(lens(knot.clip_from_object * position), knot, position, vertex.normal);
    }
    let place = search.own_place(position);
    let (k, weight) = search.between(place);
    let (a, b) = (&search.knots[k], &search.knots[k + 1]);
    let knot = Knot {
        clip_from_object: Mat4::IDENTITY,
        centred_from_object: a.centred_from_object + (b.centred_from_object - a.centred_from_object) * weight,
        eye_m: a.eye_m + weight * (b.eye_m - a.eye_m),
    };
    placed(search.project(place, position), &knot, position, vertex.normal)
}

fn placed(clip: Vec4, knot: &Knot, position: Vec4, normal: Vec3) -> Placed {
    Placed {
        clip_xyw: Vec3::new(clip.x, clip.y, clip.w),
        position_m: (knot.centred_from_object * position).truncate(),
        normal: Mat3::from_mat4(knot.centred_from_object) * normal,
        eye_m: knot.eye_m,
    }
}

struct Search<'a> {
    push: &'a Push,
    knots: &'a [Knot],
    lens: &'a dyn Fn(Vec4) -> Vec4,
}

impl Search<'_> {
    /// The knot before a place, and how far beyond it the place is; outside, the last two go on.
    fn between(&self, place: f32) -> (usize, f32) {
        let k = (place.floor() as i32).clamp(0, self.knots.len() as i32 - 2) as usize;
        (k, place - k as f32)
    }

    fn project(&self, place: f32, position: Vec4) -> Vec4 {
        let (k, weight) = self.between(place);
        let before = self.knots[k].clip_from_object * position;
        let after = self.knots[k + 1].clip_from_object * position;
        (self.lens)(before + weight * (after - before))
    }

    /// Place of the line that a point falls on; what is behind the camera counts as just in front of it.
    fn place_of_line(&self, clip: Vec4) -> f32 {
        let ndc = Vec2::new(clip.x, clip.y) / clip.w.max(self.push.near_m);
        let place = self.push.place_from_ndc.dot(ndc) + self.push.place_offset;
        place.clamp(self.push.place_low, self.push.place_high)
    }

    /// The place at which the vertex is seen by the line of that place: secant steps from the middle knot.
    fn own_place(&self, position: Vec4) -> f32 {
        let middle = (self.knots.len() - 1) / 2;
        let mut last = middle as f32;
        let mut last_line = self.place_of_line((self.lens)(self.knots[middle].clip_from_object * position));
        let mut place = last_line;
        for _ in 1..STEPS {
            let line = self.place_of_line(self.project(place, position));
            let step = place - last;
            let slope = if step.abs() > 1e-6 { ((line - last_line) / step).clamp(-0.8, 0.8) } else { 0.0 };
            (last, last_line) = (place, line);
            place = (place + (line - place) / (1.0 - slope)).clamp(self.push.place_low, self.push.place_high);
        }
        place
    }
}
