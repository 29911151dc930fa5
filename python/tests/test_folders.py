"""Folders: simulate, diagnose, calibrate, by the program that comes along."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import shutterbug
from shutterbug import errors, transforms

pytestmark = pytest.mark.usefixtures("device")
DEMO = Path(os.environ.get("SHUTTERBUG_DEMO_CAPTURE", Path(__file__).parents[2] / "demo/capture"))


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """The demo, smaller."""
    to = tmp_path_factory.mktemp("captures") / "capture"
    shutil.copytree(DEMO, to)
    shutterbug.Camera.from_toml(DEMO / "camera.toml").with_pinhole(112, 84).save(to / "camera.toml")
    return to


def test_simulate_is_the_program(capture, tmp_path, monkeypatch):
    heard = []
    cam = shutterbug.Camera.from_toml(capture / "camera.toml").with_effects({"read_noise": {"sigma": 0.02}})
    files = shutterbug.simulate(capture, tmp_path / "a", camera=cam, seed=3, progress=lambda *a: heard.append(a))
    assert len(files) == len((capture / "frames.csv").read_text().splitlines()) - 1
    cam.save(tmp_path / "camera.toml")
    words = ["simulate", capture, "--out", tmp_path / "b", "--camera", tmp_path / "camera.toml", "--seed", "3"]
    subprocess.run([sys.executable, "-m", "shutterbug", *words], check=True, capture_output=True)
    for file in files:
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes()
    with pytest.raises(errors.ProgramError, match="nowhere") as caught:
        shutterbug.simulate("/nowhere", tmp_path / "c")
    assert caught.value.code == 1
    # As in a notebook, whose kernel asks for colours.
    monkeypatch.setenv("CLICOLOR_FORCE", "1")
    with pytest.raises(errors.ArgumentError, match=r"^unexpected argument '--colour'"):
        shutterbug.simulate(capture, tmp_path / "c", colour=3)


def test_two_folders_are_diagnosed(capture, tmp_path, capsys):
    """The page docs/python/diagnose.md does the same with a capture."""
    cam = shutterbug.Camera.from_toml(capture / "camera.toml")
    shutterbug.simulate(capture, tmp_path / "sim")
    shutterbug.simulate(capture, tmp_path / "real", camera=cam.with_effects({"read_noise": {"sigma": 0.04}}))
    found = shutterbug.diagnose(real=tmp_path / "real", sim=tmp_path / "sim", out=tmp_path / "report", time_limit_s=30)
    assert capsys.readouterr().err.strip()
    first = found.effects[0]
    assert (first["effect"], first["parameter"]) == ("read_noise", "sigma") and first["value"] == pytest.approx(0.04, rel=0.2)
    assert found.gap["before"] > found.gap["after"] and found.page.exists()
    assert "read_noise" in repr(found) and "<table>" in found._repr_html_()
    assert found.camera.effects["read_noise"]["sigma"] == first["value"]
    low, high = transforms.Ranges.of_diagnosis(found).values["read_noise.sigma"]
    assert low <= first["value"] <= high
    with pytest.raises(errors.ArgumentError, match="which capture"):
        found.simulate(tmp_path / "again")
    with pytest.raises(errors.ArgumentError, match="capture"):
        shutterbug.diagnose(real=tmp_path / "real")


def test_calibrate_measures_noise(device, tmp_path):
    """Against the camera that made the frames."""
    cam = shutterbug.Camera(160, 120, fovy=50, effects={"read_noise": {"sigma": 0.02}}, seed=3)
    steps = np.repeat(np.linspace(40, 200, 16).astype(np.uint8), 10)
    scene = np.ascontiguousarray(np.broadcast_to(steps[None, :, None], (120, 160, 3)))
    files = []
    for i in range(6):
        files.append(tmp_path / f"{i}.png")
        Image.fromarray(cam(scene, frame=i)).save(files[-1])
    report = shutterbug.calibrate(files, tmp_path / "out")
    measured = shutterbug.Camera.from_toml(tmp_path / "out/camera.toml").effects
    assert report and measured["read_noise"]["sigma"] == pytest.approx(0.02, rel=0.35)
    with pytest.raises(errors.ProgramError, match=r"none\.png"):
        shutterbug.calibrate([tmp_path / "none.png", tmp_path / "none.png"], tmp_path / "out2")
