//! `shutterbug devices`.

use crate::error::{Error, Result};
use crate::gpu::{DeviceInfo, DeviceKind, devices};

/// Prints one block per device.
pub fn run() -> Result<()> {
    let all = devices()?;
    if all.is_empty() {
        let present = "none (Debian: apt-get install mesa-vulkan-drivers)".to_owned();
        return Err(Error::NoDevice { wanted: "is there".to_owned(), present });
    }
    for device in &all {
        print!("{}", describe(device));
    }
    Ok(())
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
        "{}: {}\n   kind            {kind}\n   driver          {}\n   uuid            {}\n   Vulkan          \
         {major}.{minor}.{patch}\n   samples         {} (1, 4 and 16 are made up of these)\n   largest image   {} px\n   \
         timestamps      {timestamps}\n   usable          {usable}\n",
        d.index,
        d.name,
        d.driver,
        d.uuid,
        samples.join(", "),
        d.max_image_side_px,
    )
}
