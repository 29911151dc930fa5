//! The installed library as a host meets it: C by pkg-config and by CMake, C++ and Rust examples, memcheck, the address
//! sanitizer, and resident memory over cycles and frames. `SHUTTERBUG_LONG=1` runs 1000 cycles of each and 40 000
//! frames.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;

use crate::installed::{NO_DEVICE, build, pkg_config, prefix, present, program, run};

#[test]
fn a_c_program_builds_by_pkg_config_and_runs() {
    let Some(program) = build("cc", "-std=c11", "tests/c/smoke.c", &[]) else { return };
    run(Command::new(program).arg("demo/capture"));
    assert_eq!(pkg_config(&["--modversion"]), [env!("CARGO_PKG_VERSION")]);
    let minor = env!("CARGO_PKG_VERSION").rsplit_once('.').unwrap().0;
    assert!(prefix().join(format!("lib/libshutterbug.so.{minor}")).exists(), "the soname's link");
}

#[test]
fn a_c_program_builds_by_cmake_shared_and_static() {
    if !present("cmake") {
        return;
    }
    let folder = prefix().join("cmake-build");
    let find = format!("-DCMAKE_PREFIX_PATH={}", prefix().display());
    run(Command::new("cmake").args(["-S", "tests/c/cmake", "-B"]).arg(&folder).arg(find));
    run(Command::new("cmake").arg("--build").arg(&folder));
    for program in ["smoke_shared", "smoke_static"] {
        run(Command::new(folder.join(program)).arg("demo/capture"));
    }
    // Control: a version that this is not.
    let text = std::fs::read_to_string("tests/c/cmake/CMakeLists.txt")
        .unwrap()
        .replace("shutterbug 0.1", "shutterbug 7.0");
    let other = tempfile::tempdir().unwrap();
    std::fs::write(other.path().join("CMakeLists.txt"), text).unwrap();
    let find = format!("-DCMAKE_PREFIX_PATH={}", prefix().display());
    let mut refused = Command::new("cmake");
    refused.arg("-S").arg(other.path()).arg("-B").arg(other.path().join("b")).arg(find);
    assert!(!refused.output().unwrap().status.success());
}

/// Bars of the examples, blurred: neither one colour nor still bars.
fn is_blurred(ppm: &[u8]) -> bool {
    let row = &ppm[ppm.len() - 320 * 3..];
    let between = row.iter().filter(|v| **v > 60 && **v < 200).count();
    between > 100
}

#[test]
fn the_examples_are_short_build_and_run() {
    for example in ["examples/process.c", "examples/process.cpp", "examples/process.rs"] {
        let lines = std::fs::read_to_string(example).unwrap().lines().count();
        assert!(lines < 64, "{example} has {lines} lines");
    }
    let folder = tempfile::tempdir().unwrap();
    if let Some(program) = build("cc", "-std=c11", "examples/process.c", &[]) {
        let out = folder.path().join("c.ppm");
        run(Command::new(program).arg(&out));
        let ppm = std::fs::read(out).unwrap();
        assert!(ppm.starts_with(b"P6\n320 240\n255\n") && is_blurred(&ppm));
    }
    if let Some(program) = build("c++", "-std=c++17", "examples/process.cpp", &[]) {
        let out = folder.path().join("cpp.ppm");
        run(Command::new(program).arg("demo/capture").arg(&out));
        assert!(std::fs::read(out).unwrap().starts_with(b"P6\n320 240\n255\n"));
    }
    // Cargo builds examples beside the tests, unless one test file alone was asked for.
    let mut cargo = Command::new(env!("CARGO"));
    run(cargo.args(["build", "--release", "--example", "process"]).env_remove("LD_LIBRARY_PATH"));
    let program = std::env::current_exe().unwrap();
    let program = program.parent().unwrap().parent().unwrap().join("examples/process");
    let out = folder.path().join("rust.png");
    run(Command::new(program).arg(&out));
    assert_eq!(shutterbug::plane::read_rgb8(&out).unwrap().width, 320);
}

