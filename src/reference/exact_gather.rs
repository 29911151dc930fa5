//! `--method exact` with an exposure: the mean, over a line's exposure, of what passes each pixel. Twin of
//! `glsl/exact_gather.comp`.

use glam::{IVec2, Vec2, Vec3, Vec4};

use super::exact_neighbours::{Around, Way};
use super::exact_tiles::TILE;
use super::sample::sample_bilinear;
use crate::plane::Plane;

/// A place belongs to the pixel at an instant if its path leads it this near, px.
const HIT_PX: f32 = 0.75;
/// Half the distance of two bilinear samples that stand for a pixel's width, px; the kernel says why.
const SPREAD_PX: f32 = 0.14434;

/// A px of a path has a sample; of what is longer than this, px, every second one has.
const DENSE_PX: f32 = 12.0;

fn samples_of(length_px: f32) -> f32 {
    length_px.min(0.5 * (length_px + DENSE_PX))
}

/// What the kernel is told.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// RGB: linear radiance of the supersampled picture. A: unused.
    pub texels: &'a Plane<f32>,
    /// By pixel: inverse distance, 1/m.
    pub inverses: &'a Plane<f32>,
    /// By pixel: px from the middle of the line's exposure to its begin and its end.
    pub paths: &'a Plane<f32>,
    /// Linear radiance by pixel at the begin and at the end of each line's exposure, where there is.
    pub uncovered: Option<[&'a Plane<f32>; 2]>,
    /// From where to where these were drawn, as far as they can be read between pixels, px.
    pub drawn_px: [Vec2; 2],
    /// By tile.
    pub around: &'a [Around],
    /// px rendered beyond each side.
    pub margin_px: [usize; 2],
    /// Share of the exposure by which what is a px away is seen later.
    pub tau_per_px: Vec2,
    /// Most instants of a pixel.
    pub most: i32,
    /// Texels of a pixel's side.
    pub grid: usize,
}

/// Radiance of the delivered pixels, shape `[height, width, 4]`; alpha is the number of instants, negative where one
/// lay beyond the rendered picture.
///
/// # Panics
/// If shapes do not fit.
pub fn exact_gather(inputs: &Inputs<'_>) -> Plane<f32> {
    let [mx, my] = inputs.margin_px;
    let tiles_across = inputs.paths.width.div_ceil(TILE);
    Plane::from_fn(inputs.paths.width - 2 * mx, inputs.paths.height - 2 * my, |x, y| {
        let place = [x + mx, y + my];
        let tile = &inputs.around[place[1] / TILE * tiles_across + place[0] / TILE];
        let centre = Vec2::new(place[0] as f32, place[1] as f32) + 0.5;
        let mut gather = Gather { inputs, pixel: centre, line: inputs.tau_per_px.dot(centre), beyond: false };
        let (rgb, count) = match tile.way.expect("a tile of a delivered pixel") {
            Way::Resting => (gather.still(), 1.0),
            Way::Smooth => gather.smooth(),
            Way::Layered => gather.layers(tile),
        };
        [rgb.x, rgb.y, rgb.z, if gather.beyond { -count } else { count }]
    })
}

/// Displacement at tau (-0.5 to 0.5): the parabola through the three known points.
fn along(path: Vec4, tau: f32) -> Vec2 {
    let (begin, end) = (path.truncate().truncate(), Vec2::new(path.z, path.w));
    tau * (end - begin) + 2.0 * tau * tau * (end + begin)
}

struct Gather<'a> {
    inputs: &'a Inputs<'a>,
    pixel: Vec2,
    line: f32,
    beyond: bool,
}

