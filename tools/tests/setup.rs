//! `tools/setup` on machines made of stand-ins: a folder of small programs is all that it can find, so nothing of the
//! real machine is changed or asked.

#![cfg(unix)]

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const PACKAGES: [&str; 8] = [
    "libvulkan1",
    "mesa-vulkan-drivers",
    "vulkan-validationlayers",
    "g++",
    "pkg-config",
    "libshaderc-dev",
    "spirv-tools",
    "python3-venv",
];

/// A pretended machine.
struct Machine {
    folder: tempfile::TempDir,
}

impl Machine {
    /// With `os_release`, Rust 1.91, root, and all packages but `missing`.
    fn new(os_release: &str, missing: &[&str]) -> Self {
        let machine = Self { folder: tempfile::tempdir().expect("a temporary folder") };
        for folder in ["bin", "lib", "home", "project/tools"] {
            fs::create_dir_all(machine.path(folder)).expect("a new folder");
        }
        let real = Path::new(env!("CARGO_MANIFEST_DIR")).join("setup");
        let script = fs::read_to_string(real).expect("tools/setup");
        let os_file = machine.path("os-release");
        fs::write(&os_file, os_release).expect("written");
        let script = script.replace("/etc/os-release", &os_file.display().to_string());
        fs::write(machine.path("project/tools/setup"), script).expect("written");
        for name in ["bash", "env", "sed", "grep", "mkdir", "rm", "dirname", "cat"] {
            let found =
                ["/bin", "/usr/bin"].map(|d| Path::new(d).join(name)).into_iter().find(|p| p.exists());
            symlink(
                found.unwrap_or_else(|| panic!("{name} on this machine")),
                machine.path("bin").join(name),
            )
            .expect("linked");
        }
        let installed: Vec<&str> = PACKAGES.into_iter().filter(|p| !missing.contains(p)).collect();
        fs::write(machine.path("installed"), installed.join("\n") + "\n").expect("written");
        let at = machine.folder.path().display().to_string();
        machine.program("cargo", "echo 'cargo 1.91.0 (x)'");
        machine.program("rustc", "echo 'host: some-target'");
        machine.program("id", "echo 0");
        machine.program("pkg-config", &format!("echo {at}/lib"));
        machine.program(
            "dpkg-query",
            &format!("while read -r p; do echo \"installed $p\"; done <{at}/installed; exit 1"),
        );
        machine.program(
            "apt-get",
            &format!(
                "echo \"$*\" >>{at}/log\nfor a in \"$@\"; do [ \"$a\" = install ] && echo >>{at}/installed && \
                 printf '%s\\n' \"$@\" >>{at}/installed; done; true"
            ),
        );
        for lib in [
            "shaderc_combined",
            "glslang",
            "MachineIndependent",
            "GenericCodeGen",
            "OGLCompiler",
            "OSDependent",
        ]
        .into_iter()
        .chain(["SPIRV", "SPIRV-Tools-opt", "SPIRV-Tools"])
        {
            fs::write(machine.path("lib").join(format!("lib{lib}.a")), "").expect("written");
        }
        machine
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn program(&self, name: &str, body: &str) {
        let path = self.path("bin").join(name);
        fs::write(&path, format!("#!{}\n{body}\n", self.path("bin/bash").display())).expect("written");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("executable");
    }

    /// Runs the script: whether it succeeded, and what it said.
    fn run(&self) -> (bool, String) {
        let mut command = Command::new(self.path("bin/bash"));
        command.arg(self.path("project/tools/setup")).env_clear();
        command.env("PATH", self.path("bin")).env("HOME", self.path("home"));
        let Output { status, stdout, stderr } = command.output().expect("bash runs");
        assert!(stdout.is_empty(), "set-up speaks on stderr only");
        (status.success(), String::from_utf8(stderr).expect("UTF-8"))
    }

    fn read(&self, name: &str) -> Option<String> {
        fs::read_to_string(self.path(name)).ok()
    }
}

const BOOKWORM: &str = "ID=debian\nVERSION_CODENAME=bookworm\n";

#[test]
fn missing_packages_are_named_with_reasons_and_installed_once() {
    let derivative = "ID=other\nID_LIKE=\"debian\"\nVERSION_CODENAME=faye\nDEBIAN_CODENAME=bookworm\n";
    for os_release in [BOOKWORM, derivative] {
        let machine = Machine::new(os_release, &["g++", "spirv-tools"]);
        let (done, said) = machine.run();
        assert!(done, "{said}");
        assert!(
            said.contains("missing g++: links") && said.contains("missing spirv-tools: static"),
            "{said}"
        );
        assert!(!said.contains("missing libvulkan1"), "{said}");
        let log = machine.read("log").expect("apt-get was called");
        let calls: Vec<&str> = log.lines().collect();
        assert_eq!(calls, ["update -qq", "install -y -qq --no-install-recommends g++ spirv-tools"]);
        let config = machine.read("project/.cargo/config.toml").expect("the override was written");
        assert!(
            config.contains("[target.some-target.shaderc]") && config.contains("\"stdc++\"]"),
            "{config}"
        );
        assert!(config.contains(&format!("native={}", machine.path("lib").display())), "{config}");
        assert_eq!(config.matches("static=").count(), 9);
        // The second run finds nothing to do.
        assert_eq!(machine.run(), (true, String::new()));
        assert_eq!(machine.read("log").as_ref(), Some(&log));
    }
}

#[test]
fn sudo_only_where_not_root() {
    let machine = Machine::new(BOOKWORM, &["g++"]);
    machine.program("id", "echo 1000");
    let (done, said) = machine.run();
    assert!(!done && said.contains("as root: apt-get install g++"), "{said}");
    assert_eq!(machine.read("log"), None);
    machine.program("sudo", &format!("echo sudo >>{}; exec \"$@\"", machine.path("log").display()));
    assert!(machine.run().0);
    assert_eq!(machine.read("log").expect("called").matches("sudo").count(), 2);
}

#[test]
fn a_failing_apt_stops_it() {
    let machine = Machine::new(BOOKWORM, &["g++"]);
    machine.program("apt-get", "exit 100");
    let (done, said) = machine.run();
    assert!(!done && said.contains("apt-get failed"), "{said}");
}

#[test]
fn other_distributions_get_a_list_and_nothing_is_installed() {
    for os_release in ["ID=fedora\nVERSION_CODENAME=\n", "ID=debian\nVERSION_CODENAME=trixie\n"] {
        let machine = Machine::new(os_release, &PACKAGES);
        machine.program("c++", "true");
        let (done, said) = machine.run();
        assert!(!done, "{said}");
        for part in ["missing cmake: ", "missing git: ", "missing python3: ", "ten minutes"] {
            assert!(said.contains(part), "{part} in {said}");
        }
        assert!(!said.contains("missing c++"), "{said}");
        assert_eq!(machine.read("log"), None, "apt-get is not called");
        assert_eq!(machine.read("project/.cargo/config.toml"), None);
    }
}

#[test]
fn old_or_absent_rust_stops_it() {
    for version in ["cargo 1.87.0 (x)", "no such thing"] {
        let machine = Machine::new(BOOKWORM, &["g++"]);
        machine.program("cargo", &format!("echo '{version}'"));
        let (done, said) = machine.run();
        assert!(!done && said.contains("rustup.rs") && said.contains("1.91"), "{said}");
        assert_eq!(machine.read("log"), None, "nothing is installed for a build that cannot happen");
    }
}

#[test]
fn cargo_settings_of_others_stay() {
    let theirs = "[net]\noffline = true\n";
    let machine = Machine::new(BOOKWORM, &[]);
    fs::create_dir_all(machine.path("project/.cargo")).expect("a new folder");
    fs::write(machine.path("project/.cargo/config.toml"), theirs).expect("written");
    let (done, said) = machine.run();
    assert!(!done && said.contains("is not ours") && said.contains("missing cmake"), "{said}");
    assert_eq!(machine.read("project/.cargo/config.toml").as_deref(), Some(theirs));
    // An override that is there already serves: in this file, or in a folder above.
    let own = format!("{theirs}[target.some-target.shaderc]\n");
    fs::write(machine.path("project/.cargo/config.toml"), &own).expect("written");
    assert_eq!(machine.run(), (true, String::new()));
    fs::remove_file(machine.path("project/.cargo/config.toml")).expect("removed");
    fs::create_dir_all(machine.path(".cargo")).expect("a new folder");
    fs::write(machine.path(".cargo/config.toml"), own).expect("written");
    assert_eq!(machine.run(), (true, String::new()));
    assert_eq!(machine.read("project/.cargo/config.toml"), None);
}

#[test]
fn an_override_that_went_stale_is_mended_or_removed() {
    let machine = Machine::new(BOOKWORM, &[]);
    assert!(machine.run().0);
    let right = machine.read("project/.cargo/config.toml").expect("written");
    fs::write(machine.path("project/.cargo/config.toml"), right.replace("some-target", "old-target"))
        .expect("written");
    assert!(machine.run().0);
    assert_eq!(machine.read("project/.cargo/config.toml"), Some(right));
    fs::remove_file(machine.path("lib/libSPIRV.a")).expect("removed");
    let (done, said) = machine.run();
    assert!(!done && said.contains("libSPIRV.a is absent") && said.contains("missing cmake"), "{said}");
    assert_eq!(machine.read("project/.cargo/config.toml"), None);
}
