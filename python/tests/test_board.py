"""`shutterbug.board`: a camera that is known exactly, drawn here without any of our code, and photographs where they are present."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import shutterbug
from shutterbug import errors

COLUMNS, ROWS, SQUARE_M = 7, 4, 0.03
WIDTH, HEIGHT, F, K1 = 320, 240, 250.0, -0.25
CENTRE = (163.0, 118.5)
# Rays a pixel along each side.
FINE = 3
SHARED = Path(__file__).parents[3] / "shared/data"


def turned(angles):
    (a, b, c), one = angles, np.eye(3)
    x, y, z = one.copy(), one.copy(), one.copy()
    x[1:, 1:] = [[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]
    y[::2, ::2] = [[np.cos(b), np.sin(b)], [-np.sin(b), np.cos(b)]]
    z[:2, :2] = [[np.cos(c), -np.sin(c)], [np.sin(c), np.cos(c)]]
    return x @ y @ z


def looking(i):
    """Camera from board: rotation and translation, m. The board's inner corners lie about its origin."""
    angles = 0.5 * np.sin(1.7 * i), 0.5 * np.sin(2.3 * i + 1), 0.4 * np.sin(1.1 * i)
    return turned(angles), np.array([0.04 * np.cos(1.3 * i), 0.02 * np.sin(2.1 * i), 0.26 + 0.01 * i])


def rays():
    """Directions of FINE x FINE rays of each pixel behind a lens with K1, by fixed-point iteration."""
    v, u = (np.mgrid[0 : HEIGHT * FINE, 0 : WIDTH * FINE] + 0.5) / FINE
    seen = np.stack([(u - CENTRE[0]) / F, (v - CENTRE[1]) / F], axis=-1)
    ideal = seen.copy()
    for _ in range(60):
        ideal = seen / (1 + K1 * (ideal**2).sum(axis=-1, keepdims=True))
    return np.concatenate([ideal, np.ones_like(ideal[..., :1])], axis=-1)


def photograph(directions, rotation, translation):
    """Linear light of a board of (COLUMNS + 1) x (ROWS + 1) squares on a white sheet, before grey; 8 bits of sRGB."""
    normal = rotation[:, 2]
    points = directions * ((normal @ translation) / (directions @ normal))[..., None]
    x, y = ((points - translation) @ rotation)[..., :2].transpose(2, 0, 1) / SQUARE_M
    i, j = np.floor(x + (COLUMNS + 1) / 2), np.floor(y + (ROWS + 1) / 2)
    on_board = (i >= 0) & (i <= COLUMNS) & (j >= 0) & (j <= ROWS)
    on_sheet = (i >= -1) & (i <= COLUMNS + 1) & (j >= -1) & (j <= ROWS + 1)
    light = np.where(on_board & ((i + j) % 2 == 0), 0.05, np.where(on_sheet, 0.8, 0.3))
    mean = light.reshape(HEIGHT, FINE, WIDTH, FINE).mean(axis=(1, 3))
    encoded = np.where(mean <= 0.0031308, mean * 12.92, 1.055 * mean ** (1 / 2.4) - 0.055)
    return np.round(255 * encoded).astype(np.uint8)


def corners(rotation, translation):
    """Where the inner corners fall, (ROWS, COLUMNS, 2), px."""
    row, col = np.mgrid[0:ROWS, 0:COLUMNS]
    board = np.stack([col - (COLUMNS - 1) / 2, row - (ROWS - 1) / 2, np.zeros(row.shape)], axis=-1) * SQUARE_M
    seen = board @ rotation.T + translation
    ideal = seen[..., :2] / seen[..., 2:]
    return ideal * (1 + K1 * (ideal**2).sum(axis=-1, keepdims=True)) * F + CENTRE


@pytest.fixture(scope="module")
def photographs(tmp_path_factory):
    folder, directions = tmp_path_factory.mktemp("photographs"), rays()
    for i in range(9):
        Image.fromarray(photograph(directions, *looking(i))).save(folder / f"{i:02}.png")
    return folder


