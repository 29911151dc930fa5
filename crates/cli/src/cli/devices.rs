//! `shutterbug devices`.

use super::args::Devices;
use super::terminal::print;
use shutterbug::engine::{Gather, cache_path, choose_gather};
use shutterbug::error::{Error, Result};
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, DeviceInfo, DeviceKind, Validation, devices};

/// Prints one block per device.
pub fn run(args: &Devices) -> Result<()> {
    let all = devices()?;
    if all.is_empty() {
        let present = "none (Debian: apt-get install mesa-vulkan-drivers)".to_owned();
        return Err(Error::NoDevice { wanted: "is there".to_owned(), present });
    }
    print(all.iter().map(describe).collect::<String>())?;
    if args.kernels { kernels() } else { Ok(()) }
}

/// Prints the chosen kernel of each quality, after trying them where that was not done before.
fn kernels() -> Result<()> {
    let device = DeviceChoice::from_option_or_environment(None);
    let context = Context::new(&ContextOptions { device, validation: Validation::Off })?;
    let mut text = format!("kernels on {}:\n", context.info().name);
    for gather in [Gather::Bilinear, Gather::Fast] {
        let choice = choose_gather(&context, gather, None)?;
        let times: Vec<_> = choice.candidates.iter().map(|(name, ms)| format!("{name} {ms:.3} ms")).collect();
        text += &format!(
            "   --gather {:?}: {} (by {:?}: {})\n",
            gather,
            choice.kernel.name,
            choice.by,
            times.join(", ")
        );
    }
    match cache_path() {
        Some(path) => text += &format!("   kept in {}; remove the file to measure again\n", path.display()),
        None => text += "   kept nowhere: neither XDG_CACHE_HOME nor HOME is set\n",
    }
    print(text)
}

fn describe(d: &DeviceInfo) -> String {
    let kind = match d.kind {
        DeviceKind::DiscreteGpu => "discrete GPU",
        DeviceKind::IntegratedGpu => "integrated GPU",
        DeviceKind::VirtualGpu => "virtual GPU",
        DeviceKind::Other => "other",
        DeviceKind::Cpu => "software driver (its times are CPU times)",
    };
    let (major, minor, patch) = d.api_version;
    let usable =
        if d.missing.is_empty() { "yes".to_owned() } else { format!("no, lacks {}", d.missing.join(", ")) };
    let timestamps = match d.timestamp_valid_bits {
        0 => "none".to_owned(),
        bits => format!("{bits} bits of {} ns", d.timestamp_period_ns),
    };
    let samples: Vec<_> = d.sample_counts.iter().map(u32::to_string).collect();
    format!(
        "{}: {}\n   kind            {kind}\n   driver          {}\n   uuid            {}\n   \
         Vulkan          {major}.{minor}.{patch}\n   samples         {} (1, 4 and 16 are made up of these)\n   \
         largest image   {} px\n   timestamps      {timestamps}\n   usable          {usable}\n",
        d.index,
        d.name,
        d.driver,
        d.uuid,
        samples.join(", "),
        d.max_image_side_px,
    )
}
