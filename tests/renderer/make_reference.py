"""Draw the still of the golden-image test: `python tests/renderer/make_reference.py OUT.png`."""

from __future__ import annotations

import argparse
import importlib.util
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from renderer.render import render_still
from renderer.settings import RenderSettings
from renderer.video import write_image


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--platform", default="osmesa")
    arguments = parser.parse_args()
    home = Path(__file__).with_name("conftest.py")
    spec = importlib.util.spec_from_file_location("synthetic_room", home)
    room = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(room)
    stage = room.make_stage()
    settings = RenderSettings(width=320, height=180, platform=arguments.platform)
    write_image(arguments.out, render_still(stage, room.make_rig(stage), "view-1", 2, settings))


if __name__ == "__main__":
    main()
