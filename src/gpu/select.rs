//! Which device: what there is, what each lacks, and the choice by index, UUID or name.

use std::ffi::{CStr, OsString};

use ash::{Entry, Instance, vk};

use super::failed;
use crate::error::{Error, Result};

/// Oldest Vulkan that is enough.
pub(super) const API_FLOOR: u32 = vk::API_VERSION_1_2;

/// Kind of device; the order is the order of preference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DeviceKind {
    /// A GPU with its own memory.
    DiscreteGpu,
    /// A GPU in the processor.
    IntegratedGpu,
    /// A GPU lent by a hypervisor.
    VirtualGpu,
    /// Anything else.
    Other,
    /// A software driver: its times are CPU times.
    Cpu,
}

/// What one device is and can do.
#[derive(Clone, Debug)]
pub struct DeviceInfo {
    /// Place in the preference order: what `--device 0` means.
    pub index: usize,
    /// The driver's name of it.
    pub name: String,
    /// Driver name, version text and number.
    pub driver: String,
    /// UUID, 32 hexadecimal digits.
    pub uuid: String,
    /// Kind.
    pub kind: DeviceKind,
    /// Supported Vulkan version.
    pub api_version: (u32, u32, u32),
    /// Duration of a timestamp tick, ns.
    pub timestamp_period_ns: f64,
    /// Valid bits of a timestamp on the queue used; 0 = no timestamps.
    pub timestamp_valid_bits: u32,
    /// Sample counts that colour and depth attachments of our formats support together, ascending.
    pub sample_counts: Vec<u32>,
    /// Largest side of an image, px.
    pub max_image_side_px: u32,
    /// Largest side of an image that is drawn into, px.
    pub max_attachment_side_px: u32,
    /// Bits of a px to which the rasterizer rounds vertex positions; Vulkan promises 4.
    pub sub_pixel_bits: u32,
    /// Largest storage buffer range, bytes.
    pub max_storage_buffer_bytes: u64,
    /// Most texels of a buffer of texels.
    pub max_texels: u64,
    /// What is needed and missing; empty = usable.
    pub missing: Vec<String>,
    pub(super) physical: vk::PhysicalDevice,
    pub(super) queue_family: u32,
}

/// Which device to use.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// The first usable one; software devices come last.
    #[default]
    First,
    /// The device of that index, UUID, or name (a part of it, case ignored).
    Named(String),
}

impl DeviceChoice {
    /// `--device` if given, else `SHUTTERBUG_DEVICE` if set and not empty, else the first usable device.
    pub fn from_option_or_environment(option: Option<&str>) -> Self {
        let named = option.map(str::to_owned).or_else(|| std::env::var("SHUTTERBUG_DEVICE").ok());
        named.filter(|n| !n.is_empty()).map_or(Self::First, Self::Named)
    }

    pub(super) fn pick(&self, all: &[DeviceInfo]) -> Result<DeviceInfo> {
        let present = || {
            let lines: Vec<_> = all.iter().map(describe).collect();
            if lines.is_empty() {
                "none (Debian: apt-get install mesa-vulkan-drivers)".to_owned()
            } else {
                lines.join("; ")
            }
        };
        let found = match self {
            Self::First => all.iter().find(|d| d.missing.is_empty()),
            Self::Named(wanted) => all.iter().find(|d| matches(d, wanted)),
        };
        let Some(found) = found else {
            let wanted = match self {
                Self::First => "is usable".to_owned(),
                Self::Named(name) => format!("has the index, UUID or name `{name}`"),
            };
            return Err(Error::NoDevice { wanted, present: present() });
        };
        if found.missing.is_empty() {
            return Ok(found.clone());
        }
        Err(Error::DeviceLacks { device: found.name.clone(), missing: found.missing.clone() })
    }
}

/// A UUID is 32 hexadecimal digits, an index a shorter number (also where a device's name holds that number, as in "256
/// bits"); all else is a part of a name.
fn matches(device: &DeviceInfo, wanted: &str) -> bool {
    let plain_uuid = wanted.replace('-', "").to_lowercase();
    if plain_uuid.len() == 32 && plain_uuid.chars().all(|c| c.is_ascii_hexdigit()) {
        return plain_uuid == device.uuid;
    }
    match wanted.parse::<usize>() {
        Ok(index) => index == device.index,
        Err(_) => device.name.to_lowercase().contains(&wanted.to_lowercase()),
    }
}

fn describe(d: &DeviceInfo) -> String {
    let lacks =
        if d.missing.is_empty() { String::new() } else { format!(", lacks {}", d.missing.join(", ")) };
    format!("{}: {} [{}]{lacks}", d.index, d.name, d.uuid)
}

