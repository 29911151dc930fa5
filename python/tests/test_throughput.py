"""tools/throughput: the simulation of many workers against what can be worked out by hand, and its measurement."""

import importlib.machinery
import importlib.util
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import needs

TOOL = Path(os.environ.get("SHUTTERBUG_SOURCES", Path(__file__).parents[2])) / "tools/throughput"
FAST_STORE = 1e15


@pytest.fixture(scope="module")
def tool():
    loader = importlib.machinery.SourceFileLoader("throughput", str(TOOL))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("throughput", loader))
    sys.modules["throughput"] = module
    loader.exec_module(module)
    return module


@pytest.fixture
def figures(tool):
    return tool.Figures("64x48", "exact", "none", 3.0, 1.0, 0.1, 0.1, 1e6, 1e6, 1e9, 0.0)


def test_one_worker_takes_the_sum_of_its_work(tool, figures):
    # The captures' own spread is averaged out: 400 of them, of 10 %.
    r = tool.model(figures, 1, 400, 20, FAST_STORE)
    assert r["wall_s"] == pytest.approx(3.0 + 399 * 1.0 + 400 * 20 * 0.1, rel=0.01)
    assert r["frames_s"] == pytest.approx(8000 / r["wall_s"]) and r["share"] == pytest.approx(800 / r["wall_s"])


def test_twice_the_workers_take_half_the_time_until_the_store_is_full(tool, figures):
    wide = [tool.model(figures, n, 4000, 20, FAST_STORE)["frames_s"] for n in (10, 20)]
    assert wide[1] == pytest.approx(2 * wide[0], rel=0.03)
    # 20 frames of 1 MB and 1 MB of inputs a capture, 50 MB/s: no number of workers delivers more than that.
    full = tool.model(figures, 1000, 4000, 20, 50e6)
    assert full["frames_s"] == pytest.approx(20 / (21e6 / 50e6), rel=0.05) and full["store"] > 0.95
    assert full["share"] < 0.1


def test_what_workers_do_to_each_other_counts(tool, figures):
    beside = replace(figures, frame_beside_s=0.2)
    alone, two = (tool.model(f, 2, 400, 20, FAST_STORE)["wall_s"] for f in (figures, beside))
    assert two == pytest.approx(alone + 200 * 20 * 0.1, rel=0.02)
    assert tool.model(beside, 1, 50, 20, FAST_STORE) == tool.model(figures, 1, 50, 20, FAST_STORE)


def test_a_first_start_is_dearer(tool, figures):
    """As many captures as workers: each one starts with empty caches."""
    cold = tool.model(figures, 8, 8, 1, FAST_STORE)["wall_s"]
    assert 3.05 < cold < 3.2


def test_it_measures_this_machine(device, tmp_path):
    needs.long("tools/throughput itself")
    words = [sys.executable, TOOL, "--size", "160x120", "--frames", "12", "--out", tmp_path / "figures.json", "--workers", "1,1000"]
    run = subprocess.run([*map(str, words)], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    found = json.loads((tmp_path / "figures.json").read_text())
    assert 0 < found["frame_s"] < found["start_s"] < found["start_cold_s"] and found["frame_bytes"] > 1000
    assert "| 1000 | 200 |" in run.stdout
