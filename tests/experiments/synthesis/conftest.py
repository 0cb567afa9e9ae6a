"""Untrained networks of the published size, and rooms that offer one thing each."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from experiments.scene.scene import Scene
from experiments.scene.synthetic import synthetic_room
from experiments.synthesis.pose_net import PoseNet
from experiments.synthesis.route_net import RouteNet
from experiments.synthesis.subgoal_net import SubgoalNet
from experiments.synthesis.weights import (
    SynthesisNets,
    TrainingNote,
    load_nets,
    weights_file,
    write_weights,
)

NOTE = TrainingNote(recipe="test", seed=5, capture_minutes=1.5)


@pytest.fixture(scope="session")
def untrained_folder(tmp_path_factory) -> Path:
    """Weights files of networks as they are before training."""
    folder = tmp_path_factory.mktemp("untrained")
    torch.manual_seed(5)
    write_weights(SubgoalNet(), "subgoal", NOTE, weights_file("subgoal", folder))
    write_weights(RouteNet(), "route", NOTE, weights_file("route", folder))
    write_weights(PoseNet(), "pose", NOTE, weights_file("pose", folder))
    return folder


@pytest.fixture(scope="session")
def untrained(untrained_folder) -> SynthesisNets:
    return load_nets(untrained_folder)


@pytest.fixture(scope="session")
def bed_room() -> Scene:
    """4 x 3.5 m with a level box of 1 x 2.1 m, 0.5 m high, in the middle of the north wall."""
    boxes = {"bed": ((1.5, 1.4, 0.0), (2.5, 3.5, 0.5), "bed")}
    return synthetic_room(boxes, size=(4.0, 3.5, 2.4), scene_id="bed_room")


@pytest.fixture(scope="session")
def cupboard_room() -> Scene:
    """3 x 3 m with a cupboard along the north wall."""
    boxes = {"cupboard": ((0.5, 2.5, 0.0), (2.5, 3.0, 1.8), "cabinet")}
    return synthetic_room(boxes, scene_id="cupboard_room")
