//! The same frame is the same bits: from run to run, with one or two threads of the driver, with any number of frames
//! in flight; and a steady stream of frames allocates nothing.
#![allow(clippy::unwrap_used)]

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::process::Command;

use crate::gpu_support::frames::{accumulation, engine, options, paper, paper_from_depth, request};
use crate::gpu_support::scenes::{rich, walk};
use crate::gpu_support::{Watched, device};
use shutterbug::camera::{Intrinsics, ScanOrder};
use shutterbug::chain::{Settings, Value};
use shutterbug::effects::PaperNoise;
use shutterbug::engine::{
    Engine, EngineOptions, Frame, FrameRequest, GATHER_KERNELS, Gather, Method, PaperOptions,
};
use shutterbug::gpu::devices;

const K: Intrinsics = Intrinsics { width: 97, height: 73, fx: 80.0, fy: 82.0, cx: 47.2, cy: 37.1 };
const CHILD: &str = "SHUTTERBUG_TEST_CHILD";

fn methods() -> [(&'static str, Method); 4] {
    // Named: the fastest kernel may be another one in another process.
    let (gather, gather_kernel) =
        (Gather::Bilinear, GATHER_KERNELS.iter().find(|k| k.name == "sampler_2").copied());
    [
        ("accumulation", accumulation(40)),
        ("paper", paper(3)),
        ("paper from depth", paper_from_depth(2)),
        (
            "paper, bilinear gather",
            Method::Paper(PaperOptions { gather, gather_kernel, ..PaperOptions::default() }),
        ),
    ]
}

/// Frame `index` of a stream: shutter, blur, all parts of the noise, planes.
fn stream(index: u32) -> FrameRequest {
    let mut settings = Settings::default();
    for name in ["static_variance_r", "color_variance_g", "edge_variance_b"] {
        settings.set(&PaperNoise, name, Value::Number(1e-3)).unwrap();
    }
    let mut request = request(&K, 0.01, 0.02, ScanOrder::ALL[index as usize % 4]);
    request.shutter.start_s += 0.005 * f64::from(index);
    FrameRequest { index, seed: 5, settings, planes: true, ..request }
}

fn stream_engine(watched: &Watched, method: Method, frames_in_flight: u32) -> Engine {
    let options = EngineOptions { frames_in_flight, ..options(method, 16) };
    let expected: Vec<_> = (0..8).map(stream).collect();
    engine(watched, &rich(5), &walk(), K, options, &expected)
}

fn hash(frame: &Frame) -> u64 {
    let mut hasher = DefaultHasher::new();
    frame.picture.data.hash(&mut hasher);
    let planes = frame.planes.as_ref().unwrap();
    for plane in [&planes.color, &planes.motion_px, &planes.depth_m] {
        plane.data.iter().for_each(|v| v.to_bits().hash(&mut hasher));
    }
    hasher.finish()
}

/// Hashes of a stream of frames by each method, as one line.
fn hashes(test: &str, seed: u64) -> Option<String> {
    let watched = device(test)?;
    let mut line = String::new();
    for (_, method) in methods() {
        let mut engine = stream_engine(&watched, method, 2);
        for index in 0..3 {
            let frame = engine.render(&FrameRequest { seed, ..stream(index) }).unwrap();
            line += &format!("{:016x} ", hash(&frame));
        }
    }
    Some(line)
}

#[test]
#[ignore = "a child process of the test below"]
fn child_prints_hashes() {
    if std::env::var_os(CHILD).is_some() {
        println!("HASHES {}", hashes("child_prints_hashes", 5).unwrap());
    }
}

#[test]
fn bits_do_not_depend_on_the_run_or_on_the_drivers_threads() {
    let name = "bits_do_not_depend_on_the_run_or_on_the_drivers_threads";
    let Some(here) = hashes(name, 5) else { return };
    assert_eq!(hashes(name, 5).unwrap(), here, "the same process, a second device");
    assert_ne!(hashes(name, 6).unwrap(), here, "control: another seed");
    for threads in ["0", "1", "2"] {
        let child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "steady::child_prints_hashes", "--ignored", "--nocapture"])
            .env(CHILD, "1")
            .env("LP_NUM_THREADS", threads)
            .output()
            .unwrap();
        let text = String::from_utf8(child.stdout).unwrap();
        let line = text.split_once("HASHES ").and_then(|(_, rest)| rest.lines().next());
        assert_eq!(line, Some(here.as_str()), "LP_NUM_THREADS={threads}: {text}");
    }
}