/// An instance; a loader that finds no driver says so here.
pub(super) fn create_instance(entry: &Entry, info: &vk::InstanceCreateInfo<'_>) -> Result<Instance> {
    // SAFETY: `info` and what it points to live through the call.
    unsafe { entry.create_instance(info, None) }.map_err(|result| match result {
        vk::Result::ERROR_INCOMPATIBLE_DRIVER => {
            Error::NoDevice { wanted: "is there".to_owned(), present: NO_DRIVER.to_owned() }
        }
        other => failed("vkCreateInstance")(other),
    })
}

/// What to do where the loader is there and no driver is.
const NO_DRIVER: &str = "none: the Vulkan loader finds no driver (Debian: apt-get install mesa-vulkan-drivers; a GPU \
                         needs its vendor's driver; VK_DRIVER_FILES may point elsewhere)";

/// Names a file that stands in for the Vulkan loader: another loader, or a driver that can be asked without one.
pub const LIBRARY_VARIABLE: &str = "SHUTTERBUG_VULKAN_LIBRARY";

/// What [`LIBRARY_VARIABLE`] names.
pub(super) fn library() -> Option<OsString> {
    std::env::var_os(LIBRARY_VARIABLE).filter(|file| !file.is_empty())
}

/// The Vulkan loader of this machine, or the one of [`LIBRARY_VARIABLE`].
pub(super) fn load() -> Result<Entry> {
    let named = library();
    // To open a pipe would wait for somebody who writes to it. A name without a folder is looked for by the system.
    let irregular =
        |file: &&OsString| std::path::Path::new(file).metadata().is_ok_and(|about| !about.is_file());
    if let Some(file) = named.as_ref().filter(irregular) {
        let reason = format!(
            "{LIBRARY_VARIABLE} names {}, which is no regular file",
            std::path::Path::new(file).display()
        );
        return Err(Error::NoVulkanLoader { reason });
    }
    // SAFETY: loading a Vulkan loader, the system's or one that the user names, runs its initialisers, which is what it
    // is for.
    let loaded = unsafe { named.as_ref().map_or_else(|| Entry::load(), |file| Entry::load_from(file)) };
    loaded.map_err(|e| Error::NoVulkanLoader { reason: e.to_string() })
}

pub(super) fn enumerate(instance: &Instance) -> Result<Vec<DeviceInfo>> {
    // SAFETY: the instance is alive.
    let physical = unsafe { instance.enumerate_physical_devices() };
    let physical = physical.map_err(failed("vkEnumeratePhysicalDevices"))?;
    let mut all: Vec<_> = physical.into_iter().map(|p| inspect(instance, p)).collect();
    all.sort_by_key(|d| d.kind);
    for (index, device) in all.iter_mut().enumerate() {
        device.index = index;
    }
    Ok(all)
}

fn inspect(instance: &Instance, physical: vk::PhysicalDevice) -> DeviceInfo {
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut id = vk::PhysicalDeviceIDProperties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver).push_next(&mut id);
    // SAFETY: the physical device belongs to the live instance; core 1.1 call with core 1.2 structures.
    unsafe { instance.get_physical_device_properties2(physical, &mut properties) };
    let core = properties.properties;
    // SAFETY: as above.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    let wanted = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    let family = families.iter().position(|f| f.queue_flags.contains(wanted));
    let version = core.api_version;
    let mut info = DeviceInfo {
        index: 0,
        name: text(core.device_name_as_c_str()),
        driver: format!("{} {}", text(driver.driver_name_as_c_str()), text(driver.driver_info_as_c_str())),
        uuid: id.device_uuid.iter().map(|b| format!("{b:02x}")).collect(),
        kind: kind(core.device_type),
        api_version: (
            vk::api_version_major(version),
            vk::api_version_minor(version),
            vk::api_version_patch(version),
        ),
        timestamp_period_ns: f64::from(core.limits.timestamp_period),
        timestamp_valid_bits: family.map_or(0, |f| families[f].timestamp_valid_bits),
        sample_counts: Vec::new(),
        max_image_side_px: core.limits.max_image_dimension2_d,
        max_attachment_side_px: core
            .limits
            .max_image_dimension2_d
            .min(core.limits.max_framebuffer_width)
            .min(core.limits.max_framebuffer_height),
        sub_pixel_bits: core.limits.sub_pixel_precision_bits,
        max_storage_buffer_bytes: u64::from(core.limits.max_storage_buffer_range),
        max_texels: u64::from(core.limits.max_texel_buffer_elements),
        missing: Vec::new(),
        physical,
        queue_family: family.unwrap_or(0) as u32,
    };
    info.missing = missing(instance, physical, &core, family.is_some());
    if version >= API_FLOOR {
        info.sample_counts = sample_counts(instance, physical, &core.limits);
    }
    info
}

