"""The package as it is installed: what it says of itself, its types, its pages, and life without a loader or a compiler."""

import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import shutterbug

import needs

SOURCES = Path(os.environ.get("SHUTTERBUG_SOURCES", Path(__file__).parents[2]))
PAGES = [SOURCES / "python/README.md", *sorted((SOURCES / "docs/python").glob("*.md"))]


def code_of(page):
    return re.findall(r"^```python\n(.*?)^```", page.read_text("utf-8"), re.M | re.S)


def bare_python():
    found = os.environ.get("SHUTTERBUG_BARE_PYTHON")
    if not found:
        pytest.skip("SHUTTERBUG_BARE_PYTHON names no environment with the wheels alone")
    return found


@pytest.mark.parametrize("page", [p for p in PAGES if code_of(p)], ids=lambda p: p.name)
def test_the_code_of_each_page_runs(page, device, tmp_path, monkeypatch):
    named = re.search(r"<!-- needs: (.*?) -->", page.read_text("utf-8"))
    for name in named[1].split() if named else []:
        needs.mujoco() if name == "mujoco" else pytest.importorskip(name, reason=f"{name} is not installed")
    monkeypatch.chdir(tmp_path)
    names = {"DEMO_CAPTURE": SOURCES / "demo/capture"}
    for code in code_of(page):
        exec(compile(code, str(page), "exec"), names)


def test_the_first_page_runs_where_nothing_else_is(tmp_path):
    """In an environment of the wheels alone, without a compiler on the way, and without a Vulkan driver of the machine's own."""
    script = "\n".join(code_of(SOURCES / "python/README.md")) + "\nprint(picture.shape, cam.device['name'])"
    nowhere = str(tmp_path / "none.json")
    alone = {"PATH": "/nowhere", "HOME": str(tmp_path), "VK_DRIVER_FILES": nowhere, "VK_ICD_FILENAMES": nowhere}
    run = subprocess.run([bare_python(), "-c", script], env=alone, capture_output=True, text=True, cwd=tmp_path)
    if "pip install shutterbug-driver" in run.stderr:
        pytest.skip("shutterbug-driver could not be made here: no SwiftShader from Debian")
    assert run.returncode == 0, run.stderr
    assert "(480, 640, 3) SwiftShader" in run.stdout and "runs on SwiftShader" in run.stderr


def test_it_needs_no_loader(tmp_path):
    """The loader is hidden in a mount namespace, where that is allowed."""
    folders = [folder for top in ("/usr/lib", "/usr/lib64", "/usr/local/lib") for folder in (Path(top), *Path(top).glob("*-linux-*"))]
    loaders = {str(file.resolve()) for folder in folders for file in folder.glob("libvulkan.so.1")}
    hide = "".join(f"mount --bind /dev/null {loader} && " for loader in loaders)
    unshare = shutil.which("unshare")
    probe = [unshare or "", "-m", "sh", "-c", f"{hide}true"]
    if unshare is None or subprocess.run(probe, capture_output=True).returncode:
        pytest.skip("the loader cannot be hidden here: no unshare, or no right to mount")
    program = Path(bare_python()).parent / "shutterbug"
    run = subprocess.run([unshare, "-m", "sh", "-c", f"{hide}exec {program} devices"], capture_output=True, text=True)
    if run.returncode and "libvulkan" in run.stderr:
        pytest.skip("shutterbug-driver could not be made here: no SwiftShader from Debian")
    assert run.returncode == 0 and "SwiftShader" in run.stdout, run.stderr


def test_import_brings_numpy_and_little_else():
    """What takes long to import (pictures, notebooks, hosts) is imported where it is used. tools/throughput has the time."""
    line = "import sys, numpy; before = set(sys.modules); import shutterbug; print(*sorted(set(sys.modules) - before))"
    own = {"numpy", "shutterbug"}
    run = subprocess.run([sys.executable, "-c", line], capture_output=True, text=True, check=True)
    brought = {name.partition(".")[0] for name in run.stdout.split()}
    strangers = {name for name in brought if name not in sys.stdlib_module_names} - own
    assert not strangers, f"imported besides NumPy: {strangers}"
    others = [name for name in run.stdout.split() if name.partition(".")[0] not in own]
    assert len(others) < 40, f"{len(others)} modules: {others}"
    control = subprocess.run([sys.executable, "-c", line.replace("shutterbug", "PIL.Image")], capture_output=True, text=True, check=True)
    assert "PIL" in control.stdout.split()


