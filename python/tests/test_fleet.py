"""Many captures: the same bytes from any number of workers, killed and resumed; by shares, and by Ray where it is installed."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tarfile
import threading
import time
from pathlib import Path

import pytest

import shutterbug
from shutterbug import errors, fleet

pytestmark = pytest.mark.usefixtures("device")
DEMO = Path(os.environ.get("SHUTTERBUG_DEMO_CAPTURE", Path(__file__).parents[2] / "demo/capture"))
COUNT = 3


@pytest.fixture(scope="module")
def captures(tmp_path_factory):
    """Small captures of two frames with noise, and a list of them."""
    folder = tmp_path_factory.mktemp("dataset")
    noisy = shutterbug.Camera.from_toml(DEMO / "camera.toml").with_pinhole(64, 48).with_effects({"read_noise": {"sigma": 0.05}})
    for i in range(COUNT):
        shutil.copytree(DEMO, folder / f"drive-{i}")
        noisy.save(folder / f"drive-{i}/camera.toml")
        frames = (DEMO / "frames.csv").read_text().splitlines()
        (folder / f"drive-{i}/frames.csv").write_text("\n".join(frames[:3]) + "\n")
    (folder / "list.txt").write_text("# all\n" + "\n".join(f"drive-{i}" for i in range(COUNT)) + "\n")
    return folder


@pytest.fixture(scope="module")
def expected(captures, tmp_path_factory):
    out = tmp_path_factory.mktemp("one")
    assert program("simulate", captures / "list.txt", "--out", out, "--seed", "7").returncode == 0
    return manifest(out)


def program(*words, **options):
    return subprocess.run([sys.executable, "-m", "shutterbug", *map(str, words)], capture_output=True, text=True, **options)


def manifest(out):
    return [json.loads(line) for line in (out / "manifest.jsonl").read_text().splitlines()]


def test_rows_say_what_was_made(expected, captures):
    assert [r["name"] for r in expected] == [f"drive-{i}" for i in range(COUNT)]
    assert len({r["sha256"] for r in expected}) == COUNT and len({r["seed"] for r in expected}) == COUNT
    # The captures differ by nothing but their names: so do their seeds alone tell the pictures apart.
    assert len({r["inputs_sha256"] for r in expected}) == 1 and all(r["frames"] == 2 and r["device"] for r in expected)


def test_shares_make_the_same_bytes(captures, expected, tmp_path):
    for i in (1, 0):
        run = program("simulate", captures / "list.txt", "--out", tmp_path, "--seed", "7", "--shard", f"{i}/2")
        assert run.returncode == 0, run.stderr
    assert manifest(tmp_path) == expected
    # The control: another seed of the data set gives others.
    other = fleet.make(fleet.tasks_of([captures / "drive-0"], seed=8)[0], tmp_path / "other")
    assert other["sha256"] != expected[0]["sha256"]


def test_a_killed_run_is_resumed(captures, expected, tmp_path):
    words = [sys.executable, "-m", "shutterbug", "simulate", captures / "list.txt", "--out", tmp_path, "--seed", "7"]
    run = subprocess.Popen([*words], stderr=subprocess.PIPE, text=True, start_new_session=True)
    assert run.stderr.readline()
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    done = list((tmp_path / "rows").glob("drive-*.json"))
    assert 1 <= len(done) < COUNT and not (tmp_path / "manifest.jsonl").exists()
    stamps = {p: p.stat().st_mtime_ns for p in done}
    assert program(*words[3:]).returncode == 1
    assert program(*words[3:], "--resume").returncode == 0
    assert manifest(tmp_path) == expected
    assert all(p.stat().st_mtime_ns == t for p, t in stamps.items())


def test_shards_of_webdataset_are_the_same_bytes(captures, expected, tmp_path):
    task = fleet.tasks_of([captures / "drive-0"], seed=7)[0]
    rows = [fleet.make(task, tmp_path / which, "webdataset") for which in "ab"]
    assert rows[0] == rows[1] and rows[0]["sha256"] == expected[0]["sha256"]
    tars = [(tmp_path / which / "drive-0.tar").read_bytes() for which in "ab"]
    assert tars[0] == tars[1]
    with tarfile.open(tmp_path / "a/drive-0.tar") as tar:
        names = tar.getnames()
        assert names == ["drive-0/000000.png", "drive-0/000000.json", "drive-0/000001.png", "drive-0/000001.json"]
        about = json.load(tar.extractfile(names[1]))
    assert about["frame"] == 0 and any("first" in k or "time" in k for k in about["instants"])


def test_wrong_data_sets_are_refused(captures, tmp_path):
    with pytest.raises(errors.ArgumentError, match="same name"):
        fleet.tasks_of([captures / "drive-0", captures / "x/../drive-0"])
    with pytest.raises(errors.ArgumentError, match="folder"):
        fleet.make(fleet.tasks_of([captures / "drive-0"])[0], tmp_path, "zip")
    with pytest.raises(errors.ProgramError):
        fleet.make(fleet.tasks_of([tmp_path / "none"])[0], tmp_path)
    assert not (tmp_path / "none").exists() and not list(tmp_path.glob(".none*"))
    for wrong in ("3/3", "x", "1/0"):
        assert program("simulate", captures / "list.txt", "--out", tmp_path, "--shard", wrong).returncode == 2


@pytest.fixture(scope="module")
def cluster():
    ray = pytest.importorskip("ray", reason="ray is not installed")
    pytest.importorskip("ray.data", reason="ray[data] is not installed")
    from ray.cluster_utils import Cluster

    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 8, "object_store_memory": 10**8})
    made.add_node(num_cpus=8, object_store_memory=10**8)
    ray.init(address=made.address, log_to_driver=False)
    ray.data.DataContext.get_current().enable_progress_bars = False
    yield ray
    ray.shutdown()
    made.shutdown()


@pytest.mark.parametrize("actors", [1, 3, 7])
def test_any_number_of_actors_makes_the_same_bytes(cluster, captures, expected, tmp_path, actors):
    rows = shutterbug_ray().simulate(folders(captures), tmp_path, actors=actors, cpus=1, seed=7)
    assert rows == expected == manifest(tmp_path)


def test_an_actor_that_is_killed_loses_nothing(cluster, captures, expected, tmp_path):
    from ray.util.state import list_actors

    killed = []

    def kill():
        for _ in range(600):
            if list((tmp_path / "rows").glob("*.json")):
                ours = [a for a in list_actors() if "MapWorker" in a.class_name and a.state == "ALIVE" and a.pid]
                if ours:
                    os.kill(ours[0].pid, signal.SIGKILL)
                    killed.append(ours[0].pid)
                    return
            time.sleep(0.05)

    killer = threading.Thread(target=kill)
    killer.start()
    rows = shutterbug_ray().simulate(folders(captures), tmp_path, actors=2, cpus=1, seed=7)
    killer.join()
    assert killed and rows == expected


def folders(captures):
    return [captures / f"drive-{i}" for i in range(COUNT)]


def shutterbug_ray():
    import shutterbug.ray

    return shutterbug.ray
