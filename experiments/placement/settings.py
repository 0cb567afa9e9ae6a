"""PlacementSettings: every number of a placement, with the presets fast, default, paper and posa."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Literal

from renderer.files import value_sha256


@dataclass(frozen=True)
class PlacementSettings:
    """What all methods share, so that they differ in the method alone.

    Sources: POSA (Hassan et al. 2021), its published code, PACE (Mullen and Manocha 2023). Values
    that none of them gives are ours; `docs/reference/placement.md` says which and why.
    """

    preset: str = "default"
    """Name of the preset these settings began as."""

    # Interaction features
    interaction: str = "learned"
    """Which model predicts contact and classes: a name in `INTERACTIONS`."""
    feature_choice: Literal["search", "posa"] = "search"
    """How one of several feature maps is chosen: `posa` takes the first whose most common class
    exists in the scene, `search` (ours) the one with the best start."""
    contact_threshold: float = 0.5
    """A vertex is in contact where f_c exceeds this (POSA)."""

    # Frame weights
    weighting: Literal["paak", "geometric", "uniform"] = "paak"
    """Rule of the weights k of PAAK-style and PACE: the printed K = lambda_g K_g^ + lambda_b W_d, the
    geometric weight K_g itself, or every frame alike."""
    paak_mode: Literal["soft", "top_k"] = "soft"
    """PAAK-style: weigh all frames (PACE's description), or drop all but the keyframes (PAAK's
    name)."""
    paak_top_share: float = 0.25
    """Share of the frames that are keyframes under `top_k`."""

    # Start search
    grid_step: float = 0.2
    """Distance of neighbouring start positions, metres (POSA)."""
    yaw_step_deg: float = 30.0
    """Distance of neighbouring start yaws, degrees (PACE)."""
    inset: float = 0.35
    """Start positions keep this distance from the walls, metres (POSA: 0.75)."""
    start_layers: tuple[float, ...] = (0.0,)
    """Heights of the clip's floor above the scene's floor at the start, metres."""
    start_filter: float | None = 0.75
    """Reject starts and fits where less than this share of the contact vertices stand nearest to
    the class they expect, floor and all else counted apart (ours); None keeps all."""
    wall_clearance: float = 0.15
    """The pelvis path stays this far inside the room, metres (ours)."""
    max_depth: float | None = 0.20
    """Reject a fit where a vertex without contact is deeper than this inside something,
    metres (ours); None keeps all."""
    max_gap: float | None = 0.12
    """Reject a fit whose contacts with anything but floor are further than this from the scene on
    average, metres (ours): hands that lean on air. None keeps all."""
    bone_clearance: float | None = 0.015
    """Reject starts and fits that bring a bone nearer to a surface than this, metres (ours): limbs
    through boards too thin to cost much penetration. None keeps all."""
    coarse_frames: int = 20
    """Frames of the first, coarse scoring of all starts."""
    coarse_vertices: int = 90
    """Vertices without contact of the coarse scoring."""
    keep_share: float = 0.05
    """Share of the starts that is scored exactly."""
    suppress_distance: float = 0.4
    """Starts closer than this, metres, and `suppress_angle_deg` count as one."""
    suppress_angle_deg: float = 46.0
    """See `suppress_distance`."""
    n_starts: int = 3
    """Starts that are optimised (POSA: 10)."""
    spare_starts: int = 4
    """Further starts that are tried in the place of rigid fits with a fault."""
    n_altered: int = 3
    """Starts, best rigid fits first, whose motion is altered (PACE)."""

    # Energy
    contact_weight: float = 1.0
    """Weight of the contact term, per m² (POSA)."""
    penetration_weight: float = 10.0
    """Weight of the penetration term, per m (POSA)."""
    semantic_weight: float = 0.01
    """Weight of one contact vertex near the wrong class (POSA)."""
    contact_tolerance: float | None = None
    """Contact vertices deeper than this, metres, pay the penetration term too (ours, proposed 0.003);
    None leaves them out of it as POSA does."""
    huber_widths: tuple[float, ...] = (0.01, 0.003)
    """Widths of the rounded kink of the penalty, metres, in the order in which the outer steps
    walk through them; (0.0,) is the printed penalty. Reported energies are always unrounded."""
    lambda_pose: float = 0.1
    """Weight of L_pose, per rad²."""
    lambda_mot: float = 10.0
    """Weight of L_mot, per rad²."""
    lambda_tau: float = 50.0
    """Weight of the translation half inside L_mot, per m²: `lambda_mot` * `lambda_tau` in all."""
    slide_weight: float = 0.0
    """Weight of the steps that an alteration adds to standing feet, per m² and foot (ours)."""
    bend_weight: float = 0.0
    """Weight of squared second differences of the alteration along time, per rad², and times
    `lambda_tau` per m² (ours)."""
    weighted_alteration: bool = True
    """Multiply E_alt by the frame weights as printed, so that important frames are held more
    stiffly too; False holds all frames alike."""
    time_aware: bool = True
    """Scale frame-to-frame differences to steps of 1/30 s; False is the printed form."""

    # Optimiser
    engine: Literal["batched", "reference"] = "batched"
    """How energies are computed: all frames and many starts at once, or frame by frame as POSA's
    code does, every start scored exactly. Equal results, very different cost."""
    parameterisation: Literal["whitened", "raw", "dct"] = "whitened"
    """Variables of the alteration: whitened along time, one a frame, or low frequencies alone."""
    dct_per_frame: float = 16 / 90
    """Share of cosine vectors kept under `dct`."""
    outer_steps: int = 10
    """Calls of the optimiser (PACE)."""
    inner_iterations: int = 20
    """L-BFGS iterations within one call (POSA's code)."""
    history: int = 100
    """Curvature pairs L-BFGS remembers (POSA's code)."""
    relative_tolerance: float = 1e-4
    """Stop after two outer steps that each lower the energy by less than this share of it."""
    give_up_factor: float | None = 2.0
    """Give a start up after three outer steps if it is this many times worse than the best start
    so far; None never gives up."""
    rescue: bool = True
    """Run an ablation again, smoother and then from PACE's solution, where it ends above that;
    False shows what a stalled optimiser answers."""

    device: str = "cpu"
    """Where tensors live: `cpu` or `cuda`. No part of the hash: the numbers are the same."""

    def config_hash(self) -> str:
        """Hash of every value that decides the result, for provenance."""
        values = dataclasses.asdict(self)
        del values["device"]
        return value_sha256(values)


PRESETS: dict[str, PlacementSettings] = {
    "fast": PlacementSettings(
        preset="fast", keep_share=0.03, n_starts=2, n_altered=1, outer_steps=6
    ),
    "default": PlacementSettings(),
    "paper": PlacementSettings(
        preset="paper",
        feature_choice="posa",
        inset=0.75,
        start_filter=None,
        max_depth=None,
        max_gap=None,
        bone_clearance=None,
        n_starts=10,
        n_altered=10,
        huber_widths=(0.0,),
        give_up_factor=None,
    ),
    "posa": PlacementSettings(
        preset="posa",
        engine="reference",
        feature_choice="posa",
        yaw_step_deg=90.0,
        start_layers=(0.0, 0.2, 0.4),
        inset=0.75,
        start_filter=None,
        max_depth=None,
        max_gap=None,
        bone_clearance=None,
        n_starts=10,
        n_altered=10,
        huber_widths=(0.0,),
        inner_iterations=20,
        give_up_factor=None,
        relative_tolerance=0.0,
    ),
}
"""Named settings: `fast` for demonstrations and tests, `default`, `paper` as near to the printed
method as its text allows, and `posa`: that with the search and the frame-by-frame engine of POSA's
code (four yaws, three layers, 20 inner iterations, every start scored exactly): half an hour a
placement and more."""