def test_statuses_are_those_of_the_library():
    from shutterbug import _core, errors

    names = [name for name, _ in _core.statuses()]
    header = (SOURCES / "include/shutterbug.h").read_text("utf-8")
    assert names == re.findall(r"^    SHUTTERBUG_(\w+) = \d+,?\s+/\*|^    SHUTTERBUG_(OK) = 0", header, re.M) or len(names) == 23
    for number, name in enumerate(names[1:], 1):
        error = errors.of_status(number, "said")
        assert error.status == name and isinstance(error, shutterbug.ShutterbugError) and str(error) == "said"
        assert type(error) is not shutterbug.ShutterbugError
    assert str(errors.of_status(1, "")) and errors.of_status(99, "x").status == "VULKAN"


def checked(*words):
    run = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True, cwd=SOURCES / "python")
    assert run.returncode == 0, run.stdout + run.stderr


def test_types_are_sound_for_mypy():
    pytest.importorskip("mypy")
    checked("mypy", "--strict", "--cache-dir", os.devnull, "-p", "shutterbug")


def test_types_are_sound_for_pyright():
    needs.long("mypy reads the same types")
    pytest.importorskip("pyright")
    checked("pyright", "--pythonpath", sys.executable, "shutterbug")


def against_the_compiled_part(stub, folder):
    """What mypy's stubtest says of a stub of the compiled part: it imports it, and compares names, parameters and defaults."""
    package = Path(shutterbug.__file__).parent
    (folder / "shutterbug").mkdir()
    for file in package.glob("*.py"):
        (folder / "shutterbug" / file.name).symlink_to(file)
    (folder / "shutterbug/py.typed").touch()
    (folder / "shutterbug/_core.pyi").write_text(stub)
    env = {**os.environ, "MYPYPATH": str(folder)}
    words = [sys.executable, "-P", "-m", "mypy.stubtest", "shutterbug._core"]
    run = subprocess.run(words, capture_output=True, text=True, cwd=folder, env=env)
    return run.stdout + run.stderr if run.returncode else ""


def test_the_stub_is_the_generated_one():
    run = subprocess.run([SOURCES / "tools/stubs", "--check"], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr


def test_the_stub_is_what_the_compiled_part_has(tmp_path):
    pytest.importorskip("mypy")
    own = (SOURCES / "python/shutterbug/_core.pyi").read_text("utf-8")
    (tmp_path / "own").mkdir()
    assert against_the_compiled_part(own, tmp_path / "own") == ""


def test_a_stub_of_something_else_is_seen(tmp_path):
    """The controls: another default, a parameter too many, a function that is not there."""
    needs.long("mypy runs once more")
    pytest.importorskip("mypy")
    own = (SOURCES / "python/shutterbug/_core.pyi").read_text("utf-8")
    wrong = own.replace("seed: int = 0", "seed: int = 1").replace("limit_s: float = ...)", "limit_s: float = ..., frame: int = 0)")
    (tmp_path / "wrong").mkdir()
    said = against_the_compiled_part(wrong + "\ndef nothing() -> None:\n    ...\n", tmp_path / "wrong")
    assert "Engine.__new__" in said and "Frame.wait" in said and "_core.nothing" in said and said.count("error:") == 3, said


def test_a_wrong_call_is_seen_by_mypy(tmp_path):
    """The control: types that say nothing would let this through."""
    pytest.importorskip("mypy")
    wrong = tmp_path / "wrong.py"
    wrong.write_text("import shutterbug\nshutterbug.Camera('640', 480).middel()\nx: int = shutterbug.devices()\n")
    run = subprocess.run([sys.executable, "-m", "mypy", "--cache-dir", os.devnull, wrong], capture_output=True, text=True)
    assert run.stdout.count("error:") == 3, run.stdout


def test_style():
    pytest.importorskip("ruff")
    checked("ruff", "check", "--no-cache", ".")
    checked("ruff", "format", "--no-cache", "--check", ".")


def test_the_sources_build(device, tmp_path):
    """Into a wheel that gives a picture, in a clean environment: pip fetches all that it needs but a compiler and cargo."""
    needs.long("the sources are built anew")
    maturin = SOURCES / "target/python/build/bin/maturin"
    if not maturin.exists():
        pytest.skip("no maturin: tools/python-tests installs it")
    # Below the sources, so that cargo finds what tools/setup has written of the machine's own shaderc.
    folder = SOURCES / "target/python/sdist"
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "tmp").mkdir(parents=True)
    env = {**os.environ, "TMPDIR": str(folder / "tmp"), "CARGO_TARGET_DIR": str(SOURCES / "target")}
    done = {"check": True, "capture_output": True, "text": True}
    subprocess.run([maturin, "sdist", "--out", folder], cwd=SOURCES / "python", **done)
    subprocess.run([sys.executable, "-m", "venv", folder / "venv"], **done)
    pip, python = folder / "venv/bin/pip", folder / "venv/bin/python"
    (sources,) = folder.glob("shutterbug-*.tar.gz")
    subprocess.run([pip, "wheel", "-q", "--no-deps", "-w", folder, sources], env=env, cwd=tmp_path, **done)
    (wheel,) = folder.glob("shutterbug-*.whl")
    subprocess.run([pip, "install", "-q", "--no-deps", wheel], **done)
    subprocess.run([pip, "install", "-q", "numpy"], **done)
    script = (
        "import numpy as np, shutterbug; p = np.full((48, 64, 3), 99, np.uint8); assert (shutterbug.Camera(64, 48, fovy=50)(p) == p).all()"
    )
    subprocess.run([python, "-c", script], **done)


