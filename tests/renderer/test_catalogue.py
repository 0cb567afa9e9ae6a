"""The catalogue: what is written comes back, and every fault is named."""

from __future__ import annotations

import dataclasses
import json

import pytest

from renderer.catalogue import Catalogue, Clip, read_catalogue, verify_catalogue, write_catalogue
from renderer.files import InputError, file_sha256


def clip(clip_id: str = "a1", **changes) -> Clip:
    values = {
        "clip_id": clip_id, "file": f"clips/{clip_id}.mp4", "sha256": "0" * 64,
        "frames_sha256": "1" * 64, "poster": f"clips/{clip_id}.jpg", "role": "main",
        "method": "pace", "scene": "bedroom", "motion": "walk", "views": ("view-1", "view-2"),
        "tiling": "grid", "fps": 30.0, "n_frames": 120, "duration_s": 4.0, "width": 960,
        "height": 540, "codec": "h264", "scores": {"contact": 0.5}, "placement": "p.json",
    }  # fmt: skip
    return Clip(**{**values, **changes})


def catalogue(*clips: Clip) -> Catalogue:
    return Catalogue(
        "set", "2026-01-01", {"seed": 1}, ({"name": "bedroom"},), ({"id": "walk"},),
        ({"name": "pace"},), ({"score": 0.9},), clips, ({"reason": "none"},),
    )  # fmt: skip


def test_a_catalogue_comes_back_as_it_was_with_its_clips_sorted(tmp_path):
    first, second = clip("a1"), clip("b2", role="catch")
    write_catalogue(catalogue(second, first), tmp_path)
    for path in (tmp_path, tmp_path / "catalogue.json"):
        assert read_catalogue(path) == catalogue(first, second)


def test_main_clips_leave_out_catch_and_practice():
    clips = [clip("a1"), clip("b2", role="catch"), clip("c3", role="practice")]
    assert catalogue(*clips).main_clips() == (clips[0],)


def altered(tmp_path, change) -> None:
    write_catalogue(catalogue(clip("a1"), clip("b2")), tmp_path)
    record = json.loads((tmp_path / "catalogue.json").read_text())
    change(record)
    (tmp_path / "catalogue.json").write_text(json.dumps(record))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r.update(schema_version=2), "schema_version: got 2"),
        (lambda r: r.pop("schema_version"), "schema_version: got None"),
        (lambda r: r.pop("methods"), "methods: got 'nothing'"),
        (lambda r: r.update(clips={}), "clips: got {}"),
        (lambda r: r["clips"][1].pop("fps"), r"clips\[1\]\.fps: got 'nothing'"),
        (lambda r: r["clips"][0].update(fps="30"), r"clips\[0\]\.fps: got '30'"),
        (lambda r: r["clips"][0].update(n_frames=True), r"clips\[0\]\.n_frames: got True"),
        (lambda r: r["clips"][0].update(role="extra"), r"clips\[0\]\.role: got 'extra'"),
        (lambda r: r["clips"][0].update(colour=1), r"clips\[0\]\.colour: got 1"),
        (lambda r: r["clips"][0].update(file="../a.mp4"), r"clips\[0\]\.file"),
        (lambda r: r["clips"][0].update(poster="/a.jpg"), r"clips\[0\]\.poster"),
        (lambda r: r["clips"][0].update(clip_id="b2"), "clip_id: got 'b2'"),
    ],
)
def test_what_is_wrong_in_a_catalogue_is_named(tmp_path, change, message):
    altered(tmp_path, change)
    with pytest.raises(InputError, match=message):
        read_catalogue(tmp_path)


def test_a_missing_altered_or_posterless_clip_is_one_fault_each(tmp_path):
    (tmp_path / "clips").mkdir()
    for name in ("a1.mp4", "b2.mp4", "a1.jpg", "b2.jpg"):
        (tmp_path / "clips" / name).write_bytes(name.encode())
    clips = [
        dataclasses.replace(clip(c), sha256=file_sha256(tmp_path / f"clips/{c}.mp4"))
        for c in ("a1", "b2")
    ]
    write_catalogue(catalogue(*clips), tmp_path)
    assert verify_catalogue(tmp_path) == []
    (tmp_path / "clips/a1.mp4").write_bytes(b"other")
    (tmp_path / "clips/b2.mp4").unlink()
    (tmp_path / "clips/b2.jpg").unlink()
    faults = verify_catalogue(tmp_path / "catalogue.json")
    assert [fault.split(": ", 1)[1] for fault in faults] == [
        "clip a1: content differs from its sha256", "clip b2: file is missing",
        "clip b2: poster is missing",
    ]  # fmt: skip
