"""The training data of motion synthesis: windows of clips, placed without collision in rooms."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float16, Float32, Integer

from experiments.body.embedded import BODY_FILE, BODY_NAMES
from experiments.cache import cache_path
from experiments.motion.figure import figure_of
from experiments.synthesis.room_search import RoomSearch
from experiments.synthesis.training_clips import (
    COMPOSED_CAPTURE_S,
    ClipMotion,
    Kind,
    Support,
    TrainingClip,
    captured_clips,
    made_clips,
    motion_files,
    recorded_clip,
)
from experiments.synthesis.training_rooms import (
    RoomRecord,
    Split,
    room_records,
    training_scene,
)
from experiments.synthesis.windows import (
    LENGTH,
    MIN_WAY_M,
    Window,
    cut_windows,
    markers,
    pose_window,
)
from renderer.files import InputError, atomic_path, file_sha256, value_sha256

RECIPE = "synthesis-data-1"
"""Named in the cache key: change it whenever the same input gives other windows."""
SUPPORTS: tuple[Support, ...] = ("none", "seat", "hands")


@dataclass(frozen=True)
class DataSettings:
    """How much of what the data hold."""

    seed: int = 0
    train_rooms: int = 14
    held_out_rooms: int = 4
    walks: int = 50
    seats: int = 40
    beds: int = 20
    touches: int = 40
    idles: int = 10
    captured_stride: int = 8
    """Frames between the starts of two windows of a recording, on each of the four bodies."""
    made_stride: int = 18
    placements: int = 3
    """Rooms that each window is placed in; twice as many are tried."""
    motions: Path | None = None
    """Folder with recordings; CMU's under `PACE_SHARED` if None."""


@dataclass(frozen=True)
class ClipNote:
    """What became of one clip."""

    name: str
    kind: Kind
    split: Split
    seconds: float
    """Length of what windows were cut from, before augmentation."""
    windows: int


@dataclass(frozen=True)
class PlacedWindows:
    """M windows and their N placements. Room frame: z up, metres, origin at the floor's corner."""

    pose: Float16[np.ndarray, "M 62 22 3"]
    transl: Float32[np.ndarray, "M 62 3"]
    clip: Integer[np.ndarray, " M"]
    body: Integer[np.ndarray, " M"]
    """Index into `BODY_NAMES`."""
    support: Integer[np.ndarray, " M"]
    """Index into `SUPPORTS`."""
    frame: Integer[np.ndarray, " M"]
    """The still frame that is carried or touches; -1 for none."""
    window: Integer[np.ndarray, " N"]
    room: Integer[np.ndarray, " N"]
    yaw: Float32[np.ndarray, " N"]
    """Turn about the vertical axis through the pelvis of the first frame, radians."""
    shift: Float32[np.ndarray, "N 2"]
    clips: tuple[ClipNote, ...]
    rooms: tuple[RoomRecord, ...]
    unread: tuple[str, ...]
    """Files that could not be read as motions, each with its reason."""

    def placed(self, split: Split) -> Integer[np.ndarray, " K"]:
        """Placements of clips of that split; their rooms are of the same split."""
        held = np.array([note.split == split for note in self.clips])
        return np.flatnonzero(held[self.clip[self.window]])

    def moving(self, placements: Integer[np.ndarray, " K"]) -> Integer[np.ndarray, " L"]:
        """Those of them whose root ends `MIN_WAY_M` or more from where it began."""
        way = np.linalg.norm(self.transl[:, -1] - self.transl[:, 0], axis=1)
        return np.asarray(placements[way[self.window[placements]] >= MIN_WAY_M])

    def capture_minutes(self, split: Split = "train") -> float:
        """Minutes of real recording that windows of the split were cut from, not augmented."""
        whole = [n.seconds for n in self.clips if n.kind == "captured" and n.split == split]
        return (sum(whole) + (COMPOSED_CAPTURE_S if split == "train" else 0.0)) / 60.0

    def shares(self) -> dict[Kind, float]:
        """Share of each kind of clip in the windows for training."""
        kinds: tuple[Kind, ...] = ("captured", "composed", "authored")
        counts = {
            kind: sum(n.windows for n in self.clips if n.kind == kind and n.split == "train")
            for kind in kinds
        }
        return {kind: count / max(1, sum(counts.values())) for kind, count in counts.items()}


def training_windows(
    settings: DataSettings, on_step: Callable[[float], None] = lambda share: None
) -> PlacedWindows:
    """The data of these settings: from the cache, or built in some minutes of CPU time."""
    files = motion_files(settings.motions)
    path = cache_path("synthesis", _key(settings, files), ".npz")
    if not path.is_file():
        write_windows(build_windows(settings, files, on_step), path)
    return read_windows(path)


def build_windows(
    settings: DataSettings, files: Sequence[Path], on_step: Callable[[float], None]
) -> PlacedWindows:
    """Read or make every clip on its bodies, cut windows and place them. All randomness is seeded."""
    records = room_records(settings.train_rooms, settings.held_out_rooms, settings.seed)
    searches = []
    for index, record in enumerate(records):
        searches.append(RoomSearch(training_scene(record.name)))
        on_step(0.2 * (index + 1) / len(records))
    seconds = [_usable_seconds(path) for path in files]
    captured = captured_clips(files, seconds, settings.seed)
    clips = (*captured, *made_clips(_counts(settings), settings.seed))
    table = _Table(records, searches)
    for index, clip in enumerate(clips):
        table.add(index, clip, settings)
        on_step(0.2 + 0.8 * (index + 1) / len(clips))
    return table.finished()