#[test]
fn frames_in_flight_do_not_change_the_frames() {
    let Some(watched) = device("frames_in_flight_do_not_change_the_frames") else { return };
    for (name, method) in methods() {
        let mut one = stream_engine(&watched, method.clone(), 1);
        let want: Vec<_> = (0..7).map(|i| hash(&one.render(&stream(i)).unwrap())).collect();
        assert!((1..7).all(|i| want[i] != want[0]), "control: the frames differ");
        for in_flight in [2, 3] {
            let mut engine = stream_engine(&watched, method.clone(), in_flight);
            assert_eq!(engine.frames_in_flight(), in_flight as usize);
            let (mut tickets, mut got) = (std::collections::VecDeque::new(), Vec::new());
            for index in 0..7 {
                if tickets.len() == in_flight as usize {
                    got.push(engine.collect(tickets.pop_front().unwrap()).unwrap());
                }
                tickets.push_back(engine.submit(&stream(index)).unwrap());
            }
            got.extend(tickets.into_iter().map(|t| engine.collect(t).unwrap()));
            let indices: Vec<_> = got.iter().map(|f| f.index).collect();
            assert_eq!(indices, (0..7).collect::<Vec<_>>(), "{name}");
            assert_eq!(got.iter().map(hash).collect::<Vec<_>>(), want, "{name}, {in_flight} in flight");
        }
        // Frames may be asked for in any order, and again.
        for index in [4, 0, 6, 4] {
            assert_eq!(
                hash(&one.render(&stream(index)).unwrap()),
                want[index as usize],
                "{name}, frame {index}"
            );
        }
    }
}

#[test]
fn a_steady_stream_allocates_nothing() {
    let Some(watched) = device("a_steady_stream_allocates_nothing") else { return };
    for (name, method) in methods() {
        let before = watched.0.allocation_count();
        let mut engine = stream_engine(&watched, method, 2);
        engine.render(&stream(0)).unwrap();
        let made = watched.0.allocation_count();
        for index in 1..8 {
            engine.render(&stream(index)).unwrap();
        }
        eprintln!(
            "{name}: {} allocations to begin with, {} in 7 frames",
            made - before,
            watched.0.allocation_count() - made
        );
        assert_eq!(watched.0.allocation_count(), made, "{name}");
        assert!(made - before > 20, "control: the counter counts");
        // A frame without noise needs another pipeline, once.
        let plain = FrameRequest { settings: Settings::default(), ..stream(2) };
        engine.render(&plain).unwrap();
        let more = watched.0.allocation_count();
        assert!(more > made, "control: {name}");
        engine.render(&plain).unwrap();
        engine.render(&stream(3)).unwrap();
        assert_eq!(watched.0.allocation_count(), more, "{name}: once made, always there");
    }
}

#[test]
fn a_second_engine_makes_no_pipelines_and_the_same_frames() {
    let test = "a_second_engine_makes_no_pipelines_and_the_same_frames";
    let Some(_turn) = device(test) else { return };
    for (name, method) in methods() {
        // A test that has a context already gets one of its own the second time: this one has no pipelines yet.
        let Some(watched) = device(test) else { return };
        let made_by = || {
            let before = watched.0.allocation_count();
            let frame = stream_engine(&watched, method.clone(), 2).render(&stream(0)).unwrap();
            (watched.0.allocation_count() - before, hash(&frame))
        };
        let (first, second, third) = (made_by(), made_by(), made_by());
        assert_eq!(first.1, second.1, "{name}");
        assert_eq!(second, third, "{name}: memory and descriptor sets are made each time");
        assert!(first.0 >= second.0 + 5, "{name}: {} things, then {}", first.0, second.0);
    }
}

#[test]
fn times_of_the_passes_are_told() {
    let Some(watched) = device("times_of_the_passes_are_told") else { return };
    let passes: [&[&str]; 2] = [
        &["clear", "raster", "accumulate", "pointwise", "readback", "planes"],
        &["raster", "resolve", "motion", "paper_gather", "pointwise", "readback", "planes"],
    ];
    for ((name, method), wanted) in methods().into_iter().zip(passes) {
        let mut engine = stream_engine(&watched, method, 1);
        let frame = engine.render(&stream(1)).unwrap();
        if watched.0.info().timestamp_valid_bits == 0 {
            assert!(frame.times.is_empty());
            continue;
        }
        let names: Vec<_> = frame.times.iter().map(|t| t.name).collect();
        assert_eq!(names, wanted, "{name}");
        let sum: f64 = frame.times.iter().map(|t| t.ms).sum();
        assert!(
            frame.times.iter().all(|t| t.ms >= 0.0) && sum > 0.0 && sum < 1.05 * frame.host_ms,
            "{frame:?}"
        );
    }
}

/// A host makes an engine for each world that it loads, and destroys it: the thousandth is as good as the first. (With
/// NVIDIA's driver the 30th found no device when each context had a Vulkan instance of its own.)
#[test]
fn contexts_come_and_go() {
    let Some(first) = device("contexts_come_and_go") else { return };
    let name = first.0.info().name.clone();
    let render = |watched: &Watched| {
        let mut engine = engine(watched, &rich(0), &walk(), K, options(paper(2), 4), &[]);
        hash(&engine.render(&stream(0)).unwrap())
    };
    let want = render(&first);
    drop(first);
    let open_files = || std::fs::read_dir("/proc/self/fd").map_or(0, Iterator::count);
    let mut files = 0;
    let rounds = if crate::long_support::long() { 60 } else { 15 };
    for round in 0..rounds {
        let watched = device("contexts_come_and_go").unwrap();
        assert_eq!(watched.0.info().name, name);
        assert_eq!(render(&watched), want, "round {round}");
        assert!(devices().unwrap().iter().any(|d| d.name == name), "round {round}");
        drop(watched);
        if round == 4 {
            files = open_files();
        }
    }
    // Other tests of this program open files too, but not so many at a time.
    assert!(open_files() < files + 40, "{} files are open, after five rounds {files}", open_files());
}