impl Gather<'_> {
    fn picture_px(&self) -> Vec2 {
        Vec2::new(self.inputs.paths.width as f32, self.inputs.paths.height as f32)
    }

    fn spread_px(&self) -> f32 {
        if self.inputs.grid > 1 { SPREAD_PX } else { 0.0 }
    }

    fn note_beyond(&mut self, at: Vec2) {
        self.beyond |= at.cmplt(Vec2::ZERO).any() || at.cmpgt(self.picture_px()).any();
    }

    /// The pixel there, or the nearest in the picture.
    fn inside(&self, at: Vec2) -> [usize; 2] {
        let at: IVec2 = at.as_ivec2().clamp(IVec2::ZERO, self.picture_px().as_ivec2() - 1);
        [at.x as usize, at.y as usize]
    }

    fn path_at(&self, at: Vec2) -> Vec4 {
        let [x, y] = self.inside(at);
        Vec4::from_slice(self.inputs.paths.pixel(x, y))
    }

    fn inverse_at(&self, at: Vec2) -> f32 {
        let [x, y] = self.inside(at);
        self.inputs.inverses.pixel(x, y)[0]
    }

    fn radiance_at(&self, at: Vec2) -> Vec3 {
        sample_bilinear(self.inputs.texels, at * self.inputs.grid as f32, &mut false).truncate()
    }

    /// The instant at which a place's own line sees what the pixel's line sees at tau.
    fn own_tau(&self, at: Vec2, tau: f32) -> f32 {
        tau + self.line - self.inputs.tau_per_px.dot(at)
    }

    /// Where what is here at tau was in the picture: a fixed-point step.
    fn origin_of(&self, path: Vec4, tau: f32) -> Vec2 {
        let at = self.pixel - along(path, tau);
        self.pixel - along(self.path_at(at), self.own_tau(at, tau))
    }

    /// Mean of the pixel's box.
    fn still(&self) -> Vec3 {
        let q = if self.inputs.grid > 1 { 0.25 } else { 0.0 };
        let corners = [(-q, -q), (q, -q), (-q, q), (q, q)];
        let sum = corners.map(|(x, y)| self.radiance_at(self.pixel + Vec2::new(x, y)));
        0.25 * (sum[0] + sum[1] + sum[2] + sum[3])
    }

    /// One surface all around: the path backwards is a parabola through three of its points.
    fn smooth(&mut self) -> (Vec3, f32) {
        let own = self.path_at(self.pixel);
        let [begin, end] = [-0.5, 0.5].map(|tau| self.origin_of(own, tau) - self.pixel);
        self.note_beyond(self.pixel + begin);
        self.note_beyond(self.pixel + end);
        let way = (end - begin).abs();
        let side = self.spread_px() * if way.x > way.y { Vec2::Y } else { Vec2::X };
        let ahead = Vec2::splat(self.spread_px()) - side;
        let (even, odd) = (side + ahead, side - ahead);
        let wanted = (0.5 * samples_of(begin.length() + end.length())).ceil() as i32;
        let pairs = wanted.clamp(1, self.inputs.most / 2);
        let count = 2.0 * pairs as f32;
        let apart = if pairs == 2 { 1.0 } else { 1.0 / (1.0 - 1.0 / (count * count)).sqrt() };
        let step_tau = apart / count;
        let (linear, square) = (end - begin, 2.0 * (end + begin));
        let mut sum = Vec3::ZERO;
        for i in 0..pairs {
            let tau = (2.0 * i as f32 + 0.5) * step_tau - 0.5 * apart;
            let next = tau + step_tau;
            let first = self.pixel + tau * (linear + tau * square);
            let second = self.pixel + next * (linear + next * square);
            sum += self.radiance_at(first + even) + self.radiance_at(first - even);
            sum += self.radiance_at(second + odd) + self.radiance_at(second - odd);
        }
        (sum / (4 * pairs) as f32, count)
    }

    /// Several surfaces: at every instant the nearest place whose path leads here.
    fn layers(&mut self, tile: &Around) -> (Vec3, f32) {
        let seeds = [self.path_at(self.pixel), tile.near, tile.far];
        let length = |s: Vec4| s.truncate().truncate().length() + Vec2::new(s.z, s.w).length();
        let longest = seeds.map(length).into_iter().fold(0.0, f32::max);
        let count = 2 * ((0.5 * samples_of(longest)).ceil() as i32).clamp(2, self.inputs.most / 2);
        let mut sum = Vec3::ZERO;
        // The pixel's own path stands for that of the two which it is nearer to.
        let [to_near, to_far] = [1, 2].map(|i| (seeds[i] - seeds[0]).length_squared());
        let candidates = [seeds[0], if to_near > to_far { seeds[1] } else { seeds[2] }];
        for i in 0..count {
            let tau = (i as f32 + 0.5) / count as f32 - 0.5;
            let found = self.visible(&candidates, tau);
            let at = found.unwrap_or(self.pixel - along(seeds[1], tau));
            self.note_beyond(at);
            let aside = self.spread_px() * Vec2::new(if i % 2 == 0 { -1.0 } else { 1.0 }, 1.0);
            let uncovered = self.inputs.uncovered.filter(|_| found.is_none());
            sum += match uncovered.and_then(|pictures| self.uncovered(pictures, seeds[2], tau)) {
                Some(uncovered) => 2.0 * uncovered,
                None => self.radiance_at(at + aside) + self.radiance_at(at - aside),
            };
        }
        (sum / (2 * count) as f32, count as f32)
    }

    /// What is hidden at the middle and not now is what lies farthest: it is in view until the end, or from the begin
    /// on. `None` where it was not drawn.
    fn uncovered(&self, pictures: [&Plane<f32>; 2], path: Vec4, tau: f32) -> Option<Vec3> {
        let hidden = self.pixel - along(path, tau);
        let (picture, way) = match tau < 0.0 {
            true => (pictures[0], path.truncate().truncate()),
            false => (pictures[1], Vec2::new(path.z, path.w)),
        };
        let place = hidden + way;
        let [from, to] = self.inputs.drawn_px;
        let drawn = place.cmpge(from).all() && place.cmple(to).all();
        drawn.then(|| sample_bilinear(picture, place, &mut false).truncate())
    }

    /// The nearest of the candidates' places whose path leads here.
    fn visible(&self, candidates: &[Vec4; 2], tau: f32) -> Option<Vec2> {
        let (mut nearest, mut found) = (-1.0, None);
        for &candidate in candidates {
            let mut at = self.pixel - along(candidate, tau);
            at = self.pixel - along(self.path_at(at), self.own_tau(at, tau));
            let off = at + along(self.path_at(at), self.own_tau(at, tau)) - self.pixel;
            let inverse = self.inverse_at(at);
            if off.length_squared() < HIT_PX * HIT_PX && inverse > nearest {
                (nearest, found) = (inverse, Some(at));
            }
        }
        found
    }
}
