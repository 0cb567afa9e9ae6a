"""Where placements are computed: the processor, or a graphics card with the same code."""

from __future__ import annotations

import torch

from renderer.files import InputError

DEVICES = ("cpu", "cuda")


def require_device(name: str) -> None:
    """Refuse, in one line, a device that this machine or this build of torch does not have."""
    if name not in DEVICES:
        raise InputError("command line", "--device", name, "one of " + ", ".join(DEVICES))
    if name == "cuda" and not torch.cuda.is_available():
        raise InputError("command line", "--device", name, "cpu: torch finds no CUDA device here")
