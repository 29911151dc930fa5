"""Many captures: the same bytes from any number of workers, killed and resumed; by shares, and by Ray where it is installed."""

import hashlib
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

import needs

pytestmark = pytest.mark.usefixtures("device")
DEMO = Path(os.environ.get("SHUTTERBUG_DEMO_CAPTURE", Path(__file__).parents[2] / "demo/capture"))
COUNT = 3
# Of the runs that are killed in the middle.
MANY = 9


@pytest.fixture(scope="module")
def captures(tmp_path_factory):
    """Small captures of two frames with noise, and a list of them."""
    folder = tmp_path_factory.mktemp("dataset")
    noisy = shutterbug.Camera.from_toml(DEMO / "camera.toml").with_pinhole(64, 48).with_effects({"read_noise": {"sigma": 0.05}})
    for i in range(MANY):
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


EXAMPLES = Path(os.environ.get("SHUTTERBUG_SOURCES", Path(__file__).parents[2])) / "examples"


def found_program():
    """The environment of a task on a machine where the package is installed."""
    return {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}


def test_the_example_for_slurm_makes_the_same_bytes(captures, expected, tmp_path):
    words = ["bash", EXAMPLES / "slurm/simulate.sh", captures / "list.txt", tmp_path, "--seed", "7"]
    for task in ("1", "0"):
        own = {"SLURM_ARRAY_TASK_ID": task, "SLURM_ARRAY_TASK_COUNT": "2", "SLURM_CPUS_PER_TASK": "1"}
        run = subprocess.run(words, env={**found_program(), **own}, capture_output=True, text=True)
        assert run.returncode == 0, run.stderr
        # The control: half of the list is no data set yet.
        assert (tmp_path / "manifest.jsonl").exists() == (task == "0")
    assert manifest(tmp_path) == expected
    without = subprocess.run(words, env=found_program(), capture_output=True, text=True)
    assert without.returncode != 0 and "sbatch" in without.stderr


def test_the_example_for_kubernetes_makes_the_same_bytes(captures, expected, tmp_path):
    yaml = pytest.importorskip("ruamel.yaml", reason="ruamel.yaml is not installed")
    job = yaml.YAML(typ="safe").load((EXAMPLES / "kubernetes/job.yaml").read_text("utf-8"))["spec"]
    (container,) = job["template"]["spec"]["containers"]
    told = {e["name"]: e["value"] for e in container["env"]}
    assert job["completionMode"] == "Indexed" and job["completions"] == int(told["SHARES"])
    assert container["resources"]["requests"]["cpu"] == int(told["LP_NUM_THREADS"])
    ours = told | {"LIST": str(captures / "list.txt"), "OUT": str(tmp_path), "SHARES": "2", "LP_NUM_THREADS": "1"}
    # The example has seed 1, and `expected` seed 7.
    command = [word.replace("--seed 1", "--seed 7") for word in container["command"]]
    assert command != container["command"]
    for index in ("1", "0"):
        run = subprocess.run(command, env={**found_program(), **ours, "JOB_COMPLETION_INDEX": index}, capture_output=True, text=True)
        assert run.returncode == 0, run.stderr
    assert manifest(tmp_path) == expected


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
    assert not list(tmp_path.glob(".drive*")), "what the killed run had begun is cleared up"


def test_a_killed_worker_takes_its_program_with_it(captures, tmp_path):
    """Else it would go on alone, on a machine that has been given to others."""
    script = f"from shutterbug import fleet; fleet.make(fleet.tasks_of([{str(captures / 'drive-0')!r}])[0], {str(tmp_path)!r})"
    worker = subprocess.Popen([sys.executable, "-c", script], start_new_session=True)
    program_ = wait_for(lambda: simulating(tmp_path))[0]
    os.kill(program_, signal.SIGSTOP)
    worker.kill()
    worker.wait()
    os.kill(program_, signal.SIGCONT)
    wait_for(lambda: not simulating(tmp_path))
    assert not (tmp_path / "rows/drive-0.json").exists()


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