/// Against stand-ins for Gazebo's headers, and called as Gazebo would: its own are not needed here.
#[test]
fn the_gazebo_system_leans_what_stands() {
    let include = ["-Itests/c/gazebo"];
    let Some(drive) = build("c++", "-std=c++17", "tests/c/gazebo/drive.cc", &include) else { return };
    let folder = tempfile::tempdir().unwrap();
    let camera = folder.path().join("camera.toml");
    let pinhole = "width = 160\nheight = 120\nfx = 150\nfy = 150\ncx = 80\ncy = 60\nframe_period_s = 0.04\n";
    let code = |shutter: &str| {
        std::fs::write(&camera, format!("{pinhole}{shutter}")).unwrap();
        program(&drive, &[camera.to_str().unwrap()]).output().unwrap().status.code()
    };
    let found = code("[rolling_shutter]\nreadout_time_s = 0.02\n");
    assert!(found == Some(0) || found == Some(NO_DEVICE), "{found:?}");
    let none = code("");
    assert!(none == Some(1) || none == Some(NO_DEVICE), "control: without a shutter nothing leans: {none:?}");
}

#[test]
fn resident_memory_stays_flat() {
    let Some(cycles) = build("cc", "-std=c11", "tests/c/cycles.c", &[]) else { return };
    let long = crate::long_support::long();
    let counts = if long { ["1000", "40000"] } else { ["60", "3000"] };
    let out = run(&mut program(&cycles, &counts));
    eprintln!("{}", String::from_utf8_lossy(&out.stdout));
    for counts in [["60", "0"], ["0", "3000"]] {
        let code = program(&cycles, &[&counts[..], &["leak"]].concat()).output().unwrap().status.code();
        assert!(code == Some(4) || code == Some(NO_DEVICE), "control: a leak is found: {code:?}");
    }
}

/// Frames without end in one process, whose device is lost again and again. docs/robustness.md has a run of a million.
#[test]
fn a_long_life_holds_no_more_and_keeps_its_bits() {
    let Some(life) = build("cc", "-std=c11", "tests/c/long_life.c", &["-ldl"]) else { return };
    let long = crate::long_support::long();
    let counts = if long { ["1000000", "50", "10000"] } else { ["1500", "3", "50"] };
    let out = run(&mut program(&life, &counts));
    eprintln!("{}", String::from_utf8_lossy(&out.stdout));
    for (control, found) in [("leak", 4), ("change", 3)] {
        let code = program(&life, &["1500", "0", "50", control]).output().unwrap().status.code();
        assert!(code == Some(found) || code == Some(NO_DEVICE), "control {control}: {code:?}");
    }
}

