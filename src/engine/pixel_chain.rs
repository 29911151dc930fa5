//! The pixel chain on its own: one radiance, developed many times with different settings. A fit of noise, tone or lens
//! needs no new render.

use std::sync::Arc;
use std::time::Duration;

use crate::chain::{Settings, View, Wanted};
use crate::effects;
use crate::engine::finish::Finish;
use crate::error::Result;
use crate::gpu::{Buffer, Context, Location, PassTime, Slot, Usage};
use crate::plane::Plane;
use crate::reference::chain::develop_on_host;

/// Longest time that one picture may take.
const LIMIT: Duration = Duration::from_secs(60);

/// Encoded values, and what is behind each filter of a mosaic.
type Kept = [Option<Plane<f32>>; 2];

/// Develops radiance on the device. Twin: [`crate::reference::chain`].
pub struct PixelChain {
    slot: Slot,
    finish: Finish,
    /// Radiance on its way up, pixels and floats on their way down.
    upload: Buffer,
    pixels: Buffer,
    floats: Buffer,
    size: [u32; 2],
}

impl PixelChain {
    /// A chain for pictures of that size.
    ///
    /// # Errors
    /// A size that the device cannot do, out of memory.
    pub fn new(context: &Arc<Context>, size: [u32; 2]) -> Result<Self> {
        let mut slot = Slot::new(context, "pixel chain")?;
        let finish = Finish::new(context, size, 1, &mut slot)?;
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let buffer =
            |name, bytes, location| Buffer::new(context, name, pixels * bytes, Usage::Transfer, location);
        Ok(Self {
            upload: buffer("radiance upload", 16, Location::Upload)?,
            pixels: buffer("picture", 4, Location::Readback)?,
            floats: buffer("values", 16, Location::Readback)?,
            slot,
            finish,
            size,
        })
    }

    /// Sets the radiance that is developed: linear, shape `[height, width, 4]`.
    ///
    /// # Errors
    /// Device lost.
    ///
    /// # Panics
    /// If the shape is another.
    pub fn load(&mut self, radiance: &Plane<f32>) -> Result<()> {
        let shape = [radiance.width, radiance.height, radiance.channels];
        assert_eq!(shape, [self.size[0] as usize, self.size[1] as usize, 4], "radiance");
        self.upload.write(0, &radiance.data);
        let mut recorder = self.slot.begin()?;
        recorder.copy_buffer_to_image(&self.upload, self.finish.radiance());
        recorder.finish();
        self.slot.submit()?;
        self.slot.wait(LIMIT)
    }

    /// The delivered picture, shape `[height, width, 3]`.
    ///
    /// # Errors
    /// Device lost, out of memory.
    ///
    /// # Panics
    /// If the view has another size.
    pub fn picture(&mut self, settings: &Settings, view: &View) -> Result<Plane<u8>> {
        self.run(settings, view, Wanted::PIXELS)?;
        let mut picture = self.rgb();
        develop_on_host(effects::LIST, settings, &mut picture);
        Ok(picture)
    }

    /// Encoded values before they are rounded to 8 bits, shape `[height, width, 4]`.
    ///
    /// # Errors
    /// Device lost, out of memory.
    ///
    /// # Panics
    /// If the view has another size.
    pub fn values(&mut self, settings: &Settings, view: &View) -> Result<Plane<f32>> {
        self.run(settings, view, Wanted::VALUES)?;
        let values: &[f32] = bytemuck::cast_slice(self.floats.mapped());
        let [width, height] = self.size.map(|s| s as usize);
        Ok(Plane { width, height, channels: 4, data: values[..width * height * 4].to_vec() })
    }

    /// The picture before `jpeg`, its encoded values and what is behind each filter of the mosaic
    /// ([`super::Frame::values`], [`super::Frame::raw`]), of one run.
    ///
    /// # Errors
    /// Device lost, out of memory.
    ///
    /// # Panics
    /// If the view has another size.
    pub fn finer(&mut self, settings: &Settings, view: &View) -> Result<(Plane<u8>, Kept)> {
        self.run(settings, view, Wanted { pixels: true, values: true, raw: true })?;
        Ok((self.rgb(), self.finish.take_kept(0, settings)))
    }

    /// Time of each pass of the last picture.
    ///
    /// # Errors
    /// Device lost.
    pub fn times(&self) -> Result<Vec<PassTime>> {
        self.slot.times()
    }

    fn rgb(&self) -> Plane<u8> {
        let rgb = self.pixels.mapped().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]);
        let [width, height] = self.size.map(|s| s as usize);
        Plane { width, height, channels: 3, data: rgb.take(width * height * 3).collect() }
    }

    fn run(&mut self, settings: &Settings, view: &View, wanted: Wanted) -> Result<()> {
        let size = [view.intrinsics.width, view.intrinsics.height];
        assert_eq!(size, self.size, "the view has the chain's size");
        self.finish.fit((settings, view), wanted, (&mut self.slot, 0))?;
        let mut recorder = self.slot.begin()?;
        self.finish.record_chain(&mut recorder, view.frame, view.seed);
        recorder.mark("readback");
        match wanted.pixels {
            false => recorder.copy_image_to_buffer(self.finish.output(), [0, 0], size, &self.floats),
            true => recorder.copy_buffer(self.finish.pixels(), &self.pixels, self.pixels.bytes()),
        }
        recorder.barrier();
        recorder.finish();
        self.slot.submit()?;
        self.slot.wait(LIMIT)
    }
}
