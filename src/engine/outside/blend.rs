//! Frames from outside with several pictures. Each line is made from the three pictures that are nearest in time. Where
//! they show the same surface, they are read together, like one picture with finer texels. Elsewhere each counts by how
//! much of the surface it shows. Twin: `reference/outside_blend.rs`.

use crate::assert_push_layout;
use crate::engine::fast::pass::{FastTiming, lines_between};
use crate::engine::flight::Room;
use crate::error::Result;
use crate::gpu::{BindGroup, Bound, ComputePipeline, Format, Image, ImageSpec, Recorder, Sampler};
use crate::kernels::kernel;
use crate::reference::outside_blend::Push;

assert_push_layout!(
    "outside_blend.comp",
    Push { size, texels, pictures, scan_order, middle_s, readout_time_s, from_s, to_s, first }
);

/// Pictures that a line is made of.
const NEAREST: usize = 3;

/// Puts pictures together.
pub(super) struct Blend {
    kernel: ComputePipeline,
    /// Of the pictures from each one on, while there are enough.
    groups: Vec<BindGroup>,
    /// What each picture shows.
    pub(super) warped: Vec<Image>,
    _sampler: Sampler,
    size: [u32; 2],
    texels: [i32; 2],
}

impl Blend {
    /// Of pictures in order of time, two or more; nothing may be in flight.
    pub(super) fn new(room: &mut Room<'_>, colors: &[&Image]) -> Result<Self> {
        let (context, radiance) = (room.context, room.radiance);
        let size = radiance.spec().size;
        let spec = ImageSpec::storage(size, Format::Rgba32f);
        let warped = colors.iter().map(|_| Image::new(context, "outside warped", spec));
        let warped = warped.collect::<Result<Vec<_>>>()?;
        room.prepare(&warped)?;
        let kernel = ComputePipeline::new(context, const { kernel("outside_blend.comp") })?;
        let sampler = Sampler::new(context, false)?;
        let count = colors.len();
        let group = |first: usize| {
            let at = |i: usize| (first + i).min(count - 1);
            let (color, shown) = (
                |i: usize| Bound::Sampled(colors[at(i)], &sampler),
                |i: usize| Bound::Sampled(&warped[at(i)], &sampler),
            );
            kernel.bind(&[
                ("warped_0", shown(0)),
                ("warped_1", shown(1)),
                ("warped_2", shown(2)),
                ("color_0", color(0)),
                ("color_1", color(1)),
                ("color_2", color(2)),
                ("radiance", Bound::Storage(radiance)),
            ])
        };
        let groups = (0..=count.saturating_sub(NEAREST)).map(group).collect::<Result<Vec<_>>>()?;
        let texels = colors[0].spec().size.map(|s| s as i32);
        Ok(Self { kernel, groups, warped, _sampler: sampler, size, texels })
    }

    /// Writes the radiance; `windows`: of [`windows`].
    pub(super) fn record(&self, recorder: &mut Recorder<'_>, timing: &FastTiming, windows: &[[f64; 2]]) {
        recorder.mark("outside_blend");
        let shutter = &timing.shutter;
        let after = |t: f64| (t - timing.reference_s) as f32;
        for (group, [from_s, to_s]) in self.groups.iter().zip(windows) {
            let (first, size) = lines_between(shutter, self.size, [*from_s, *to_s]);
            let push = Push {
                size: self.size,
                texels: self.texels,
                pictures: self.warped.len().min(NEAREST) as u32,
                scan_order: shutter.scan_order as u32,
                middle_s: after(shutter.start_s + 0.5 * shutter.exposure_time_s),
                readout_time_s: shutter.readout_time_s as f32,
                from_s: after(*from_s),
                to_s: after(*to_s),
                first,
            };
            recorder.dispatch(&self.kernel, group, &push, size);
        }
    }
}

/// From when to when the lines are made of the three pictures from each on; `times_s`: of all pictures, rising;
/// `never_s`: before and after every line.
pub(super) fn windows(times_s: &[f64], never_s: [f64; 2]) -> Vec<[f64; 2]> {
    // Half way between the picture that goes and the one that comes.
    let borders = times_s.windows(NEAREST + 1).map(|t| 0.5 * (t[0] + t[NEAREST]));
    let borders: Vec<f64> = std::iter::once(never_s[0]).chain(borders).chain([never_s[1]]).collect();
    borders.windows(2).map(|pair| [pair[0], pair[1]]).collect()
}

/// From when to when a picture is needed.
pub(super) fn span_of(windows: &[[f64; 2]], picture: usize) -> [f64; 2] {
    let first = picture.saturating_sub(NEAREST - 1).min(windows.len() - 1);
    [windows[first][0], windows[picture.min(windows.len() - 1)][1]]
}
