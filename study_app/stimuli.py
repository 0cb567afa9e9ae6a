"""From a catalogue to the pairs of a study; refuses what would fail in front of a participant."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from renderer.catalogue import FILE_NAME, Catalogue, Clip, read_catalogue, verify_catalogue
from renderer.files import InputError, file_sha256
from study_app import design
from study_app.config import StudyConfig

LIFTED = "lifted"
"""Method name of the faulty clip in catch and practice pairs: the sound body, 0.6 m up."""


@dataclass(frozen=True)
class PairPlan:
    """A pair before it is stored. `cell` is an index for main pairs, `expected` the sound method."""

    kind: design.Kind
    target: Clip
    baseline: Clip
    cell: int | None = None
    expected: str | None = None


@dataclass(frozen=True)
class StudyPlan:
    """All that a study version consists of, checked against each other."""

    config: StudyConfig
    folder: Path
    catalogue_sha256: str
    cells: tuple[design.Cell, ...]
    pairs: tuple[PairPlan, ...]

    @property
    def methods(self) -> tuple[str, ...]:
        """The methods under comparison, target first."""
        return (self.config.target, *self.config.baselines)


def plan_study(config: StudyConfig, folder: Path, source: object) -> StudyPlan:
    """Check a study file against a catalogue and list cells and pairs.

    Raises `InputError`: unknown methods or scenes, clips missing or altered, too few motions.
    """
    folder = folder.resolve()
    catalogue = read_catalogue(folder)
    _check_names(config, catalogue, source)
    faults = verify_catalogue(folder)
    if faults:
        file, clip, fault = faults[0].split(": ", 2)
        others = f" ({len(faults)} clips are at fault)" if len(faults) > 1 else ""
        raise InputError(file, clip, fault, "the file as it was rendered" + others)
    scenes = config.scenes or tuple(
        sorted({clip.scene for clip in _study_clips(config, catalogue)})
    )
    cells = tuple(design.study_cells(scenes, config.target, config.baselines, config.pairs))
    main = _main_pairs(config, catalogue, scenes, cells, folder / FILE_NAME)
    _check_motions(config, main, cells, source)
    _check_length(config, cells, source)
    pairs = [*main, *_other_pairs(config, catalogue, main, folder / FILE_NAME, source)]
    return StudyPlan(config, folder, file_sha256(folder / FILE_NAME), cells, tuple(pairs))


def shortages(plan: StudyPlan) -> list[str]:
    """One line for each kind of extra trials that must show a pair again within one session."""
    lines = []
    for kind in ("catch", "practice", "identical"):
        asked = getattr(plan.config.extra_trials, kind)
        pairs = sum(pair.kind == kind for pair in plan.pairs)
        if asked > pairs:
            lines.append(
                f"{asked} {kind} trials a person from {pairs} {kind} pairs: some are shown again"
            )
    return lines


def _check_names(config: StudyConfig, catalogue: Catalogue, source: object) -> None:
    methods = sorted({clip.method for clip in catalogue.main_clips()})
    scenes = sorted({clip.scene for clip in catalogue.main_clips()})
    for field, name in [("target", config.target), *(("baselines", b) for b in config.baselines)]:
        if name not in methods:
            raise InputError(source, field, name, f"a method with clips: {', '.join(methods)}")
    for scene in config.scenes:
        if scene not in scenes:
            raise InputError(source, "scenes", scene, f"a scene with clips: {', '.join(scenes)}")


def _study_clips(config: StudyConfig, catalogue: Catalogue) -> list[Clip]:
    methods = {config.target, *config.baselines}
    return [clip for clip in catalogue.main_clips() if clip.method in methods]


def _main_pairs(
    config: StudyConfig,
    catalogue: Catalogue,
    scenes: Iterable[str],
    cells: tuple[design.Cell, ...],
    source: Path,
) -> list[PairPlan]:
    """One pair for every cell and motion; a (scene, motion) that lacks a method is refused."""
    by_place: dict[tuple[str, str], dict[str, Clip]] = defaultdict(dict)
    for clip in _study_clips(config, catalogue):
        if clip.method in by_place[clip.scene, clip.motion]:
            place = f"{clip.scene}, {clip.motion}, {clip.method}"
            raise InputError(source, "clips", place, "one main clip a scene, motion and method")
        by_place[clip.scene, clip.motion][clip.method] = clip
    pairs: list[PairPlan] = []
    wanted = set(scenes)
    for (scene, motion), clips in sorted(by_place.items()):
        if scene not in wanted:
            continue
        for method in (config.target, *config.baselines):
            if method not in clips:
                place = f"scene {scene}, motion {motion}"
                raise InputError(source, "clips", place, f"a clip of method {method} too")
        for index, cell in enumerate(cells):
            if cell.scene == scene:
                pairs.append(PairPlan("main", clips[cell.target], clips[cell.baseline], index))
    return pairs


def _check_motions(
    config: StudyConfig, main: list[PairPlan], cells: tuple[design.Cell, ...], source: object
) -> None:
    """Nobody may meet a (scene, motion) twice unless the study says so: enough motions a scene?"""
    if config.repeat_scene_motion:
        return
    n_pairs = len({(cell.target, cell.baseline) for cell in cells})
    needed = design.motions_needed(n_pairs, config.trials_per_cell)
    motions: dict[str, set[str]] = defaultdict(set)
    for pair in main:
        motions[pair.target.scene].add(pair.target.motion)
    for scene in sorted(motions):
        if len(motions[scene]) < needed:
            wanted = (
                f"a study that needs at most the {len(motions[scene])} motions of scene {scene}; "
                f"this one needs {needed} (or set repeat_scene_motion = true)"
            )
            raise InputError(source, "trials_per_cell", config.trials_per_cell, wanted)


def _check_length(config: StudyConfig, cells: tuple[design.Cell, ...], source: object) -> None:
    extra = config.extra_trials
    extras = design.Extras(extra.catch, extra.identical, extra.repeat, extra.practice)
    length = len(cells) * config.trials_per_cell + extra.catch + extra.identical
    if extra.repeat and length < design.shortest_session(extras):
        wanted = (
            f"fewer repeats: they come {design.REPEAT_DISTANCE} trials later, "
            f"and a session has only {length} other trials"
        )
        raise InputError(source, "extra_trials.repeat", extra.repeat, wanted)


def _other_pairs(
    config: StudyConfig,
    catalogue: Catalogue,
    main: list[PairPlan],
    catalogue_path: Path,
    source: object,
) -> list[PairPlan]:
    """Catch and practice pairs of the catalogue; identical pairs from the target's main clips."""
    pairs: list[PairPlan] = []
    for kind, count in (
        ("catch", config.extra_trials.catch),
        ("practice", config.extra_trials.practice),
    ):
        found = _sound_and_lifted(catalogue, kind, catalogue_path) if count else []
        if count and not found:
            raise InputError(
                source, f"extra_trials.{kind}", count, f"0, as the catalogue has no {kind} clips"
            )
        pairs += found
    if config.extra_trials.identical:
        targets = {pair.target.clip_id: pair.target for pair in main}
        pairs += [PairPlan("identical", clip, clip) for _, clip in sorted(targets.items())]
    return pairs


def _sound_and_lifted(catalogue: Catalogue, role: str, source: Path) -> list[PairPlan]:
    by_place: dict[tuple[str, str], list[Clip]] = defaultdict(list)
    for clip in catalogue.clips:
        if clip.role == role:
            by_place[clip.scene, clip.motion].append(clip)
    pairs: list[PairPlan] = []
    for (scene, motion), clips in sorted(by_place.items()):
        lifted = [clip for clip in clips if clip.method == LIFTED]
        sound = [clip for clip in clips if clip.method != LIFTED]
        if len(lifted) != 1 or len(sound) != 1:
            methods = ", ".join(sorted(clip.method for clip in clips))
            place = f"{role}: {scene}, {motion}: {methods}"
            raise InputError(source, "clips", place, f"one sound clip and one {LIFTED!r}")
        kind: design.Kind = "catch" if role == "catch" else "practice"
        pairs.append(PairPlan(kind, sound[0], lifted[0], expected=sound[0].method))
    return pairs
