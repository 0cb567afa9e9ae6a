"""CPU time of skinning, one thread: fast product forward and with gradients, and the slow reference."""

from __future__ import annotations

import json
import statistics
import time
from collections.abc import Callable

import torch

from experiments.body.embedded import BODY_FILE, read_body
from experiments.body.reference import skin_slowly
from experiments.body.skinned_body import SkinnedBody

REPEATS = 7


def main() -> None:
    """Print milliseconds a call for two meshes and three clip lengths."""
    torch.set_num_threads(1)
    body = read_body(BODY_FILE, "male_slim")
    figures: dict[str, float] = {}
    for mesh, ids in (("615", body.subset), ("13718", None)):
        for n_frames in (60, 150, 300):
            pose = torch.linspace(-1, 1, n_frames * 66).reshape(n_frames, 22, 3).requires_grad_()
            transl = torch.zeros(n_frames, 3)
            key = f"vertices_{mesh}_frames_{n_frames}"
            with torch.no_grad():
                figures[f"{key}_forward_ms"] = cpu_ms(lambda: body.posed(pose, transl, ids))  # noqa: B023
            figures[f"{key}_gradients_ms"] = cpu_ms(
                lambda: body.posed(pose, transl, ids).vertices.square().sum().backward()  # noqa: B023
            )
    figures["reference_615_one_frame_ms"] = cpu_ms(lambda: _slow(body))
    for key, value in figures.items():
        print(f"{key:45s} {value:9.2f}")
    print(json.dumps({"area": "body", **{key: round(v, 3) for key, v in figures.items()}}))


def cpu_ms(call: Callable[[], object]) -> float:
    """Median CPU milliseconds of a call after one warm-up."""
    call()
    spent = []
    for _ in range(REPEATS):
        start = time.process_time()
        call()
        spent.append(1e3 * (time.process_time() - start))
    return statistics.median(spent)


def _slow(body: SkinnedBody) -> object:
    pose = torch.linspace(-1, 1, 66).reshape(22, 3).double().numpy()
    return skin_slowly(body.points[body.subset], body.rest_joints, pose, pose[0])


if __name__ == "__main__":
    main()
