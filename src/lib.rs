//! Simulates what a cheap moving camera delivers of a rendered scene: rolling shutter, motion blur, lens, noise and the
//! rest of a sensor's effects, as Vulkan compute kernels.
//!
//! `cargo add shutterbug`. The build compiles shaders and needs a C++ compiler, or Debian's `libshaderc-dev`. A run
//! needs a Vulkan 1.2 device; a software driver (Mesa's lavapipe) is enough. The command line is the crate
//! `shutterbug-cli`; what finds the effects that explain a gap between simulated and real frames is
//! `shutterbug-diagnose`.
//!
//! # A frame
//!
//! A frame needs a scene, the camera's path, its pinhole, the timing of its shutter, and a device. This one shows a
//! white bar to a camera that pans while its lines are read one after another, so the bar leans:
//!
//! ```
//! use std::path::Path;
//! use std::sync::Arc;
//!
//! use shutterbug::camera::{Intrinsics, Pose, ScanOrder, ShutterTiming, Trajectory};
//! use shutterbug::chain::Settings;
//! use shutterbug::engine::{Engine, EngineOptions, ExactOptions, FrameRequest, Method};
//! use shutterbug::glam::{DQuat, DVec3};
//! use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, Validation};
//! use shutterbug::scene::SceneBuilder;
//!
//! # fn main() -> shutterbug::Result<()> {
//! // World coordinates in metres. An upright bar, two metres ahead.
//! let bar = [[-0.1, -2.0, 2.0], [0.1, -2.0, 2.0], [0.1, 2.0, 2.0], [-0.1, 2.0, 2.0]];
//! let scene = SceneBuilder::new().object("bar", None).material([1.0, 1.0, 1.0]).quad(bar).build();
//!
//! // A camera looks along +z; x is right and y is down. It turns to the right by 0.1 rad in 20 ms. The path begins
//! // before the frame and ends after it: lines are exposed before and after the frame's own time.
//! let turned = |angle| Pose { rotation: DQuat::from_rotation_y(angle), translation_m: DVec3::ZERO };
//! let path = Trajectory::new(Path::new("pan"), vec![-0.02, 0.04], vec![turned(-0.1), turned(0.2)])?;
//! let camera = Intrinsics { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 32.0, cy: 24.0 };
//!
//! let device = DeviceChoice::from_option_or_environment(None);
//! let context = Context::new(&ContextOptions { device, validation: Validation::Off })?;
//! let method = Method::Exact(ExactOptions::default());
//! let options = EngineOptions { method, ..EngineOptions::default() };
//! let mut engine = Engine::new(&context, Arc::new(scene), Arc::new(path), camera, options, &[])?;
//!
//! let frame = FrameRequest {
//!     index: 0,
//!     // To read all 48 lines takes 19.5 ms; each is exposed for 0.1 ms.
//!     shutter: ShutterTiming {
//!         start_s: 0.0,
//!         exposure_time_s: 1e-4,
//!         readout_time_s: 0.0195,
//!         scan_order: ScanOrder::TopToBottom,
//!         line_count: 48,
//!     },
//!     frame_interval_s: 0.04,
//!     seed: 1,
//!     settings: Settings::default(),
//!     static_camera: false,
//!     planes: false,
//!     statistics: false,
//! };
//! let ticket = engine.submit(&frame)?;
//! let picture = engine.collect(ticket)?.picture;
//!
//! // Where the bar is in a row: the mean column, weighed by brightness.
//! let column = |row: usize| {
//!     let weight = |x: usize| f64::from(picture.pixel(x, row)[1]);
//!     (0..64).map(|x| (x as f64 + 0.5) * weight(x)).sum::<f64>() / (0..64).map(weight).sum::<f64>()
//! };
//! assert!((column(0) - 32.0).abs() < 0.5, "seen before the camera had turned");
//! assert!((column(47) - 26.2).abs() < 0.5, "seen when it had turned by almost 0.1 rad, which is 6 px");
//! # Ok(())
//! # }
//! ```
//!
//! [`plane::write_png_atomic`] saves a picture. Several frames can be in flight: submit them, then collect.
//!
//! # A folder instead of code
//!
//! A capture is a folder with a scene (OBJ), a trajectory, the frames' times and `camera.toml`.
//! [`capture::Capture::read`] reads and checks one, and says with file and line what is wrong:
//!
//! ```
//! use shutterbug::capture::Capture;
//!
//! let capture = Capture::read("demo/capture".as_ref(), None)?;
//! assert_eq!(capture.frames.len(), 6);
//! // When the first line of the first frame is exposed, and how long reading all of them takes.
//! let shutter = capture.shutter(0);
//! println!("{} s, {} s", shutter.start_s, shutter.readout_time_s);
//! # Ok::<(), shutterbug::Error>(())
//! ```
//!
//! # Effects
//!
//! [`effects::LIST`] has all of them, in the order in which light meets them, each with its parameters, units and
//! ranges. [`chain::Settings`] holds the values of those that are on:
//!
//! ```
//! use shutterbug::chain::{Settings, Value};
//! use shutterbug::effects::by_id;
//!
//! let mut settings = Settings::default();
//! let vignetting = by_id("vignetting").expect("an effect of the list");
//! let first = vignetting.specs()[0].name;
//! settings.set(vignetting, first, Value::Number(-0.2))?;
//! assert!(settings.has("vignetting") && !settings.has("gamma"));
//! # Ok::<(), shutterbug::Error>(())
//! ```
//!
//! # Frames of another renderer
//!
//! Frames of another renderer are called *frames from outside*. [`engine::OutsideEngine`] takes pictures with depth or
//! motion, and the camera's path, and gives the disturbed frame. [`capi`] is the same for C.
//!
//! # Where to look
//!
//! | module | what it has |
//! |---|---|
//! | [`camera`] | pose, path, pinhole, lens, shutter timing: pure mathematics |
//! | [`scene`] | triangles, materials, lights; [`scene::load_obj`] and [`scene::SceneBuilder`] |
//! | [`chain`], [`effects`] | what an effect is, and all of them |
//! | [`capture`] | a folder as scene, path, times and settings |
//! | [`gpu`] | the device |
//! | [`engine`] | frames: four methods, and frames from outside |
//! | [`plane`], [`files`] | pictures in memory, PNG and EXR; the one reader and writer of files |
//! | [`mod@reference`] | the same kernels on the CPU, written to be read |
//! | [`raster`], [`kernels`] | what the engine is made of |
//! | [`capi`] | the C library; `include/shutterbug.h` is its manual |
//!
//! Lengths are metres, times seconds, pictures pixels with their centres at +0.5; names say so (`exposure_time_s`). An
//! [`Error`] is one line that says what was found and what was expected.

pub mod camera;
pub mod capi;
pub mod capture;
pub mod chain;
pub mod effects;
pub mod engine;
pub mod error;
pub mod files;
pub mod gpu;
pub mod kernels;
pub mod plane;
pub mod raster;
pub mod reference;
pub mod scene;

pub use error::{Error, Result};
/// Vectors and rotations of the interface, in the version that it uses.
pub use glam;
