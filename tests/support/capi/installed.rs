//! The library below a prefix of this test's own, and C programs that are built against nothing else.
#![allow(dead_code, clippy::unwrap_used)]

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, OnceLock};

/// Exit code of the C programs where there is no device.
pub const NO_DEVICE: i32 = 77;

/// The prefix, installed once by `tools/capi-install --plain`; or that of `SHUTTERBUG_PREFIX` as it is (one made by
/// `cargo cinstall`, with the library in `lib`).
pub fn prefix() -> &'static Path {
    static PREFIX: OnceLock<PathBuf> = OnceLock::new();
    PREFIX.get_or_init(|| {
        if let Some(there) = std::env::var_os("SHUTTERBUG_PREFIX") {
            return PathBuf::from(there);
        }
        let prefix = Path::new(env!("CARGO_TARGET_TMPDIR")).join(env!("CARGO_CRATE_NAME"));
        let _ = std::fs::remove_dir_all(&prefix);
        let done = Command::new("tools/capi-install").arg(&prefix).arg("--plain").output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        prefix
    })
}

pub fn present(tool: &str) -> bool {
    let there = Command::new(tool).arg("--version").output().is_ok_and(|o| o.status.success());
    if !there {
        eprintln!("SKIPPED capi_install: {tool} is absent");
    }
    there
}

pub fn pkg_config(arguments: &[&str]) -> Vec<String> {
    let folder = prefix().join("lib/pkgconfig");
    let mut command = Command::new("pkg-config");
    let out = run(command.args(arguments).arg("shutterbug").env("PKG_CONFIG_PATH", folder));
    String::from_utf8(out.stdout).unwrap().split_whitespace().map(str::to_owned).collect()
}

#[track_caller]
pub fn run(command: &mut Command) -> Output {
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
pub fn build(compiler: &str, std: &str, source: &str, extra: &[&str]) -> Option<PathBuf> {
    if !present(compiler) || !present("pkg-config") {
        return None;
    }
    let tag = extra.join("").replace(['-', '=', ',', '/', '.'], "");
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

/// A C program with the prefix's library at hand.
pub fn program(program: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(program);
    command.args(arguments).env("LD_LIBRARY_PATH", prefix().join("lib"));
    command
}