#[test]
#[ignore = "long: half a minute"]
fn memcheck_finds_nothing_and_as_much_after_more_cycles() {
    if !present("valgrind") {
        return;
    }
    let Some(cycles) = build("cc", "-std=c11", "tests/c/cycles.c", &[]) else { return };
    let flags = [
        "--error-exitcode=99",
        "--leak-check=full",
        "--errors-for-leak-kinds=definite,indirect",
        "--num-callers=40",
        "--suppressions=tests/c/valgrind.supp",
    ];
    let check = |arguments: &[&str]| {
        let mut command = Command::new("valgrind");
        // One thread: memcheck runs one at a time anyway.
        command.args(flags).arg(&cycles).args(arguments).env("LP_NUM_THREADS", "1");
        let out = command.env("LD_LIBRARY_PATH", prefix().join("lib")).output().unwrap();
        let text = String::from_utf8_lossy(&out.stderr).into_owned();
        // "in use at exit: 290,317 bytes in 2,373 blocks": everything, reachable or not.
        let left = text.lines().find_map(|l| l.split_once("in use at exit: "));
        let bytes = left.and_then(|(_, left)| left.split(' ').next()?.replace(',', "").parse::<i64>().ok());
        (out.status.code(), bytes, text)
    };
    let (code, left, text) = check(&["2", "0"]);
    // movss from register to register in the form that stores: valgrind 3.19 ends the program there.
    if text.contains("Unrecognised instruction") && text.contains("swiftshader_jit") {
        eprintln!(
            "SKIPPED memcheck_finds_nothing: valgrind does not know an instruction of SwiftShader's own code"
        );
        return;
    }
    assert!(code == Some(0) || code == Some(NO_DEVICE), "{text}");
    if code != Some(0) {
        return;
    }
    let more = "1000";
    let (code, after_more, text) = check(&[more, "0"]);
    // 4 is the program's own: what memcheck keeps of freed blocks lets resident memory grow.
    assert!([Some(0), Some(4)].contains(&code), "{text}");
    let (left, after_more) = (left.expect("memcheck's summary"), after_more.expect("memcheck's summary"));
    eprintln!("in use at exit after 2 cycles: {left} bytes, after {more}: {after_more}");
    // Threads at work when the process ends make one block of 48 bytes more or less (seen once). Four cycles
    // that lose 16 bytes each are found.
    assert!(after_more < left + 64, "{left}, then {after_more} bytes\n{text}");
    let (code, leaked, _) = check(&["2", "0", "leak"]);
    assert!(code == Some(99) && leaked >= Some(left + 64), "control: a leak is found");
}

#[test]
fn the_address_sanitizer_finds_nothing() {
    if !present("cc") {
        return;
    }
    let extra = ["-fsanitize=address"];
    let Some(cycles) = build("cc", "-std=c11", "tests/c/cycles.c", &extra) else { return };
    let check = |path: &Path, arguments: &[&str]| {
        let out = program(path, arguments).env("ASAN_OPTIONS", "detect_leaks=1").output().unwrap();
        (out.status.code(), String::from_utf8_lossy(&out.stderr).into_owned())
    };
    let count = if crate::long_support::long() { "1000" } else { "8" };
    let (code, text) = check(&cycles, &[count, "20"]);
    // 4 is the program's own: the sanitizer's quarantine lets resident memory grow.
    let fine = !text.contains("Sanitizer") && [Some(0), Some(4), Some(NO_DEVICE)].contains(&code);
    assert!(fine, "{code:?}: {text}");
    if code == Some(NO_DEVICE) {
        return;
    }
    let (_, text) = check(&cycles, &["1", "0", "overflow"]);
    assert!(text.contains("heap-buffer-overflow"), "control: an overflow is found: {text}");
    let (_, text) = check(&cycles, &["2", "0", "leak"]);
    assert!(text.contains("200000 byte(s) leaked in 2 allocation(s)"), "control: a leak is found: {text}");
    // What is lost where drivers may be unloaded is theirs: a program without this library loses no less.
    let Some(instances) = build("cc", "-std=c11", "tests/c/instances.c", &extra) else { return };
    let lost = |text: &str| -> u64 {
        let line = text.lines().find(|l| l.contains("leaked in"));
        line.map_or(0, |l| {
            l.split_whitespace().find_map(|word| word.parse().ok()).expect("a number of bytes")
        })
    };
    let (_, bare) = check(&instances, &["4"]);
    let (code, ours) = check(&cycles, &["4", "0", "unload"]);
    assert!(lost(&ours) > 0 || [Some(0), Some(4)].contains(&code), "it ran to its end: {code:?}: {ours}");
    eprintln!(
        "lost to unloaded drivers in 4 cycles: {} bytes, beside this library {}",
        lost(&bare),
        lost(&ours)
    );
    // Less was seen on one machine (none of 512 bytes), perhaps for stale pointers to them: not looked into.
    assert!(lost(&ours) <= lost(&bare), "{ours}");
}
