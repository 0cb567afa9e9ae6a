"""Encoding: bytes that repeat, colours that hold, failures of ffmpeg in one line."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from renderer import video
from renderer.files import InputError
from renderer.mosaic import tile
from renderer.video import probe, write_image, write_video

ROOT = Path(__file__).resolve().parents[2]
SIZE = (64, 48)


def clip(n: int = 40, seed: int = 0) -> list[np.ndarray]:
    """Smooth coloured frames that drift."""
    x, y = np.meshgrid(np.linspace(0, 3, SIZE[0]), np.linspace(0, 2, SIZE[1]))
    wave = [np.stack([np.sin(x + 0.1 * k + seed), np.cos(y), np.sin(x * y)], -1) for k in range(n)]
    return [(127 + 110 * frame).astype(np.uint8) for frame in wave]


def decode(path: Path) -> np.ndarray:
    command = [video.ffmpeg_path(), "-v", "error", "-i", str(path), "-f", "rawvideo",
               "-vf", "scale=in_color_matrix=bt709:flags=accurate_rnd+full_chroma_int",
               "-pix_fmt", "rgb24", "-"]  # fmt: skip
    raw = subprocess.run(command, capture_output=True, check=True).stdout
    return np.frombuffer(raw, np.uint8).reshape(-1, SIZE[1], SIZE[0], 3)


def test_equal_frames_give_equal_bytes(tmp_path):
    for name in ("a", "b"):
        write_video(clip(), tmp_path / f"{name}.mp4", SIZE, 30.0)
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def test_colours_survive_encoding(tmp_path):
    write_video(clip(), tmp_path / "a.mp4", SIZE, 30.0, crf=10)
    error = decode(tmp_path / "a.mp4").astype(float) - np.stack(clip()).astype(float)
    assert np.abs(error).mean() < 3.0
    assert np.abs(error.mean(axis=(0, 1, 2))).max() < 1.0


@pytest.mark.parametrize("fps", [24.0, 25.0, 30.0, 30000 / 1001])
def test_frame_rate_and_count_are_read_back(tmp_path, fps):
    made = write_video(clip(31), tmp_path / "a.mp4", SIZE, fps)
    found = probe(tmp_path / "a.mp4")
    assert (found.n_frames, made.n_frames) == (31, 31)
    assert found.fps == pytest.approx(fps) and found.duration_s == pytest.approx(31 / fps)


def test_a_key_frame_comes_every_second(tmp_path):
    write_video(clip(61), tmp_path / "a.mp4", SIZE, 30.0)
    command = [video.ffmpeg_path(), "-v", "error", "-skip_frame", "nokey", "-i",
               str(tmp_path / "a.mp4"), "-f", "framemd5", "-"]  # fmt: skip
    rows = subprocess.run(command, capture_output=True, check=True, text=True).stdout.splitlines()
    stamps = [int(row.split(",")[2]) for row in rows if not row.startswith("#")]
    assert stamps == [0, 30, 60]


def test_neither_encoder_nor_date_nor_thread_count_is_told(tmp_path):
    write_video(clip(), tmp_path / "a.mp4", SIZE, 30.0)
    content = (tmp_path / "a.mp4").read_bytes()
    assert probe(tmp_path / "a.mp4").tags == ()
    assert all(word not in content for word in (b"x264", b"threads=", b"Lavf5", b"Lavf6"))


def test_no_frames_and_wrong_suffixes_are_refused(tmp_path):
    with pytest.raises(InputError):
        write_video([], tmp_path / "a.mp4", SIZE, 30.0)
    with pytest.raises(InputError, match="suffix"):
        write_image(tmp_path / "a.gif", clip(1)[0])
    assert list(tmp_path.iterdir()) == []


def test_ffmpeg_killed_in_mid_clip_leaves_nothing(tmp_path, monkeypatch):
    started: list[subprocess.Popen] = []
    start = video._start
    monkeypatch.setattr(video, "_start", lambda *a: started.append(start(*a)) or started[-1])

    def frames():
        for k, frame in enumerate(clip(400)):
            if k == 20:
                os.kill(started[0].pid, signal.SIGKILL)
            yield frame

    with pytest.raises(InputError, match="ffmpeg: got 'killed by signal 9'"):
        write_video(frames(), tmp_path / "a.mp4", SIZE, 30.0)
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_one_clear_line(tmp_path, monkeypatch):
    command = video._encode_command

    def to_full_device(target, *rest):
        return [*command(target, *rest)[:-1], "/dev/full"]

    monkeypatch.setattr(video, "_encode_command", to_full_device)
    with pytest.raises(InputError, match="ffmpeg: got 'exit") as caught:
        write_video(clip(400, 1), tmp_path / "a.mp4", SIZE, 30.0)
    assert "\n" not in str(caught.value) and "No space left" in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_ffmpeg_is_one_clear_line(tmp_path):
    program = (
        "import numpy as np; from pathlib import Path; from renderer.files import InputError\n"
        "from renderer.video import write_video\n"
        "try: write_video([np.zeros((48, 64, 3), np.uint8)], Path('a.mp4'), (64, 48), 30.0)\n"
        "except InputError as error: print(error)\n"
    )
    environment = {**os.environ, "IMAGEIO_FFMPEG_EXE": "/nowhere/ffmpeg", "PYTHONPATH": str(ROOT)}
    result = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=environment, text=True,
        capture_output=True,
    )  # fmt: skip
    assert result.stdout.startswith("renderer: ffmpeg: got '/nowhere/ffmpeg")
    assert result.stdout.count("\n") == 1 and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", [b"", b"not a video", b"\0" * 4096])
def test_a_file_that_does_not_decode_is_named(tmp_path, content):
    path = tmp_path / "a.mp4"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"a\.mp4: content"):
        probe(path)
    with pytest.raises(InputError, match=r"b\.mp4: file: got 'missing'"):
        probe(tmp_path / "b.mp4")


def test_a_truncated_video_does_not_pass_the_probe(tmp_path):
    write_video(clip(), tmp_path / "a.mp4", SIZE, 30.0)
    content = (tmp_path / "a.mp4").read_bytes()
    (tmp_path / "a.mp4").write_bytes(content[: len(content) * 2 // 3])
    with pytest.raises(InputError, match="content"):
        probe(tmp_path / "a.mp4")


def test_tiles_lie_in_reading_order_and_only_the_seam_covers_them():
    views = [np.full((8, 16, 3), shade, np.uint8) for shade in (10, 20, 30, 40)]
    grid, strip = tile(views, "grid"), tile(views, "strip")
    assert [int(grid[y, x, 0]) for y in (3, 12) for x in (3, 20)] == [10, 20, 30, 40]
    assert [int(strip[3, x, 0]) for x in (3, 20, 36, 52)] == [10, 20, 30, 40]
    assert (grid[7:9] == 255).all() and (grid[:, 15:17] == 255).all()
    assert int((grid == 255).all(axis=-1).sum()) == 2 * 32 + 2 * 16 - 4
    assert tile(views[:1], "single") is views[0]


def test_a_png_holds_the_very_pixels(tmp_path):
    write_image(tmp_path / "a.png", clip(1)[0])
    assert (np.asarray(Image.open(tmp_path / "a.png")) == clip(1)[0]).all()
