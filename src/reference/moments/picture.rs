//! The mean picture: from linear radiance to delivered values, in the list's order.

use super::clipped::clipped_mean;
use super::curve::{ANYWHERE, is_behind_encoding, switched_on};
use super::tone::Tone;
use crate::chain::{At, Effect, Moments, Packed, Parameters, Settings, Stage, View, Work, mixing, slot_of};
use crate::effects::LIST;
use crate::effects::jpeg::compressed;
use crate::effects::jpeg::grain::Grain;
use crate::effects::jpeg::packing::packed_mean;
use crate::plane::Plane;

type Twin = fn([f32; 3], &At<'_>, &Parameters<'_>) -> [f32; 3];

/// What is done to one pixel.
enum Job<'a> {
    Light(fn(&Parameters<'_>, &View, usize, &mut [f32]), Parameters<'a>),
    Affine([[f32; 2]; 3]),
    Twin(Twin, Parameters<'a>, u32),
    Steps,
    Colors([[f32; 3]; 3]),
    Encode,
}

/// Which pixels of a picture are looked at: one in `step` along each axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lattice {
    /// Row and column of the first, px.
    pub first: usize,
    /// From one to the next, px.
    pub step: usize,
}

impl Lattice {
    /// All of them.
    pub const WHOLE: Self = Self { first: 0, step: 1 };

    /// Along one axis: the pixels looked at, of a side of so many.
    pub fn along(self, side: usize) -> impl Iterator<Item = usize> + Clone {
        (self.first..side).step_by(self.step)
    }

    /// Side of a picture of which so many pixels are looked at along it, as far as the last of them.
    fn reach(self, count: usize) -> usize {
        self.first + self.step * count.saturating_sub(1) + 1
    }

    /// The pixels looked at, row by row, by number in a picture of so many columns and rows.
    pub fn places(self, [width, height]: [usize; 2]) -> impl Iterator<Item = usize> {
        self.along(height).flat_map(move |y| self.along(width).map(move |x| y * width + x))
    }

    /// The pixels looked at, as a smaller picture.
    #[must_use]
    pub fn of<T: Copy>(self, picture: &Plane<T>) -> Plane<T> {
        let (size, n) = ([picture.width, picture.height], picture.channels);
        let data = self.places(size).flat_map(|i| &picture.data[n * i..n * i + n]).copied().collect();
        let [width, height] = size.map(|side| self.along(side).count());
        Plane { width, height, channels: n, data }
    }
}

/// Whether a camera makes each pixel's mean of that pixel alone: nothing mixes neighbours.
#[must_use]
pub fn is_pointwise(settings: &Settings) -> bool {
    let mixes = |e: &dyn Effect| {
        matches!(e.moments(), Moments::File(_)) || matches!(e.work(), Work::Neighbourhood { .. })
    };
    !switched_on(settings).any(|e| matches!(e.stage(), Stage::Pixel(..)) && mixes(e))
}

/// Mean over the noise of the frames of a camera: DN (0 to 255, unrounded), shape `[height, width, 3]`. `linear`:
/// radiance of the same shape; `tone`: of `settings`, or of a camera that differs from it in nothing about single
/// values.
pub fn expected(linear: &Plane<f32>, settings: &Settings, view: &View, tone: &Tone) -> Plane<f32> {
    expected_on(linear, Lattice::WHOLE, settings, view, tone, &[])
}

