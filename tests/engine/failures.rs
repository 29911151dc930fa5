//! What goes wrong is said: no loader, no driver, no such device, sizes, trajectories. Nothing is drawn then, and an
//! engine that refused a frame goes on with the next.
#![allow(clippy::unwrap_used)]

use std::process::Command;
use std::sync::Arc;

use crate::gpu_support::device;
use crate::gpu_support::frames::{accumulation, engine, options, paper, request, still};
use crate::gpu_support::scenes::{moving, rich, walk};
use glam::DVec3;
use shutterbug::Error;
use shutterbug::camera::{Intrinsics, Pose, ScanOrder, Trajectory};
use shutterbug::engine::{Engine, EngineOptions, Method};
use shutterbug::gpu::{Context, ContextOptions, DeviceChoice, Validation, devices};
use shutterbug::plane::MAX_SIDE_PX;

const K: Intrinsics = Intrinsics { width: 33, height: 21, fx: 30.0, fy: 30.0, cx: 16.0, cy: 11.0 };
const CHILD: &str = "SHUTTERBUG_TEST_CHILD";

#[test]
#[ignore = "a child process of the tests below"]
fn child_opens_a_device() {
    if std::env::var_os(CHILD).is_some() {
        let device = DeviceChoice::from_option_or_environment(None);
        match Context::new(&ContextOptions { device, validation: Validation::Off }) {
            Ok(context) => println!("SAID opened {}", context.info().name),
            Err(error) => println!("SAID {error}"),
        }
        println!("SAID {}", devices().map_or_else(|e| e.to_string(), |d| format!("{} devices", d.len())));
    }
}

/// What a child process says whose environment is changed: on opening a device, on listing them.
fn child(changes: &[(&str, &str)]) -> [String; 2] {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "failures::child_opens_a_device", "--ignored", "--nocapture"]).env(CHILD, "1");
    command.envs(changes.iter().copied());
    let output = command.output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let said: Vec<_> =
        text.lines().filter_map(|l| l.split_once("SAID ")).map(|(_, s)| s.to_owned()).collect();
    assert!(output.status.success(), "{text} {}", String::from_utf8_lossy(&output.stderr));
    said.try_into().unwrap_or_else(|_| panic!("{text}"))
}

#[test]
fn without_loader_or_driver_it_says_what_to_install() {
    let Some(watched) = device("without_loader_or_driver_it_says_what_to_install") else { return };
    let [opened, _] = child(&[]);
    assert_eq!(opened, format!("opened {}", watched.0.info().name), "control: nothing is missing");
    // A file of that name that is no library comes first.
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("libvulkan.so.1"), "not a library").unwrap();
    for said in child(&[("LD_LIBRARY_PATH", folder.path().to_str().unwrap())]) {
        assert!(
            said.starts_with("no Vulkan loader: ") && said.contains("apt-get install libvulkan1"),
            "{said}"
        );
    }
    let nowhere = folder.path().join("nowhere.json");
    let nowhere = nowhere.to_str().unwrap();
    for said in child(&[("VK_DRIVER_FILES", nowhere), ("VK_ICD_FILENAMES", nowhere)]) {
        assert!(said.starts_with("no Vulkan device ") && said.contains("mesa-vulkan-drivers"), "{said}");
    }
    let [said, _] = child(&[("SHUTTERBUG_DEVICE", "Voodoo 2")]);
    assert!(said.contains("`Voodoo 2`") && said.contains(&watched.0.info().name), "{said}");
}

#[test]
fn a_device_is_chosen_by_index_uuid_or_name() {
    let Some(watched) = device("a_device_is_chosen_by_index_uuid_or_name") else { return };
    let open = |name: &str| {
        let device = DeviceChoice::Named(name.to_owned());
        Context::new(&ContextOptions { device, validation: Validation::Off })
    };
    let info = watched.0.info();
    let dashed = format!("{}-{}", &info.uuid[..8].to_uppercase(), &info.uuid[8..]);
    for name in [&info.index.to_string(), &info.uuid, &dashed, &info.name, &info.name[2..6].to_uppercase()] {
        assert_eq!(open(name).unwrap().info().uuid, info.uuid, "{name}");
    }
    // Numbers are indices alone: "15" is no part of a driver's version, and a UUID of digits is no index.
    let uuid = if info.uuid.starts_with('9') { "1".repeat(32) } else { "9".repeat(32) };
    for name in ["99", "15", "6", "-1", "no such device", uuid.as_str()] {
        match open(name).map(|_| ()) {
            Err(error @ Error::NoDevice { .. }) => {
                let text = error.to_string();
                assert!(text.contains(&format!("`{name}`")) && text.contains(&info.name), "{text}");
            }
            other => panic!("{name}: {other:?}"),
        }
    }
}

fn try_engine(context: &Arc<Context>, k: Intrinsics, samples: u32, method: Method) -> Result<Engine, Error> {
    let (scene, path) = (Arc::new(rich(0)), Arc::new(walk()));
    let options = EngineOptions { frames_in_flight: 1, ..options(method, samples) };
    Engine::new(context, scene, path, k, options, &[])
}