def test_the_camera_comes_back_from_photographs(photographs, tmp_path):
    found = shutterbug.board(photographs, tmp_path / "capture", size=(COLUMNS, ROWS), square_m=SQUARE_M)
    assert len(found.views) >= 8 and found.size == (WIDTH, HEIGHT)
    assert found.rms_px < 0.15 and found.pinhole_rms_px > 4 * found.rms_px, "control: a pinhole does not do"
    truth = {"fx": F, "fy": F, "cx": CENTRE[0], "cy": CENTRE[1], "k1": K1}
    for row in found.parameters:
        half = row["value"] - row["low"]
        if row["parameter"] in truth:
            assert abs(row["value"] - truth.pop(row["parameter"])) < 1.6 * half + 1e-3 and half < 2.0
    assert not truth
    assert found.matrix[0, 0] == pytest.approx(F, rel=0.01) and found.distortion[0] == pytest.approx(K1, abs=0.02)
    cam = found.camera
    assert (cam.width, cam.height, cam.readout_time_s) == (WIDTH, HEIGHT, 0)
    assert cam.effects["lens_distortion"]["k1"] == found.distortion[0]
    # The capture itself is a pinhole: `diagnose` is to find the lens.
    assert not shutterbug.Camera.from_toml(found.folder / "camera.toml").effects
    assert f"{found.rms_px:.3f}" in repr(found) and "<td>fx</td>" in found._repr_html_()
    # A diagnosis of it starts.
    assert (found.folder / "real").is_dir() and (found.folder / "scene.obj").exists()


def test_corners_of_another_tool_do(photographs, tmp_path):
    """As arrays, in both shapes, and with a corner that was not seen; exact corners give the exact camera."""
    files = [photographs / f"{i:02}.png" for i in range(9)]
    given = {file.name: corners(*looking(i)) for i, file in enumerate(files)}
    given["03.png"][1, 2] = np.nan
    flat = given["04.png"].reshape(-1, 2)
    row, col = np.divmod(np.arange(COLUMNS * ROWS), COLUMNS)
    given["04.png"] = np.column_stack([col, row, flat])
    found = shutterbug.board(files, tmp_path / "capture", corners=given, square_m=SQUARE_M)
    assert found.rms_px < 1e-3 and found.matrix[0, 0] == pytest.approx(F, abs=0.01)
    assert found.distortion[0] == pytest.approx(K1, abs=1e-3)
    assert {v["points"] for v in found.views} == {COLUMNS * ROWS, COLUMNS * ROWS - 1}
    again = shutterbug.board(files, tmp_path / "again", corners=found.folder / "corners.csv", square_m=SQUARE_M)
    assert again.matrix == pytest.approx(found.matrix, abs=1e-2)


def test_wrong_boards_are_refused_with_a_sentence(photographs, tmp_path):
    out = tmp_path / "capture"
    with pytest.raises(errors.ArgumentError, match=r"\(9, 6\)"):
        shutterbug.board(photographs, out, size=(7, 4, 2))
    with pytest.raises(errors.ArgumentError, match="frames"):
        shutterbug.board([], out)
    with pytest.raises(errors.ArgumentError, match="pattern"):
        shutterbug.board(photographs, out, size=(7, 4), pattern="circles")
    with pytest.raises(errors.ArgumentError, match="rows, columns, 2"):
        shutterbug.board(photographs, out, corners={"00.png": np.zeros((4, 3))})
    with pytest.raises(errors.ArgumentError, match="whole numbers"):
        shutterbug.board(photographs, out, corners={"00.png": np.full((1, 4), 0.5)})
    with pytest.raises(errors.ArgumentError, match="size"):
        shutterbug.board(photographs, out)
    with pytest.raises(errors.ProgramError):
        shutterbug.board(photographs, out, size=(9, 6))
    with pytest.raises(errors.ProgramError, match="nowhere"):
        shutterbug.board(tmp_path / "nowhere", out, size=(7, 4))


def test_photographs_that_opencv_has_calibrated(tmp_path):
    """docs/board.md: without k3 OpenCV gives fx 533.1, k1 -0.2900, 0.196 px."""
    folder = SHARED / "real/board_a"
    if not folder.is_dir():
        pytest.skip("no shared data: real/board_a")
    found = shutterbug.board(sorted(folder.glob("left*.jpg")), tmp_path / "capture", size=(9, 6))
    assert len(found.views) == 13 and found.rms_px < 0.22 and found.pinhole_rms_px > 1
    assert found.matrix[0, 0] == pytest.approx(533.1, rel=0.005) and found.distortion[0] == pytest.approx(-0.29, abs=0.01)
