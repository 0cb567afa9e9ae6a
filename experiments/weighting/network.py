"""FrameWeightNetwork: the paper's g, from a motion and its interaction features to K_g^.

PAAK gives neither architecture nor loss; both are ours. The weight is predicted as a distribution
over ordered bins, because the diversity score needs the gradient of a label's likelihood: with a
squared loss and the network's own output as the label, that gradient is zero.
"""

from __future__ import annotations

import torch
from jaxtyping import Float, Int64
from torch import Tensor, nn
from torch.nn import functional

from experiments.scene.scene import N_CLASSES
from experiments.weighting.inputs import MotionInputs

N_BINS = 8
WIDTH = 128
CLASS_WIDTH = 8
KERNEL = 5
DILATIONS = (1, 2, 4)
EXPECTATION_WEIGHT = 0.5
"""Weight of the smooth-L1 loss of the expected bin centre beside the cross-entropy of the bin."""


class FrameWeightNetwork(nn.Module):
    """Points of each frame to a vector, context of the whole clip, then convolutions along time."""

    centres: Tensor

    def __init__(self, centres: Float[Tensor, " B"]) -> None:
        super().__init__()
        self.register_buffer("centres", centres.clone())
        self.embedding = nn.Embedding(N_CLASSES, CLASS_WIDTH)
        self.points = nn.Sequential(
            nn.Linear(4 + CLASS_WIDTH, 64), nn.ReLU(), nn.Linear(64, WIDTH), nn.ReLU()
        )
        self.frame = nn.Sequential(nn.Linear(2 * WIDTH + 66, WIDTH), nn.ReLU())
        self.context = nn.Sequential(nn.Linear(3 * WIDTH, WIDTH), nn.ReLU())
        self.time = nn.ModuleList(nn.Conv1d(WIDTH, WIDTH, KERNEL) for _ in DILATIONS)
        self.head = nn.Linear(WIDTH, len(centres))

    def forward(self, inputs: MotionInputs) -> Float[Tensor, "T B"]:
        """Scores of the bins for every frame."""
        scores: Float[Tensor, "T B"] = self.head(self.hidden(inputs))
        return scores

    def hidden(self, inputs: MotionInputs) -> Float[Tensor, "T H"]:
        """What the last layer reads: the diversity score is made of it."""
        point = self.points(torch.cat([inputs.points, self.embedding(inputs.classes)], -1))
        pooled = torch.cat([point.amax(1), point.mean(1), inputs.velocity], -1)
        frame = self.frame(pooled)
        # K_g ranks frames within their clip, so every frame is told what the others are like.
        mean = frame.mean(0, keepdim=True)
        spread = (frame - mean).square().mean(0, keepdim=True).add(1e-4).sqrt()
        known = [frame, (frame - mean) / spread, mean.expand(len(frame), -1)]
        state = self.context(torch.cat(known, -1)).T[None]
        for dilation, layer in zip(DILATIONS, self.time, strict=True):
            state = state + functional.relu(_along_time(state, layer, dilation * inputs.stride))
        hidden: Float[Tensor, "T H"] = state[0].T
        return hidden

    def expectation(self, scores: Float[Tensor, "T B"]) -> Float[Tensor, " T"]:
        """K_g^: the mean of the bin centres under the predicted distribution."""
        return scores.softmax(-1) @ self.centres


def _along_time(
    state: Float[Tensor, "1 H T"], layer: nn.Module, dilation: int
) -> Float[Tensor, "1 H T"]:
    """A convolution that keeps the length; the ends are held."""
    assert isinstance(layer, nn.Conv1d)
    reach = dilation * (KERNEL // 2)
    held = functional.pad(state, (reach, reach), mode="replicate")
    return functional.conv1d(held, layer.weight, layer.bias, dilation=dilation)


def weight_loss(
    scores: Float[Tensor, "T B"],
    centres: Float[Tensor, " B"],
    target: Float[Tensor, " T"],
    bins: Int64[Tensor, " T"],
) -> Float[Tensor, ""]:
    """Cross-entropy of the bin + 0.5 smooth-L1 of the expected centre, both means over frames."""
    expected = scores.softmax(-1) @ centres
    likelihood = functional.cross_entropy(scores, bins)
    distance = functional.smooth_l1_loss(expected, target)
    return likelihood + EXPECTATION_WEIGHT * distance
