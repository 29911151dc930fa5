//! The installed library as a host meets it: C by pkg-config and by CMake, C++ and Rust examples, memcheck, the address
//! sanitizer, and resident memory over cycles and frames. `SHUTTERBUG_LONG=1` runs 1000 cycles and 10 000 frames.
#![allow(clippy::unwrap_used)]

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, OnceLock};

/// Exit code of the C programs where there is no device.
const NO_DEVICE: i32 = 77;

/// The prefix, installed once by `tools/capi-install --plain`.
fn prefix() -> &'static Path {
    static PREFIX: OnceLock<PathBuf> = OnceLock::new();
    PREFIX.get_or_init(|| {
        let prefix = Path::new(env!("CARGO_TARGET_TMPDIR")).join("capi-prefix");
        let _ = std::fs::remove_dir_all(&prefix);
        let done = Command::new("tools/capi-install").arg(&prefix).arg("--plain").output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        prefix
    })
}

fn present(tool: &str) -> bool {
    let there = Command::new(tool).arg("--version").output().is_ok_and(|o| o.status.success());
    if !there {
        eprintln!("SKIPPED capi_install: {tool} is absent");
    }
    there
}

fn pkg_config(arguments: &[&str]) -> Vec<String> {
    let folder = prefix().join("lib/pkgconfig");
    let mut command = Command::new("pkg-config");
    let out = run(command.args(arguments).arg("shutterbug").env("PKG_CONFIG_PATH", folder));
    String::from_utf8(out.stdout).unwrap().split_whitespace().map(str::to_owned).collect()
}

#[track_caller]
fn run(command: &mut Command) -> Output {
    let out = command.env("LD_LIBRARY_PATH", prefix().join("lib")).output().unwrap();
    let text = String::from_utf8_lossy(&out.stderr).into_owned() + &String::from_utf8_lossy(&out.stdout);
    if out.status.code() == Some(NO_DEVICE) {
        assert!(std::env::var_os("SHUTTERBUG_REQUIRE_DEVICE").is_none(), "{text}");
        eprintln!("SKIPPED capi_install: {text}");
    } else {
        assert!(out.status.success(), "{command:?}: {text}");
    }
    out
}

/// Compiles against the prefix alone, each program once: two tests that link to one path at once would have one of them
/// run the file while the other's linker writes it ("Text file busy").
fn build(compiler: &str, std: &str, source: &str, extra: &[&str]) -> Option<PathBuf> {
    if !present(compiler) || !present("pkg-config") {
        return None;
    }
    let tag = extra.join("").replace(['-', '=', ','], "");
    let program = prefix().join(format!("{}{tag}", source.replace(['/', '.'], "_")));
    static BUILT: OnceLock<Mutex<HashMap<PathBuf, bool>>> = OnceLock::new();
    // A panic below is a build that failed; the next test then builds again and says so itself.
    let mut built =
        BUILT.get_or_init(Mutex::default).lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if built.get(&program) == Some(&true) {
        return Some(program);
    }
    let flags = [std, "-g", "-D_DEFAULT_SOURCE", "-Wall", "-Wextra", "-Werror", "-o"];
    let mut command = Command::new(compiler);
    command.args(flags).arg(&program).args(extra).arg(source);
    run(command.args(pkg_config(&["--cflags", "--libs"])));
    built.insert(program.clone(), true);
    Some(program)
}

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
        assert!(lines < 60, "{example} has {lines} lines");
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

#[test]
fn resident_memory_stays_flat() {
    let Some(program) = build("cc", "-std=c11", "tests/c/cycles.c", &[]) else { return };
    let long = std::env::var_os("SHUTTERBUG_LONG").is_some();
    let counts = if long { ["1000", "10000"] } else { ["60", "3000"] };
    let out = run(Command::new(&program).args(counts));
    eprintln!("{}", String::from_utf8_lossy(&out.stdout));
    // Control: 1 MB leaked a cycle is found.
    let leaky = Command::new(&program)
        .args(["60", "0", "leak"])
        .env("LD_LIBRARY_PATH", prefix().join("lib"))
        .output();
    let code = leaky.unwrap().status.code();
    assert!(code == Some(4) || code == Some(NO_DEVICE), "{code:?}");
}

#[test]
fn memcheck_finds_nothing() {
    if !present("valgrind") {
        return;
    }
    let Some(program) = build("cc", "-std=c11", "tests/c/cycles.c", &[]) else { return };
    let supp = "--suppressions=tests/c/valgrind.supp";
    let check = |arguments: &[&str]| {
        let mut command = Command::new("valgrind");
        command.args([
            "--error-exitcode=99",
            "--leak-check=full",
            "--errors-for-leak-kinds=definite,indirect",
            supp,
        ]);
        // One thread: memcheck runs one at a time anyway.
        command.arg(&program).args(arguments).env("LP_NUM_THREADS", "1");
        command.env("LD_LIBRARY_PATH", prefix().join("lib")).output().unwrap()
    };
    let out = check(&["2", "0"]);
    let code = out.status.code();
    assert!(code == Some(0) || code == Some(NO_DEVICE), "{}", String::from_utf8_lossy(&out.stderr));
    if code == Some(0) {
        assert_eq!(check(&["1", "0", "leak"]).status.code(), Some(99), "control: a leak is found");
    }
}

#[test]
fn the_address_sanitizer_finds_nothing() {
    if !present("cc") {
        return;
    }
    let extra = ["-fsanitize=address"];
    let Some(program) = build("cc", "-std=c11", "tests/c/cycles.c", &extra) else { return };
    let check = |arguments: &[&str]| {
        let mut command = Command::new(&program);
        // Leaks are memcheck's: lavapipe and LLVM are unloaded before this sanitizer looks, so that what they keep in
        // tables of their own counts as lost, without a name to suppress it by.
        command.args(arguments).env("ASAN_OPTIONS", "detect_leaks=0");
        command.env("LD_LIBRARY_PATH", prefix().join("lib")).output().unwrap()
    };
    let out = check(&["5", "0"]);
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    // 4 is the program's own: the sanitizer's quarantine lets resident memory grow.
    let fine =
        !text.contains("Sanitizer") && [Some(0), Some(4), Some(NO_DEVICE)].contains(&out.status.code());
    assert!(fine, "{:?}: {text}", out.status);
    let control = check(&["1", "0", "overflow"]);
    let seen = String::from_utf8_lossy(&control.stderr).contains("heap-buffer-overflow");
    assert!(seen || out.status.code() == Some(NO_DEVICE), "control: an overflow is found");
}