def test_parquet_holds_the_same_pictures(captures, expected, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    task = fleet.tasks_of([captures / "drive-1"], seed=7)[0]
    rows = [fleet.make(task, tmp_path / which, "parquet") for which in "ab"]
    assert rows[0] == rows[1] and rows[0]["sha256"] == expected[1]["sha256"] and rows[0]["shard"] == "drive-1.parquet"
    shards = [(tmp_path / which / "drive-1.parquet").read_bytes() for which in "ab"]
    assert shards[0] == shards[1] and hashlib.sha256(shards[0]).hexdigest() == rows[0]["shard_sha256"]
    folder = tmp_path / "folder"
    fleet.make(task, folder)
    table = parquet.read_table(tmp_path / "a/drive-1.parquet").to_pylist()
    assert [(r["capture"], r["frame"]) for r in table] == [("drive-1", 0), ("drive-1", 1)]
    for row in table:
        assert row["image"]["bytes"] == (folder / row["image"]["path"]).read_bytes()
        assert row["first_line_start_ns"] <= row["middle_ns"] <= row["last_line_end_ns"]
        assert abs(sum(row[q] ** 2 for q in ("qx", "qy", "qz", "qw")) - 1) < 1e-9
    assert table[1]["first_line_start_ns"] - table[0]["first_line_start_ns"] == pytest.approx(1e9 / 30, abs=2)


def test_parquet_without_pyarrow_says_what_to_install(captures, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(errors.ArgumentError, match="pip install pyarrow"):
        fleet.make(fleet.tasks_of([captures / "drive-0"])[0], tmp_path, "parquet")
    assert not list(tmp_path.iterdir())


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
    """Two raylets on this machine, with more processors than it has: what is tested is not how quick it is."""
    ray = pytest.importorskip("ray", reason="ray is not installed")
    pytest.importorskip("ray.data", reason="ray[data] is not installed")
    from ray.cluster_utils import Cluster

    node = {"num_cpus": 8, "object_store_memory": 10**8}
    made = Cluster(initialize_head=True, head_node_args={**node, "include_dashboard": False})
    made.add_node(**node)
    ray.init(address=made.address, log_to_driver=False)
    ray.data.DataContext.get_current().enable_progress_bars = False
    yield made
    ray.shutdown()
    made.shutdown()


@pytest.fixture(scope="module")
def expected_of_all(captures, tmp_path_factory):
    out = tmp_path_factory.mktemp("all")
    tasks = fleet.tasks_of(folders(captures, MANY), seed=7)
    return {row["name"]: row["sha256"] for row in (fleet.make(task, out) for task in tasks)}


def wait_for(asked, limit_s=60.0):
    """What `asked` gives once that is something."""
    end = time.monotonic() + limit_s
    while not (found := asked()):
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.02)
    return found


def simulating(out):
    """Processes, started by workers, that simulate into this folder now."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_bytes()
            state = (process / "stat").read_text().rsplit(")", 1)[1].split()[0]
        except OSError:
            continue
        if b"\0simulate\0" in words and str(out).encode() in words and state not in "ZX":
            found.append(int(process.name))
    return found


def parent_of(pid):
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[1])
    except OSError:
        return 0


def actor_at_work(out, but=()):
    """The process of an actor that is in the middle of a capture, and that is none of `but`: a killed one takes a while to go."""
    for parent in set(map(parent_of, simulating(out))) - set(but):
        try:
            if Path(f"/proc/{parent}/cmdline").read_bytes().startswith(b"ray::"):
                return parent
        except OSError:
            continue
    return 0


def test_an_actor_that_is_killed_loses_nothing(cluster, captures, expected_of_all, tmp_path):
    killed = []

    def kill():
        for _ in range(2):
            killed.append(wait_for(lambda: actor_at_work(tmp_path, killed)))
            os.kill(killed[-1], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    rows = shutterbug_ray().simulate(folders(captures, MANY), tmp_path, actors=2, cpus=1, seed=7)
    killer.join()
    assert len(set(killed)) == 2 and {r["name"]: r["sha256"] for r in rows} == expected_of_all
    assert not list(tmp_path.glob(".drive*"))


BEGUN = """
import sys, ray, shutterbug.ray
ray.init(address=sys.argv[1], log_to_driver=False)
shutterbug.ray.simulate(sys.argv[4:], sys.argv[2], actors=2, cpus=1, seed=7, format=sys.argv[3])
"""


@pytest.mark.parametrize(("actors", "format"), [(1, "folder"), (3, "webdataset"), (7, "parquet")])
def test_any_number_of_actors_resumes_a_killed_run_to_the_same_bytes(cluster, captures, expected_of_all, tmp_path, actors, format):
    """Another program began it with two actors, and was killed with one of them in the middle of a capture."""
    given = [str(f) for f in folders(captures, MANY)]
    words = [sys.executable, "-c", BEGUN, cluster.address, str(tmp_path), format, *given]
    run = subprocess.Popen(words, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        wait_for(lambda: list((tmp_path / "rows").glob("drive-*.json")))
        os.kill(wait_for(lambda: actor_at_work(tmp_path)), signal.SIGKILL)
    finally:
        run.kill()
        run.wait()
    wait_for(lambda: not simulating(tmp_path))
    done = {p: p.stat().st_mtime_ns for p in (tmp_path / "rows").glob("drive-*.json")}
    assert 1 <= len(done) < MANY and not (tmp_path / "manifest.jsonl").exists()
    rows = shutterbug_ray().simulate(folders(captures, MANY), tmp_path, actors=actors, cpus=1, seed=7, format=format)
    assert {r["name"]: r["sha256"] for r in rows} == expected_of_all and rows == manifest(tmp_path)
    assert all(p.stat().st_mtime_ns == t for p, t in done.items()), "what was finished is kept"
    for row in rows:
        assert {"sha256", "camera_sha256", "device", "driver", "seed", "shard"} <= row.keys() and (tmp_path / row["shard"]).exists()


def test_what_ray_reads_back_has_every_frame(cluster, captures, tmp_path):
    pytest.importorskip("aiohttp", reason="aiohttp is not installed, which Ray's read_parquet asks for now and then")
    import ray

    rows = shutterbug_ray().simulate(folders(captures, 2), tmp_path, actors=1, cpus=1, seed=7, format="parquet")
    frames = ray.data.read_parquet([str(tmp_path / r["shard"]) for r in rows]).take_all()
    assert sorted((f["capture"], f["frame"]) for f in frames) == [(r["name"], i) for r in rows for i in range(2)]


def test_captures_are_diagnosed_by_actors(cluster, captures, tmp_path):
    needs.long("two diagnoses in Ray")
    frames = (DEMO / "frames.csv").read_text()
    for i, sigma in enumerate((0.02, 0.06)):
        capture = tmp_path / f"walk-{i}"
        shutil.copytree(DEMO, capture)
        plain = shutterbug.Camera.from_toml(DEMO / "camera.toml").with_pinhole(112, 84)
        plain.save(capture / "camera.toml")
        (capture / "frames.csv").write_text(frames)
        shutterbug.simulate(capture, tmp_path / "real", camera=plain.with_effects({"read_noise": {"sigma": sigma}}))
        shutil.move(tmp_path / "real", capture / "real")
    captures_ = [tmp_path / "walk-0", tmp_path / "walk-1"]
    found = shutterbug_ray().diagnose(captures_, tmp_path / "reports", actors=2, cpus=1, time_limit_s=120)
    for i, sigma in enumerate((0.02, 0.06)):
        effects = shutterbug.Diagnosis(found[f"walk-{i}"]).effects
        assert [e["value"] for e in effects if e["parameter"] == "sigma"] == [pytest.approx(sigma, rel=0.2)]
    stamp = (found["walk-0"] / "report.json").stat().st_mtime_ns
    again = shutterbug_ray().diagnose(captures_, tmp_path / "reports", actors=1, cpus=1)
    assert again == found and (found["walk-0"] / "report.json").stat().st_mtime_ns == stamp


def folders(captures, count=COUNT):
    return [captures / f"drive-{i}" for i in range(count)]


def shutterbug_ray():
    import shutterbug.ray

    return shutterbug.ray