def write_windows(data: PlacedWindows, target: Path) -> None:
    """Write the data as `.npz`, whole or not at all."""
    fields = {f.name: getattr(data, f.name) for f in dataclasses.fields(data)}
    notes = {
        "clips": [dataclasses.asdict(note) for note in fields.pop("clips")],
        "rooms": [dataclasses.asdict(record) for record in fields.pop("rooms")],
        "unread": list(fields.pop("unread")),
    }
    with atomic_path(target) as temporary:
        np.savez(temporary, notes=json.dumps(notes), **fields)


def read_windows(source: Path) -> PlacedWindows:
    """Read what `write_windows` wrote."""
    with np.load(source, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files if name != "notes"}
        notes = json.loads(str(archive["notes"]))
    return PlacedWindows(
        **arrays,
        clips=tuple(ClipNote(**note) for note in notes["clips"]),
        rooms=tuple(RoomRecord(**record) for record in notes["rooms"]),
        unread=tuple(notes["unread"]),
    )


class _Table:
    """Collects windows and placements clip by clip."""

    def __init__(self, records: Sequence[RoomRecord], searches: Sequence[RoomSearch]) -> None:
        self.records, self.searches = tuple(records), searches
        self.rows: list[tuple[Window, int, int, int, int]] = []
        self.placements: list[tuple[int, int, float, Float[np.ndarray, "2"]]] = []
        self.notes: list[ClipNote] = []
        self.unread: list[str] = []

    def add(self, index: int, clip: TrainingClip, settings: DataSettings) -> None:
        """Build one clip on its bodies and place its windows; a file that is no motion is noted."""
        rng = np.random.default_rng([settings.seed, 3, index])
        captured = clip.kind == "captured"
        stride = settings.captured_stride if captured else settings.made_stride
        bodies = range(4) if captured else sorted(rng.choice(4, 2, replace=False).tolist())
        before, seconds = len(self.rows), 0.0
        for body in bodies:
            try:
                built = clip.build(figure_of(BODY_NAMES[body]))
            except InputError as error:
                self.unread.append(f"{clip.name}: {error}")
                break
            offset = round(stride * body / 4)
            starts = self._cut(clip, len(self.notes), built, body, stride, offset, rng, settings)
            seconds = max(seconds, _covered(starts, built))
        count = len(self.rows) - before
        self.notes.append(ClipNote(clip.name, clip.kind, clip.split, seconds, count))

    def _cut(
        self,
        clip: TrainingClip,
        clip_index: int,
        built: ClipMotion,
        body: int,
        stride: int,
        offset: int,
        rng: np.random.Generator,
        settings: DataSettings,
    ) -> list[float]:
        figure = figure_of(BODY_NAMES[body])
        marked, starts = markers(figure.body), []
        for window in cut_windows(built, stride, offset, rng):
            posed = pose_window(window, clip.support, figure, marked)
            if window.way < MIN_WAY_M and posed.support == "none" and clip.name[:4] != "idle":
                continue
            rooms = [k for k, room in enumerate(self.records) if room.split == clip.split]
            found = 0
            for room in rng.permutation(rooms)[: 2 * settings.placements].tolist():
                if found == settings.placements:
                    break
                spot = self.searches[room].place(posed, rng)
                if spot is not None:
                    self.placements.append((len(self.rows), room, spot.yaw, spot.shift))
                    found += 1
            if found:
                support = SUPPORTS.index(posed.support)
                self.rows.append((window, clip_index, body, support, posed.frame))
                starts.append(window.start_s)
        return starts

    def finished(self) -> PlacedWindows:
        """Everything as arrays."""
        if not self.rows:
            raise InputError("training data", "windows", 0, "recordings or authored clips")
        window, room, yaw, shift = zip(*self.placements, strict=True)
        return PlacedWindows(
            pose=np.stack([row[0].pose for row in self.rows]).astype(np.float16),
            transl=np.stack([row[0].transl for row in self.rows]).astype(np.float32),
            clip=np.array([row[1] for row in self.rows]),
            body=np.array([row[2] for row in self.rows]),
            support=np.array([row[3] for row in self.rows]),
            frame=np.array([row[4] for row in self.rows]),
            window=np.array(window),
            room=np.array(room),
            yaw=np.array(yaw, dtype=np.float32),
            shift=np.stack(shift).astype(np.float32),
            clips=tuple(self.notes),
            rooms=self.records,
            unread=tuple(self.unread),
        )


def _covered(starts: Sequence[float], built: ClipMotion) -> float:
    """Seconds of the clip that lie in one of the windows, taken as two seconds long."""
    times = built.motion.times
    inside = np.zeros(len(times), dtype=bool)
    for start in starts:
        inside |= (times >= start - 1e-6) & (times < start + LENGTH / 30.0)
    return float(inside.sum()) / built.motion.fps


def _usable_seconds(path: Path) -> float:
    """Seconds of a recording that lie in windows of enough way; 0 where the file is no motion."""
    try:
        built = recorded_clip(path, figure_of(BODY_NAMES[0]))
    except InputError:
        return 0.0
    windows = cut_windows(built, 6, 0, np.random.default_rng(0))
    return _covered([w.start_s for w in windows if w.way >= MIN_WAY_M], built)


def _counts(settings: DataSettings) -> dict[str, int]:
    return {
        "walk": settings.walks,
        "seat": settings.seats,
        "bed": settings.beds,
        "touch": settings.touches,
        "idle": settings.idles,
    }


def _key(settings: DataSettings, files: Sequence[Path]) -> str:
    values = {k: v for k, v in dataclasses.asdict(settings).items() if k != "motions"}
    read = [(path.name, file_sha256(path)) for path in files]
    return value_sha256([RECIPE, values, read, file_sha256(BODY_FILE)])[:32]
