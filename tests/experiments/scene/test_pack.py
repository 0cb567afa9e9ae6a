import shutil

import numpy as np
import pytest

from experiments.scene.pack import PACK_DIR, Pack, default_pack
from experiments.scene.settle import settled_height
from renderer.files import InputError

SEATS = [name for name in default_pack().names() if default_pack().seat(name) is not None]


@pytest.fixture
def copied(tmp_path):
    for path in PACK_DIR.glob("furniture*"):
        if path.suffix in (".json", ".npz", ".sha256"):
            shutil.copy(path, tmp_path / path.name)
    return tmp_path


def test_the_pack_is_at_most_twelve_mebibytes_and_each_file_under_four():
    sizes = [path.stat().st_size for path in PACK_DIR.glob("furniture*")]
    assert sum(sizes) <= 12 * 2**20 and max(sizes) < 4 * 2**20


def test_every_piece_stands_on_the_floor_in_its_middle_and_names_its_creator():
    for name in default_pack().names():
        piece = default_pack().piece(name)
        points = piece.points()
        middle = (points.min(0) + points.max(0)) / 2
        assert points[:, 2].min() == pytest.approx(0.0, abs=0.01), name
        assert abs(middle[:2]).max() < 0.03 + 0.1 * np.ptp(points[:, :2], axis=0).max(), name
        assert piece.creator and piece.title


def test_textures_are_small_and_come_with_coordinates():
    for name in default_pack().names():
        for part in default_pack().piece(name).parts:
            assert (part.texture is None) == (part.uv is None)
            assert part.texture is None or max(part.texture.shape[:2]) <= 256


@pytest.mark.parametrize("name", SEATS)
def test_the_recorded_seat_is_where_one_would_sit(name):
    piece = default_pack().piece(name)
    corners = np.concatenate([part.corners for part in piece.parts])
    width, depth, _ = np.ptp(piece.points(), axis=0)
    height = settled_height(corners, 0.0, -0.08 * float(depth), (float(width), float(depth)))
    assert height == pytest.approx(piece.seat, abs=0.02)
    assert 0.3 < height < 0.8


def test_every_file_of_the_pack_is_credited():
    credits = (PACK_DIR / "CREDITS.md").read_text(encoding="utf-8")
    for name in default_pack().names():
        assert f"| `{name}` |" in credits


@pytest.mark.parametrize("name", ["furniture.json", "furniture_0.npz"])
def test_an_altered_pack_is_refused_in_one_line(copied, name):
    content = bytearray((copied / name).read_bytes())
    content[len(content) // 2] ^= 1
    (copied / name).write_bytes(content)
    with pytest.raises(InputError, match=rf"{name}: sha256: .* the asset pack was altered"):
        Pack(copied)


def test_a_missing_file_of_the_pack_is_named(copied):
    (copied / "furniture_1.npz").unlink()
    with pytest.raises(InputError, match=r"furniture_1.npz: file: got 'missing'"):
        Pack(copied)


def test_an_unknown_piece_is_named():
    with pytest.raises(InputError, match="piece: got 'throne_1', wanted a piece of the pack"):
        default_pack().piece("throne_1")
