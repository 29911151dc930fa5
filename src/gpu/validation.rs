//! The validation layer and what it says.

use std::ffi::{CStr, c_void};
use std::sync::Mutex;

use ash::ext::debug_utils;
use ash::{Entry, Instance, vk};

use super::failed;
use crate::error::{Error, Result};

/// Name of the validation layer.
pub(super) const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Whether the validation layer is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Validation {
    /// Not loaded.
    #[default]
    Off,
    /// Loaded with synchronization validation; its absence is an error.
    Required,
}

/// Collects what the layer reports.
#[derive(Default)]
pub(super) struct Messages(Mutex<Vec<String>>);

impl Messages {
    /// Everything reported so far.
    pub(super) fn all(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone()
    }
}

/// The messenger that feeds [`Messages`]; the messages outlive it.
pub(super) struct Messenger {
    loader: debug_utils::Instance,
    handle: vk::DebugUtilsMessengerEXT,
    pub(super) messages: Box<Messages>,
}

impl Messenger {
    pub(super) fn new(entry: &Entry, instance: &Instance) -> Result<Self> {
        let messages = Box::new(Messages::default());
        let loader = debug_utils::Instance::new(entry, instance);
        let user_data: *const Messages = &*messages;
        let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::ERROR | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
            )
            // Not PERFORMANCE: that class advises other image layouts than GENERAL, which is this layer's one rule.
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
            .pfn_user_callback(Some(collect))
            .user_data(user_data.cast_mut().cast());
        // SAFETY: the instance is alive, and `messages` is boxed and destroyed only after the messenger.
        let handle = unsafe { loader.create_debug_utils_messenger(&info, None) };
        let handle = handle.map_err(failed("vkCreateDebugUtilsMessengerEXT"))?;
        Ok(Self { loader, handle, messages })
    }

    /// Must be called before the instance is destroyed.
    pub(super) fn destroy(&self) {
        // SAFETY: called once, by the context's `Drop`, while the instance is alive.
        unsafe { self.loader.destroy_debug_utils_messenger(self.handle, None) };
    }
}

unsafe extern "system" fn collect(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes valid data, and `user` is the boxed `Messages` of `Messenger::new`.
    let (data, messages) = unsafe { (&*data, &*user.cast::<Messages>()) };
    // SAFETY: the message is a NUL-terminated string that lives through the call.
    let text =
        unsafe { data.message_as_c_str() }.map_or_else(String::new, |t| t.to_string_lossy().into_owned());
    messages.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(text);
    vk::FALSE
}

/// Fails with what to install when the layer is wanted and absent.
pub(super) fn check_layer(entry: &Entry) -> Result<()> {
    // SAFETY: the loader is loaded; this call has no other requirement.
    let layers = unsafe { entry.enumerate_instance_layer_properties() };
    let layers = layers.map_err(failed("vkEnumerateInstanceLayerProperties"))?;
    if layers.iter().any(|l| l.layer_name_as_c_str() == Ok(LAYER)) {
        return Ok(());
    }
    Err(Error::DeviceLacks {
        device: "(the Vulkan loader)".to_owned(),
        missing: vec![
            "VK_LAYER_KHRONOS_validation (Debian: apt-get install vulkan-validationlayers)".to_owned(),
        ],
    })
}