/// Text of a fixed-size, NUL-terminated field; empty when a driver forgot the NUL.
fn text(field: std::result::Result<&CStr, std::ffi::FromBytesUntilNulError>) -> String {
    field.map_or_else(|_| String::new(), |t| t.to_string_lossy().into_owned())
}

fn kind(kind: vk::PhysicalDeviceType) -> DeviceKind {
    match kind {
        vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::DiscreteGpu,
        vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::IntegratedGpu,
        vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::VirtualGpu,
        vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
        _ => DeviceKind::Other,
    }
}

/// Everything that is needed and absent, so that one error names it all.
fn missing(
    instance: &Instance,
    physical: vk::PhysicalDevice,
    core: &vk::PhysicalDeviceProperties,
    has_queue: bool,
) -> Vec<String> {
    let mut missing = Vec::new();
    if core.api_version < API_FLOOR {
        missing.push("Vulkan 1.2".to_owned());
    }
    if !has_queue {
        missing.push("a queue with graphics and compute".to_owned());
    }
    // SAFETY: the physical device belongs to the live instance.
    let features = unsafe { instance.get_physical_device_features(physical) };
    if features.shader_storage_image_extended_formats == vk::FALSE {
        missing.push("feature shaderStorageImageExtendedFormats (rg32f storage images)".to_owned());
    }
    let image = vk::FormatFeatureFlags::COLOR_ATTACHMENT
        | vk::FormatFeatureFlags::STORAGE_IMAGE
        | vk::FormatFeatureFlags::SAMPLED_IMAGE;
    let wanted = [
        (vk::Format::R16G16B16A16_SFLOAT, image, "rgba16f as attachment and storage image"),
        (vk::Format::R32G32_SFLOAT, image, "rg32f as attachment and storage image"),
        (
            vk::Format::R32G32_UINT,
            vk::FormatFeatureFlags::STORAGE_IMAGE | vk::FormatFeatureFlags::SAMPLED_IMAGE,
            "rg32ui as storage image",
        ),
        (vk::Format::R32G32B32A32_SFLOAT, vk::FormatFeatureFlags::STORAGE_IMAGE, "rgba32f as storage image"),
        (vk::Format::R32_SFLOAT, vk::FormatFeatureFlags::STORAGE_IMAGE, "r32f as storage image"),
        (
            vk::Format::D32_SFLOAT,
            vk::FormatFeatureFlags::DEPTH_STENCIL_ATTACHMENT | vk::FormatFeatureFlags::SAMPLED_IMAGE,
            "d32f as sampled depth attachment",
        ),
        (
            vk::Format::R8G8B8A8_SRGB,
            vk::FormatFeatureFlags::SAMPLED_IMAGE | vk::FormatFeatureFlags::SAMPLED_IMAGE_FILTER_LINEAR,
            "rgba8_srgb with linear filter",
        ),
    ];
    for (format, flags, words) in wanted {
        // SAFETY: the physical device belongs to the live instance.
        let has = unsafe { instance.get_physical_device_format_properties(physical, format) };
        if !has.optimal_tiling_features.contains(flags) {
            missing.push(words.to_owned());
        }
    }
    missing
}

/// Sample counts that every attachment format supports and whose samples a kernel can read.
fn sample_counts(
    instance: &Instance,
    physical: vk::PhysicalDevice,
    limits: &vk::PhysicalDeviceLimits,
) -> Vec<u32> {
    let mut counts = limits.framebuffer_color_sample_counts
        & limits.framebuffer_depth_sample_counts
        & limits.sampled_image_color_sample_counts
        & limits.sampled_image_depth_sample_counts;
    let color = vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::SAMPLED;
    let depth = vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT | vk::ImageUsageFlags::SAMPLED;
    let formats = [
        (vk::Format::R16G16B16A16_SFLOAT, color),
        (vk::Format::R32G32_SFLOAT, color),
        (vk::Format::D32_SFLOAT, depth),
    ];
    for (format, usage) in formats {
        // SAFETY: the physical device belongs to the live instance.
        let has = unsafe {
            instance.get_physical_device_image_format_properties(
                physical,
                format,
                vk::ImageType::TYPE_2D,
                vk::ImageTiling::OPTIMAL,
                usage,
                vk::ImageCreateFlags::empty(),
            )
        };
        counts &= has.map_or(vk::SampleCountFlags::empty(), |p| p.sample_counts);
    }
    (0..7).map(|bit| 1 << bit).filter(|&n| counts.contains(vk::SampleCountFlags::from_raw(n))).collect()
}
