//! `flat-fields`: what a simulated sensor delivers under even light and in the dark, as the public `emva1288` package
//! reads it: 16-bit PNG of one channel and the descriptor that lists them (EMVA 1288, release 4.0: two pictures for
//! each exposure time with light and two without, and a series of each at half saturation). The chain's own kernels
//! make them.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, ensure};
use image::{ImageBuffer, Luma};
use shutterbug::camera::{Intrinsics, ShutterTiming};
use shutterbug::capture::CameraFile;
use shutterbug::chain::{Settings, Value, View};
use shutterbug::effects;
use shutterbug::engine::PixelChain;
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, Validation};
use shutterbug::plane::{Plane, srgb_decode};

/// What is taken.
#[derive(clap::Args)]
pub struct Args {
    /// The sensor: a camera.toml without effects behind its converter.
    #[arg(long)]
    camera: PathBuf,
    /// The folder to write; made if absent.
    #[arg(long)]
    out: PathBuf,
    /// Longest exposure time, s; the others are equal parts of it.
    #[arg(long, default_value_t = 0.1)]
    longest_s: f64,
    /// Radiance under which the longest exposure gives so much (1 = white).
    #[arg(long, default_value_t = 1.1)]
    brightest: f64,
    /// Number of exposure times.
    #[arg(long, default_value_t = 40)]
    steps: u32,
    /// Pictures of each spatial series.
    #[arg(long, default_value_t = 60)]
    series: u32,
    /// Photons an electron takes, for the descriptor.
    #[arg(long, default_value_t = 2.0)]
    photons_per_electron: f64,
    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The device, as in `shutterbug simulate`.
    #[arg(long)]
    device: Option<String>,
}

/// A simulated sensor on a bench.
struct Bench<'a> {
    chain: PixelChain,
    view: View,
    settings: Settings,
    /// Number of steps of the converter.
    largest: f64,
    args: &'a Args,
}

impl Bench<'_> {
    /// Takes `count` pictures; returns their lines in the descriptor.
    fn take(&mut self, exposure_s: f64, light: bool, count: u32) -> Result<String> {
        let args = self.args;
        let radiance = if light { args.brightest * exposure_s / args.longest_s } else { 0.0 };
        let [width, height] = [self.view.intrinsics.width, self.view.intrinsics.height];
        let level = radiance as f32;
        let flat = Plane::from_fn(width as usize, height as usize, |_, _| [level, level, level, 1.0]);
        self.chain.load(&flat)?;
        let ns = exposure_s * 1e9;
        let well = self.settings.number("shot_noise", "full_well_e", 0.0);
        let photons = radiance * well * args.photons_per_electron;
        let mut lines = if light { format!("b {ns} {photons}\n") } else { format!("d {ns}\n") };
        for _ in 0..count {
            self.view.frame += 1;
            self.view.shutter.exposure_time_s = exposure_s;
            let values = self.chain.values(&self.settings, &self.view)?;
            let name = format!("{:05}.png", self.view.frame);
            self.write(&values, &args.out.join(&name))?;
            writeln!(lines, "i {name}")?;
        }
        Ok(lines)
    }

    /// Green, back from the encoding to the converter's numbers.
    fn write(&self, values: &Plane<f32>, path: &Path) -> Result<()> {
        let numbers = values.data.chunks_exact(4).map(|p| f64::from(srgb_decode(p[1])) * self.largest);
        let mut worst = 0.0_f64;
        let data: Vec<u16> = numbers
            .map(|n| {
                worst = worst.max((n - n.round()).abs());
                n.round() as u16
            })
            .collect();
        // The encoding is undone in floats; were that not exact enough, numbers would be wrong.
        ensure!(worst < 0.1, "a value lies {worst} of a step from a digital number");
        let (width, height) = (values.width as u32, values.height as u32);
        let picture = ImageBuffer::<Luma<u16>, _>::from_raw(width, height, data).context("the size fits")?;
        picture.save(path).with_context(|| format!("cannot write {}", path.display()))
    }
}

/// Writes the pictures and `descriptor.txt`.
pub fn write(args: &Args) -> Result<()> {
    let camera = CameraFile::read(&args.camera)?;
    let bits = camera.settings.number("quantization", "bits", 0.0);
    ensure!(bits >= 1.0, "{}: [quantization] bits: a converter is needed", args.camera.display());
    ensure!(
        camera.settings.number("shot_noise", "full_well_e", 0.0) > 0.0,
        "{}: [shot_noise] full_well_e is needed",
        args.camera.display()
    );
    fs::create_dir_all(&args.out).with_context(|| format!("cannot make {}", args.out.display()))?;
    let device = DeviceChoice::from_option_or_environment(args.device.as_deref());
    let context = Context::new(&ContextOptions { device, validation: Validation::Off })?;
    let intrinsics: Intrinsics = camera.intrinsics;
    let mut settings = camera.settings.clone();
    // The encoding must be undone: nothing but sRGB behind the converter.
    let gamma = effects::by_id("gamma").context("gamma is in the list")?;
    settings.set(gamma, "exponent", Value::Number(1.0))?;
    let shutter = ShutterTiming {
        start_s: 0.0,
        exposure_time_s: 0.0,
        readout_time_s: 0.0,
        scan_order: Default::default(),
        line_count: intrinsics.height,
    };
    let view = View { intrinsics, shutter, frame: 0, seed: args.seed };
    let chain = PixelChain::new(&context, [intrinsics.width, intrinsics.height])?;
    let mut bench = Bench { chain, view, settings, largest: bits.exp2() - 1.0, args };
    let mut text = format!("v 4.0\nn {bits} {} {}\n", intrinsics.width, intrinsics.height);
    let step_s = args.longest_s / f64::from(args.steps);
    for step in 1..=args.steps {
        let exposure_s = f64::from(step) * step_s;
        for light in [true, false] {
            text += &bench.take(exposure_s, light, 2)?;
        }
    }
    // Half of saturation.
    let half_s = 0.5 * args.longest_s / args.brightest;
    for light in [true, false] {
        text += &bench.take(half_s, light, args.series)?;
    }
    fs::write(args.out.join("descriptor.txt"), text)?;
    println!("{} pictures and descriptor.txt in {}", bench.view.frame, args.out.display());
    Ok(())
}