#[test]
fn sizes_beyond_the_limits_are_refused() {
    let Some(watched) = device("sizes_beyond_the_limits_are_refused") else { return };
    let side = watched.0.info().max_attachment_side_px;
    let size = |width: u32, height: u32| Intrinsics { width, height, ..K };
    for (name, k, samples, wanted) in [
        ("no columns", size(0, 9), 1, 0),
        ("no rows", size(9, 0), 1, 0),
        ("too wide", size(20_000, 9), 1, 20_000),
        ("too high", size(9, u32::MAX), 1, u64::from(u32::MAX)),
        ("8 samples", K, 8, 8),
        ("no samples", K, 0, 0),
        (
            "wider than the device with supersampling",
            size(side / 2 + 1, 9),
            16,
            u64::from(2 * (side / 2 + 1)),
        ),
    ] {
        if name == "wider than the device with supersampling" && side / 2 >= MAX_SIDE_PX {
            eprintln!("SKIPPED {name}: this device draws {side} px, more than any picture needs");
            continue;
        }
        for method in [accumulation(2), paper(2)] {
            match try_engine(&watched.0, k, samples, method).map(|_| ()) {
                Err(error @ Error::Limit { value, limit, .. }) => {
                    eprintln!("{name}: {error}");
                    assert_eq!(value, wanted, "{name}: {error}");
                    assert_ne!(value, limit);
                }
                other => panic!("{name}: {other:?}"),
            }
        }
    }
    // Control: the same engine with sizes inside the limits draws.
    let k = size((side / 2).min(MAX_SIDE_PX), 1);
    try_engine(&watched.0, k, 16, accumulation(1)).unwrap().render(&still(&k)).unwrap();
}

#[test]
fn a_short_trajectory_is_refused_before_any_work_and_the_engine_goes_on() {
    let Some(watched) = device("a_short_trajectory_is_refused_before_any_work") else { return };
    for method in [accumulation(4), paper(2)] {
        let good = request(&K, 0.01, 0.02, ScanOrder::TopToBottom);
        let options = EngineOptions { frames_in_flight: 1, ..options(method, 4) };
        let mut engine = engine(&watched, &rich(0), &walk(), K, options, &[]);
        let want = engine.render(&good).unwrap().picture;
        let made = watched.0.allocation_count();
        // The path ends at 0.4 s: a frame may start too late, end too late, or start too early.
        for start_s in [0.5, 0.39, -0.3] {
            let mut bad = good.clone();
            bad.shutter.start_s = start_s;
            match engine.submit(&bad).map(|_| ()) {
                Err(Error::TrajectoryTooShort { needed_from_s, covered_to_s, what, .. }) => {
                    assert_eq!(needed_from_s, start_s);
                    assert!((covered_to_s - 0.4).abs() < 1e-9, "{covered_to_s}");
                    assert!(what.contains("frame 3"), "{what}");
                }
                other => panic!("{start_s}: {other:?}"),
            }
        }
        assert_eq!(watched.0.allocation_count(), made, "nothing was made for frames that cannot be");
        assert_eq!(engine.render(&good).unwrap().picture, want, "the engine goes on");
    }
}

#[test]
fn a_short_path_of_an_object_names_it() {
    let Some(watched) = device("a_short_path_of_an_object_names_it") else { return };
    let mut scene = rich(0);
    let pose = |t: f64| moving().pose_at(t);
    let short = Trajectory::new("objects/moving.tum".as_ref(), vec![0.0, 0.02], vec![pose(0.0), pose(0.02)]);
    scene.objects[1].trajectory = Some(short.unwrap().into());
    let mut engine = engine(&watched, &scene, &walk(), K, options(accumulation(4), 4), &[]);
    let error = engine.submit(&request(&K, 0.01, 0.02, ScanOrder::TopToBottom)).map(|_| ()).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("objects/moving.tum") && text.contains("`moving`"), "{text}");
    engine.render(&still(&K)).unwrap();
}

#[test]
fn a_resting_camera_needs_its_pose_at_the_start_only() {
    let Some(watched) = device("a_resting_camera_needs_its_pose_at_the_start_only") else { return };
    let mut scene = rich(0);
    scene.objects[1].trajectory = None;
    let pose = |x: f64| Pose { translation_m: DVec3::new(x, 0.0, 0.0), ..Pose::IDENTITY };
    let path =
        Trajectory::new("trajectory.tum".as_ref(), vec![0.0, 0.01], vec![pose(0.0), pose(0.2)]).unwrap();
    for method in [accumulation(9), paper(2)] {
        let mut engine = engine(&watched, &scene, &path, K, options(method, 4), &[]);
        let mut long = request(&K, 0.01, 0.02, ScanOrder::TopToBottom);
        assert!(engine.submit(&long).is_err(), "control: a camera that moves needs the whole frame");
        long.static_camera = true;
        let rest = engine.render(&long).unwrap();
        assert_eq!(
            rest.picture,
            engine.render(&still(&K)).unwrap().picture,
            "as if the shutter were instant"
        );
    }
}