def rendered(text):
    """A recipe as rattler-build, conda-forge's builder, understands it."""
    from rattler_build.stage0 import Stage0Recipe

    (variant,) = Stage0Recipe.from_yaml(text).render()
    return variant.recipe.to_dict()


def test_the_recipe_for_conda_says_what_the_package_says():
    pytest.importorskip("rattler_build", reason="py-rattler-build is not installed")
    import tomllib

    recipe = rendered((SOURCES / "python/conda/recipe.yaml").read_text("utf-8"))
    project = tomllib.loads((SOURCES / "python/pyproject.toml").read_text("utf-8"))
    own, needed = project["project"], recipe["requirements"]
    assert recipe["package"]["version"] == own["version"] and recipe["about"]["license"] == own["license"]
    assert f"python {own['requires-python']}" in needed["run"] and "numpy >=1.26" in needed["run"]
    assert [d for d in own["dependencies"] if d.replace(">", " >", 1) in needed["run"]] == ["numpy>=1.26"]
    (script,) = recipe["build"]["python"]["entry_points"]
    assert script == f"shutterbug = {own['scripts']['shutterbug']}"
    for tool in project["build-system"]["requires"]:
        assert re.split("[><=]", tool)[0] in " ".join(map(str, needed["build"]))
    for file in recipe["about"]["license_file"]:
        # The one that tools/wheel writes is made of Cargo.lock.
        assert (SOURCES / "python" / file).exists() or file.endswith("RUST-PACKAGES.txt")


@pytest.mark.parametrize(
    ("sound", "wrong"),
    [
        ("entry_points", "entry_point"),
        ("run_constraints", "run_constraint"),
        ("version: ${{ version }}", "version: ${{ versions }}"),
        ("number: 0", "number: none"),
        ("MIT OR Apache-2.0", "MIT OR Apache"),
        ("numpy >=1.26", "numpy >=>1.26"),
    ],
)
def test_a_wrong_recipe_for_conda_is_refused(sound, wrong):
    """The control: what is read is held to conda's own rules."""
    rattler_build = pytest.importorskip("rattler_build", reason="py-rattler-build is not installed")
    text = (SOURCES / "python/conda/recipe.yaml").read_text("utf-8")
    assert sound in text
    with pytest.raises(rattler_build.RattlerBuildError):
        rendered(text.replace(sound, wrong))


def test_wheels_hold_their_licences():
    wheels = sorted((SOURCES / "target/python/dist").rglob("*.whl"))
    if not wheels:
        pytest.skip("no wheels were made: tools/python-tests makes them")
    for wheel in wheels:
        names = zipfile.ZipFile(wheel).namelist()
        licences = [n for n in names if "/licenses/" in n]
        assert len(licences) >= 2 and all(zipfile.ZipFile(wheel).read(n) for n in licences)
        assert any(n.endswith("py.typed") for n in names)
    own = next(w for w in wheels if not w.name.startswith("shutterbug_driver"))
    record = zipfile.ZipFile(own).read(next(n for n in zipfile.ZipFile(own).namelist() if n.endswith("RUST-PACKAGES.txt"))).decode()
    assert "pyo3 0.29" in record and "ash 0.38" in record
