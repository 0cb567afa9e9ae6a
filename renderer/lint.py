"""Fairness lint: two clips that are compared may differ in the body's motion and in nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from renderer.catalogue import Catalogue, Clip
from renderer.files import InputError
from renderer.video import CODEC, ProbedVideo, probe

_ALIKE = ("width", "height", "fps", "n_frames", "duration_s", "codec", "tiling", "views")
SIZE_RATIO = 1.5
"""File sizes further apart than this are worth a warning (motion alone explains less)."""


def fairness_faults(catalogue: Catalogue, folder: Path) -> list[str]:
    """One line per fault over all pairs of clips of the same role, scene and motion; empty if fair.

    Checked: same size, frame rate, frames, duration, codec, tiling and views; one camera rig a
    pair; every file decodes and is what the catalogue says; different methods do not show the
    same frames; neither file name nor metadata tells the method.
    """
    faults = [fault for pair in _groups(catalogue) for fault in _unlike(pair)]
    faults += _camera_faults(catalogue)
    methods = {str(method.get("name", "")) for method in catalogue.methods}
    methods |= {clip.method for clip in catalogue.clips}
    for clip in catalogue.clips:
        faults += _file_faults(clip, folder, methods - {""})
    return faults


def fairness_warnings(catalogue: Catalogue, folder: Path) -> list[str]:
    """One line per pair whose file sizes differ by more than half: worth a look, not a fault."""
    lines = []
    for pair in _groups(catalogue):
        sizes = {clip.clip_id: (folder / clip.file).stat().st_size for clip in pair}
        if max(sizes.values()) > SIZE_RATIO * min(sizes.values()):
            shown = ", ".join(f"{clip_id} {size}" for clip_id, size in sorted(sizes.items()))
            lines.append(f"{_name(pair[0])}: file sizes in bytes differ: {shown}")
    return lines


def _groups(catalogue: Catalogue) -> Iterator[list[Clip]]:
    """Clips that may meet in one trial."""
    groups: dict[tuple[str, str, str], list[Clip]] = {}
    for clip in sorted(catalogue.clips, key=lambda clip: clip.clip_id):
        groups.setdefault((clip.role, clip.scene, clip.motion), []).append(clip)
    yield from (clips for clips in groups.values() if len(clips) > 1)


def _unlike(clips: Sequence[Clip]) -> Iterator[str]:
    first = clips[0]
    for other in clips[1:]:
        for name in _ALIKE:
            ours, theirs = getattr(first, name), getattr(other, name)
            if ours != theirs:
                yield (
                    f"{_name(first)}: {name}: clip {first.clip_id} has {ours!r}, "
                    f"clip {other.clip_id} has {theirs!r}"
                )
    seen: dict[str, Clip] = {}
    for clip in clips:
        twin = seen.setdefault(clip.frames_sha256, clip)
        if twin is not clip:
            yield f"{_name(clip)}: clips {twin.clip_id} and {clip.clip_id} show the same frames"


def _camera_faults(catalogue: Catalogue) -> Iterator[str]:
    rigs: dict[tuple[str, str, str], int] = {}
    for rig in catalogue.cameras:
        key = (str(rig.get("role", "main")), str(rig.get("scene")), str(rig.get("motion")))
        rigs[key] = rigs.get(key, 0) + 1
    for pair in _groups(catalogue):
        key = (pair[0].role, pair[0].scene, pair[0].motion)
        if rigs.get(key, 0) != 1:
            yield f"{_name(pair[0])}: cameras: {rigs.get(key, 0)} rigs, wanted one for the pair"


def _file_faults(clip: Clip, folder: Path, methods: set[str]) -> Iterator[str]:
    path = folder / clip.file
    try:
        found = probe(path)
    except InputError as error:
        yield f"clip {clip.clip_id}: {error}"
        return
    yield from (f"{path}: clip {clip.clip_id}: {line}" for line in _mismatches(clip, found))
    told = [m for m in sorted(methods) if any(m in tag for tag in (*found.tags, path.name))]
    for method in told:
        yield f"{path}: clip {clip.clip_id}: name or metadata tells the method {method!r}"


def _mismatches(clip: Clip, found: ProbedVideo) -> Iterator[str]:
    for name in ("width", "height", "n_frames", "codec"):
        if getattr(clip, name) != getattr(found, name):
            yield f"{name}: file has {getattr(found, name)!r}, catalogue {getattr(clip, name)!r}"
    if abs(clip.fps - found.fps) > 1e-3:
        yield f"fps: file has {found.fps:.4f}, catalogue {clip.fps!r}"
    if abs(clip.duration_s - found.duration_s) > 1e-3:
        yield f"duration_s: file has {found.duration_s:.4f}, catalogue {clip.duration_s!r}"
    if clip.codec == CODEC and found.pixel_format != "yuv420p":
        yield f"pixel format: file has {found.pixel_format}, wanted yuv420p"


def _name(clip: Clip) -> str:
    return f"{clip.role} clips of {clip.scene} | {clip.motion}"