/// [`expected`] of some of the pixels of a camera that [`is_pointwise`]; `linear`: radiance of those, see
/// [`Lattice::of`]. `stuck`: pixels that are stuck, by number row by row, where the camera has such and the whole
/// picture is looked at.
pub fn expected_on(
    linear: &Plane<f32>,
    on: Lattice,
    settings: &Settings,
    view: &View,
    tone: &Tone,
    stuck: &[usize],
) -> Plane<f32> {
    debug_assert!(on == Lattice::WHOLE || is_pointwise(settings), "neighbours are not there");
    let scan = Scan { on, view, tone };
    let packed = Packed::new(LIST, settings, view);
    let (mut picture, mut jobs, mut unit, mut mixed) = (linear.clone(), Vec::new(), 1.0, false);
    for effect in switched_on(settings) {
        if !matches!(effect.stage(), Stage::Pixel(..)) || tone.bent[1..].contains(&effect.id()) {
            continue;
        }
        if tone.bent[0] == effect.id() {
            let colors = tone.colors != [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            jobs.extend(colors.then_some(Job::Colors(tone.colors)));
            jobs.push(Job::Encode);
            continue;
        }
        let parameters = packed.parameters(slot_of(LIST, effect.id()));
        match (effect.moments(), effect.work()) {
            (Moments::Stuck, _) if on == Lattice::WHOLE && !stuck.is_empty() => {
                scan.done(&mut picture, &mut jobs, &mut unit);
                hold(&mut picture, stuck);
            }
            (Moments::Noise(_) | Moments::Stuck, _) => {}
            (Moments::Colors(_), _) if !is_behind_encoding(effect) => {}
            (Moments::Light(of), _) => jobs.push(Job::Light(of, parameters)),
            (Moments::Affine(of), _) => jobs.push(Job::Affine(single(of(settings, view)))),
            (Moments::Colors(of), _) => {
                // It makes values that the delivered picture cannot have.
                mixed = true;
                jobs.push(Job::Colors(single(of(settings))));
            }
            (Moments::Steps(_), _) => jobs.push(Job::Steps),
            (Moments::File(of), _) => {
                scan.done(&mut picture, &mut jobs, &mut unit);
                clip(&mut picture, tone, &mut mixed);
                picture = filed(&picture, tone, of(settings), settings);
            }
            (_, Work::Pointwise(twin)) => {
                mixed |= is_behind_encoding(effect);
                jobs.push(Job::Twin(twin, parameters, effect.variant(settings)));
            }
            (_, Work::Neighbourhood { reference, .. }) => {
                scan.done(&mut picture, &mut jobs, &mut unit);
                let of = |p: &Plane<f32>| reference(p, settings, &parameters);
                mixed |= unit > 1.0;
                picture = filtered(&picture, unit, tone, unit > 1.0 && lifts(effect, settings), of);
            }
            (_, Work::Elsewhere | Work::Host(_)) => {}
        }
    }
    scan.done(&mut picture, &mut jobs, &mut unit);
    clip(&mut picture, tone, &mut mixed);
    picture
}

/// In single precision.
fn single<const N: usize>(rows: [[f64; N]; 3]) -> [[f32; N]; 3] {
    rows.map(|row| row.map(|v| v as f32))
}

/// Whether a filter makes more of the noise of single pixels.
fn lifts(effect: &dyn Effect, settings: &Settings) -> bool {
    mixing(&[effect], settings).pixel[1] > 1.0
}

fn scaled(picture: &Plane<f32>, factor: f32) -> Plane<f32> {
    Plane { data: picture.data.iter().map(|v| factor * v).collect(), ..*picture }
}

/// Where the pixels of a picture are, and how values become delivered ones.
struct Scan<'a> {
    on: Lattice,
    view: &'a View,
    tone: &'a Tone,
}

impl Scan<'_> {
    /// Does what has been put together, a row at a time: one thing after the other is done to values that are at hand.
    /// `unit`: what full scale is, since values are DN behind the encoding here, and shares of full scale in twins.
    fn done(&self, picture: &mut Plane<f32>, jobs: &mut Vec<Job<'_>>, unit: &mut f32) {
        let view = self.view;
        let (width, source) = (picture.width, Plane::new(0, 0, 4));
        // Light is stated for whole rows.
        let mut light = vec![1.0; self.on.reach(width)];
        let across = || self.on.along(self.on.reach(width));
        let down = self.on.along(self.on.reach(picture.height));
        for (y, row) in down.zip(picture.data.chunks_exact_mut(3 * width)) {
            let mut unit = *unit;
            for job in jobs.iter() {
                let pixels = row.chunks_exact_mut(3);
                match job {
                    Job::Light(of, parameters) => {
                        of(parameters, view, y, &mut light);
                        let light = light[self.on.first..].iter().step_by(self.on.step);
                        pixels.zip(light).for_each(|(p, light)| p.iter_mut().for_each(|v| *v *= light));
                    }
                    Job::Affine(of) => {
                        pixels.for_each(|p| (0..3).for_each(|c| p[c] = of[c][0] * p[c] + of[c][1]))
                    }
                    Job::Colors(of) => pixels.for_each(|p| {
                        let v = of.map(|w| w[0] * p[0] + w[1] * p[1] + w[2] * p[2]);
                        p.copy_from_slice(&v);
                    }),
                    Job::Encode => {
                        self.tone.encode(row);
                        unit = 255.0;
                    }
                    Job::Steps => pixels.for_each(|p| (0..3).for_each(|c| p[c] = self.tone.stepped(p[c], c))),
                    Job::Twin(twin, parameters, variant) => across().zip(pixels).for_each(|(x, p)| {
                        let at = At { pixel: [x as u32, y as u32], view, source: &source, variant: *variant };
                        let seen = twin([p[0] / unit, p[1] / unit, p[2] / unit], &at, parameters);
                        (0..3).for_each(|c| p[c] = seen[c] * unit);
                    }),
                }
            }
        }
        if jobs.iter().any(|job| matches!(job, Job::Encode)) {
            *unit = 255.0;
        }
        jobs.clear();
    }
}

