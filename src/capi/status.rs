//! Status codes of the C ABI. Their numbers never change; new ones are added at the end.

use crate::error::{Error, one_line};

/// What a call returns: one of the constants below.
pub type Status = i32;

macro_rules! statuses {
    ($($name:ident = $number:literal, $text:literal;)+) => {
        $(#[doc = $text] pub const $name: Status = $number;)+

        /// All codes with their names (without prefix) and meanings.
        pub const ALL: &[(Status, &str, &str)] = &[$(($name, stringify!($name), $text)),+];

        /// The meaning of a code as a C string; of unknown codes, that.
        pub fn text(status: Status) -> &'static std::ffi::CStr {
            let text = match status {
                $($number => concat!($text, "\0"),)+
                _ => "unknown status\0",
            };
            std::ffi::CStr::from_bytes_with_nul(text.as_bytes()).expect("ends with its only NUL")
        }
    };
}

statuses! {
    OK = 0, "done";
    ARGUMENT = 1, "an argument is null, misaligned, out of range or not a number";
    HANDLE = 2, "the handle is not alive, or is of another kind";
    BUSY = 3, "another thread is using the handle";
    POISONED = 4, "an earlier call on the handle failed in a way that left it unusable; destroy it";
    PANIC = 5, "the library has a bug: the call was abandoned and the handle is unusable from now on; destroy it";
    STRUCT_SIZE = 6, "struct_size is not a size that this library knows";
    TOO_SMALL = 7, "a stride, a capacity or a margin is too small";
    FORMAT = 8, "the pixel format is not possible here";
    STATE = 9, "the call needs another one first";
    INPUT = 10, "a file or text holds something that cannot be used";
    IO = 11, "the operating system refused a file operation";
    TIME = 12, "the trajectory does not cover the time that the frame needs";
    FULL = 13, "all frames in flight are taken: wait for one first";
    NOT_READY = 14, "the frame has not been waited for";
    TIMEOUT = 15, "the time limit passed";
    NO_DEVICE = 16, "no Vulkan loader, or no device that can be used";
    UNSUPPORTED = 17, "the device or this version of the library cannot do it";
    DEVICE_LOST = 18, "the device was lost";
    OUT_OF_MEMORY = 19, "out of device or host memory";
    LIMIT = 20, "a size is beyond what the device or the options allow";
    VULKAN = 21, "a Vulkan call failed";
    FORKED = 22, "the handle belongs to the process that forked this one";
}

/// A failed call: its code, and a sentence for a person.
#[derive(Debug)]
pub struct Fault {
    /// One of the codes.
    pub status: Status,
    /// What was found and what was expected.
    pub text: String,
}

/// Result of the safe parts.
pub type Outcome<T> = Result<T, Fault>;

impl Fault {
    /// A fault with its sentence.
    pub fn new(status: Status, text: impl Into<String>) -> Self {
        Self { status, text: text.into() }
    }

    /// A bad argument.
    pub fn argument(text: impl Into<String>) -> Self {
        Self::new(ARGUMENT, text)
    }
}

impl From<Error> for Fault {
    fn from(error: Error) -> Self {
        let status = status_of(&error);
        // Hosts print it: what stands in a file must not steer their terminal.
        Self { status, text: one_line(&error.to_string()) }
    }
}

fn status_of(error: &Error) -> Status {
    match error {
        Error::TrajectoryTooShort { .. } => TIME,
        Error::Io { .. } => IO,
        Error::At { problem, .. } => status_of(problem),
        Error::Parameter { .. }
        | Error::NotWhole { .. }
        | Error::Contradiction { .. }
        | Error::LensFolds(_)
        | Error::Input { .. }
        | Error::UnknownName { .. }
        | Error::Picture { .. } => INPUT,
        Error::MarginTooSmall { .. } => TOO_SMALL,
        Error::Limit { .. } => LIMIT,
        Error::NoVulkanLoader { .. } | Error::NoDevice { .. } => NO_DEVICE,
        Error::DeviceLacks { .. } => UNSUPPORTED,
        Error::DeviceLost { .. } => DEVICE_LOST,
        Error::OutOfMemory { .. } => OUT_OF_MEMORY,
        Error::Vulkan { result, .. } if result.starts_with("TIMEOUT") => TIMEOUT,
        _ => VULKAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_dense_and_unique_and_each_has_a_text() {
        for (i, (number, name, meaning)) in ALL.iter().enumerate() {
            assert_eq!(*number as usize, i, "{name}");
            assert_eq!(text(*number).to_str().expect("ASCII"), *meaning);
        }
        assert_eq!(text(-1).to_str(), Ok("unknown status"));
        assert_eq!(text(ALL.len() as i32).to_str(), Ok("unknown status"));
    }

    #[test]
    fn errors_keep_their_kind() {
        assert_eq!(Fault::from(Error::DeviceLost { call: "x" }).status, DEVICE_LOST);
        assert_eq!(Fault::from(Error::OutOfMemory { pool: "host", call: "x" }).status, OUT_OF_MEMORY);
        let timeout = Error::Vulkan { call: "vkWaitForFences", result: "TIMEOUT after 1 s".to_owned() };
        assert_eq!(Fault::from(timeout).status, TIMEOUT);
        let other = Error::Vulkan { call: "x", result: "ERROR_FRAGMENTATION".to_owned() };
        assert_eq!(Fault::from(other).status, VULKAN);
    }
}
