//! The instance that the contexts of a process share.
//!
//! NVIDIA's driver does not survive instances that come and go: after some tens of `vkCreateInstance` and
//! `vkDestroyInstance` in one process the next one finds no driver, for good (measured on 580.159.04; docs/gpu.md). A
//! host that makes and destroys engines gets there in a day. So a process has one instance, and one more where the
//! validation layer watches; they stay until it ends. With the caller's own loader each context has its own instance,
//! because that loader may be unloaded behind it.

use std::ffi::OsString;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};

use ash::ext::debug_utils;
use ash::{Entry, Instance, vk};

use super::select::{self, DeviceInfo, DeviceKind};
use super::validation::{self, Validation};
use crate::error::{Error, Result};

/// Loader, instance, and whether who has them destroys the instance.
pub(super) struct Opened {
    pub(super) entry: Entry,
    pub(super) instance: Instance,
    pub(super) owned: bool,
}

/// An instance that stays, and what it was made for. A forked child cannot use its parent's.
struct Kept {
    process: u32,
    library: Option<OsString>,
    validation: Validation,
    entry: Entry,
    instance: Instance,
}

static KEPT: Mutex<Vec<Kept>> = Mutex::new(Vec::new());

/// The process that first loaded the driver of a GPU; 0 where none has.
static ON_A_GPU: AtomicU32 = AtomicU32::new(0);

/// Keeps a forked child from the driver of a GPU that its parent has open. Measured with NVIDIA's (580.159.04): the
/// child gets no device, and the parent loses its own.
fn refuse_a_child(on_a_gpu: u32, process: u32) -> Result<()> {
    if [0, process].contains(&on_a_gpu) {
        return Ok(());
    }
    Err(Error::NoDevice {
        wanted: "can be opened in a forked child".to_owned(),
        present: format!(
            "process {on_a_gpu}, from which this one was forked, has opened the driver of a GPU, and a child \
             that opens it too takes the parent's device away. Fork before the first engine, or start the child anew \
             (Python: multiprocessing.set_start_method(\"spawn\"))"
        ),
    })
}

/// Notes that this process has the driver of a GPU open, if one of these devices is a GPU.
pub(super) fn note(all: &[DeviceInfo]) {
    if all.iter().any(|d| d.kind != DeviceKind::Cpu) {
        // Who was first stays: what its children may do does not change.
        let _ = ON_A_GPU.compare_exchange(0, std::process::id(), Ordering::AcqRel, Ordering::Acquire);
    }
}

/// The process's instance by way of the machine's loader, made where there is none yet.
///
/// # Errors
/// No loader, no driver, no validation layer where it is wanted.
pub(super) fn shared(validation: Validation) -> Result<Opened> {
    // Not waited for: in a forked child the lock may be held by a thread that was left behind in the parent.
    let Ok(mut kept) = KEPT.try_lock() else { return own(select::load()?, validation) };
    let (process, library) = (std::process::id(), select::library());
    let same = |k: &&Kept| k.process == process && k.validation == validation && k.library == library;
    if let Some(k) = kept.iter().find(same) {
        return Ok(Opened { entry: k.entry.clone(), instance: k.instance.clone(), owned: false });
    }
    let Opened { entry, instance, .. } = own(select::load()?, validation)?;
    kept.push(Kept { process, library, validation, entry: entry.clone(), instance: instance.clone() });
    Ok(Opened { entry, instance, owned: false })
}

/// An instance for one context.
///
/// # Errors
/// No driver, no validation layer where it is wanted, a child of a process that has a GPU open.
pub(super) fn own(entry: Entry, validation: Validation) -> Result<Opened> {
    refuse_a_child(ON_A_GPU.load(Ordering::Acquire), std::process::id())?;
    let watch = validation == Validation::Required;
    if watch {
        validation::check_layer(&entry)?;
    }
    let layers: &[*const i8] = if watch { &[validation::LAYER.as_ptr()] } else { &[] };
    let extensions: &[*const i8] =
        if watch { &[debug_utils::NAME.as_ptr(), ash::ext::validation_features::NAME.as_ptr()] } else { &[] };
    let app = vk::ApplicationInfo::default()
        .application_name(c"shutterbug")
        .engine_name(c"shutterbug")
        .api_version(select::API_FLOOR);
    let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
    let mut info = vk::InstanceCreateInfo::default()
        .application_info(&app)
        .enabled_layer_names(layers)
        .enabled_extension_names(extensions);
    if watch {
        info = info.push_next(&mut features);
    }
    let instance = select::create_instance(&entry, &info)?;
    Ok(Opened { entry, instance, owned: true })
}

/// All devices in order of preference, usable or not.
///
/// # Errors
/// No loader, or a loader that fails.
pub fn devices() -> Result<Vec<DeviceInfo>> {
    let opened = shared(Validation::Off)?;
    let all = select::enumerate(&opened.instance);
    if opened.owned {
        // SAFETY: nothing made from the instance is alive.
        unsafe { opened.instance.destroy_instance(None) };
    }
    let all = all?;
    note(&all);
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_children_of_a_process_on_a_gpu_are_refused() {
        assert!(refuse_a_child(0, 7).is_ok(), "no GPU");
        assert!(refuse_a_child(7, 7).is_ok(), "its own");
        let text = refuse_a_child(6, 7).expect_err("its parent's").to_string();
        assert!(text.contains("forked") && text.contains("spawn") && text.contains('6'), "{text}");
    }
}