/// A picture whose full scale is `unit`, DN or 1, as a filter leaves it.
fn filtered(
    before: &Plane<f32>,
    unit: f32,
    tone: &Tone,
    lifts: bool,
    of: impl Fn(&Plane<f32>) -> Plane<f32>,
) -> Plane<f32> {
    let mut picture = of(&scaled(before, 1.0 / unit));
    if unit > 1.0 {
        picture.data.iter_mut().for_each(|v| *v *= unit);
        clipped(&mut picture, before, tone, lifts);
    }
    picture
}

/// Holds pixels (by number) at full scale or above, as filters behind the sensor find them.
fn hold(picture: &mut Plane<f32>, stuck: &[usize]) {
    for i in stuck {
        picture.data[3 * i..3 * i + 3].iter_mut().for_each(|v| *v = v.max(1.0));
    }
}

/// Clips values to those that the delivered picture can have. Where colours have been made of noisy ones that moves the
/// mean; a filter that lifts noise has done so already.
fn clip(picture: &mut Plane<f32>, tone: &Tone, mixed: &mut bool) {
    if !std::mem::take(mixed) {
        return;
    }
    if !tone.shows_width_behind() {
        return picture.data.iter_mut().for_each(|v| *v = v.clamp(0.0, 255.0));
    }
    for colour in picture.data.chunks_exact_mut(3) {
        let widths = [0, 1, 2].map(|c| tone.open_spread_of(colour, c).width());
        for c in 0..3 {
            colour[c] = clipped_mean(colour[c], widths[c]).clamp(0.0, 255.0);
        }
    }
}

/// A filter that lifts noise makes values that the delivered picture cannot have: that moves the mean.
fn clipped(picture: &mut Plane<f32>, before: &Plane<f32>, tone: &Tone, lifts: bool) {
    if !tone.is_noisy() || !lifts {
        return;
    }
    for (i, v) in picture.data.iter_mut().enumerate() {
        let spread = tone.open_spread_of(&before.data[i - i % 3..i - i % 3 + 3], i % 3);
        *v = clipped_mean(*v, (spread.free + spread.fixed).sqrt());
    }
}

/// A picture without noise ahead of a coarse converter, DN as it would be delivered, shape `[height, width, 3]`: the
/// mean that is delivered behind the converter. Of a camera whose steps are kept ([`Tone::keeps_steps`]).
pub fn through_converter(picture: &Plane<f32>, tone: &Tone) -> Plane<f32> {
    let mut picture = picture.clone();
    for row in picture.data.chunks_exact_mut(3 * picture.width) {
        for (i, v) in row.iter_mut().enumerate() {
            *v = tone.whole[i % 3] * tone.stepped(tone.in_steps(*v, i % 3) * tone.step, i % 3);
        }
        tone.encode(row);
    }
    picture
}

/// A picture of mean delivered values, DN, shape `[height, width, 3]`, as its file delivers it; the same where the
/// camera of `settings` compresses nothing.
pub fn through_file(picture: &Plane<f32>, settings: &Settings, tone: &Tone) -> Plane<f32> {
    let quality = switched_on(settings).find_map(|effect| match effect.moments() {
        Moments::File(of) => Some(of(settings)),
        _ => None,
    });
    quality.map_or_else(|| picture.clone(), |quality| filed(picture, tone, quality, settings))
}

/// Through the file.
fn filed(picture: &Plane<f32>, tone: &Tone, quality: u8, settings: &Settings) -> Plane<f32> {
    if !tone.is_noisy() {
        return compressed(picture, quality);
    }
    let spread = |i: usize| tone.spread_of(&picture.data[i - i % 3..i - i % 3 + 3], i % 3);
    let each = |i: usize| {
        let spread = spread(i);
        (spread.free + spread.fixed, spread.row)
    };
    let (variance, rows): (Vec<f32>, Vec<f32>) = (0..picture.data.len()).map(each).unzip();
    packed_mean(picture, &variance, &rows, quality, &Grain::of(settings))
}

/// A picture, shape `[height, width, 3]`, behind the steps of a camera that mix its pixels, and no others.
#[doc(hidden)]
pub fn mixed(picture: &Plane<f32>, settings: &Settings) -> Plane<f32> {
    let packed = Packed::new(LIST, settings, &ANYWHERE);
    let mixes = |e: &&dyn Effect| e.moments().mixes();
    switched_on(settings).filter(mixes).fold(picture.clone(), |picture, effect| {
        let Work::Neighbourhood { reference, .. } = effect.work() else { return picture };
        reference(&picture, settings, &packed.parameters(slot_of(LIST, effect.id())))
    })
}
