"""The context: missing libraries, forks, release, memory."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from renderer.files import InputError
from renderer.offscreen import choose_platform, offscreen
from renderer.versions import render_versions

ROOT = Path(__file__).resolve().parents[2]

WITHOUT_OSMESA = """
import ctypes, ctypes.util
_real, _find = ctypes.CDLL.__init__, ctypes.util.find_library
def refuse(self, name, *rest, **options):
    if 'OSMesa' in str(name):
        raise OSError(f'{name}: cannot open shared object file')
    return _real(self, name, *rest, **options)
ctypes.CDLL.__init__ = refuse
ctypes.util.find_library = lambda name: None if 'OSMesa' in name else _find(name)
"""


def in_fresh_process(program: str, tmp_path: Path, site: str = "", **environment: str):
    (tmp_path / "sitecustomize.py").write_text(site)
    paths = os.pathsep.join([str(tmp_path), str(ROOT)])
    return subprocess.run(
        [sys.executable, "-c", program], text=True, capture_output=True,
        env={**os.environ, "PYTHONPATH": paths, **environment},
    )  # fmt: skip


def test_a_missing_osmesa_is_one_line_that_names_the_package(tmp_path):
    program = (
        "from renderer.versions import render_versions\nfrom renderer.files import InputError\n"
        "try: render_versions('osmesa')\nexcept InputError as error: print(error)\n"
    )
    result = in_fresh_process(program, tmp_path, WITHOUT_OSMESA)
    assert result.stdout.startswith("renderer: platform: got 'osmesa (") and not result.stderr
    assert "libosmesa6" in result.stdout and result.stdout.count("\n") == 1


def test_where_osmesa_is_gone_auto_takes_egl(tmp_path):
    program = (
        "from renderer.versions import render_versions\n"
        "print(render_versions('auto')['platform'])\n"
    )
    result = in_fresh_process(program, tmp_path, WITHOUT_OSMESA)
    assert result.stdout.strip() == "egl", result.stderr


def test_where_neither_is_found_one_line_names_both(tmp_path):
    program = (
        "from renderer.versions import render_versions\nfrom renderer.files import InputError\n"
        "try: render_versions()\nexcept InputError as error: print(error)\n"
    )
    neither = WITHOUT_OSMESA.replace(
        "if 'OSMesa' in str(name)", "if 'OSMesa' in str(name) or 'EGL' in str(name)"
    )
    result = in_fresh_process(program, tmp_path, neither)
    assert result.stdout.startswith("renderer: platform: got 'auto (") and not result.stderr
    assert "libosmesa6" in result.stdout and "libegl1" in result.stdout
    assert result.stdout.count("\n") == 1


def test_opengl_bound_to_another_platform_is_explained(tmp_path):
    program = (
        "import OpenGL.GL\nfrom renderer.versions import render_versions\n"
        "from renderer.files import InputError\n"
        "try: render_versions('osmesa')\nexcept InputError as error: print(error)\n"
    )
    result = in_fresh_process(program, tmp_path, PYOPENGL_PLATFORM="egl")
    assert "OpenGL was imported for egl" in result.stdout, result.stderr


def test_a_forked_child_is_told_to_be_spawned():
    with offscreen():
        pass
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            with offscreen():
                os.write(write, b"drew")
        except InputError as error:
            os.write(write, str(error).encode())
        finally:
            os._exit(0)
    os.close(write)
    os.waitpid(child, 0)
    with os.fdopen(read) as answer:
        assert answer.read() == (
            "renderer: process: got 'forked from a process that renders', wanted a spawned process"
        )


def test_the_platform_that_is_in_use_stays(tmp_path):
    with offscreen("osmesa") as name:
        assert name == "osmesa"
    assert choose_platform("auto") == "osmesa"
    with pytest.raises(InputError, match="osmesa is in use in this process"), offscreen("egl"):
        pass


def test_versions_name_mesa_llvm_and_the_renderer():
    found = render_versions()
    assert found["platform"] == "osmesa" and "llvmpipe" in found["gl_renderer"]
    assert found["mesa"][0].isdigit() and found["llvm"][0].isdigit()
    assert found["pyrender-maintained"] == "1.0.1" and found["ffmpeg"] != "unknown"


def test_catalogue_and_settings_load_no_graphics():
    program = (
        "import sys, renderer.catalogue, renderer.settings, renderer.cameras, renderer.render\n"
        "heavy = {'OpenGL', 'pyrender', 'trimesh', 'imageio', 'imageio_ffmpeg', 'torch'}\n"
        "print(sorted(heavy & set(sys.modules)))\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, text=True, capture_output=True
    )
    assert result.stdout.strip() == "[]", result.stderr


GROWTH = """
import importlib.util, resource, sys
spec = importlib.util.spec_from_file_location('room', sys.argv[1])
room = importlib.util.module_from_spec(spec); spec.loader.exec_module(room)
from renderer.render import open_session
def resident():
    return int(open('/proc/self/statm').read().split()[1]) * 4096 / 2**20
stage = room.make_stage(); rig = room.make_rig(stage); seen = []
for clip in range(int(sys.argv[2])):
    fresh = room.make_stage()
    with open_session(fresh, rig.views, room.TINY) as session:
        for vertices in fresh.vertices[:2]:
            session.frame(vertices)
    seen.append(resident())
print(seen[3], seen[-1])
"""


def test_memory_stays_flat_over_many_rooms():
    room = str(Path(__file__).with_name("conftest.py"))
    result = subprocess.run(
        [sys.executable, "-c", GROWTH, room, "20"], cwd=ROOT, text=True, capture_output=True
    )
    early, late = map(float, result.stdout.split())
    assert late - early < 40, f"{early:.0f} MiB after 4 rooms, {late:.0f} after 20"


@pytest.mark.slow
def test_memory_stays_flat_over_a_hundred_rooms():
    room = str(Path(__file__).with_name("conftest.py"))
    result = subprocess.run(
        [sys.executable, "-c", GROWTH, room, "100"], cwd=ROOT, text=True, capture_output=True
    )
    early, late = map(float, result.stdout.split())
    assert late - early < 60, f"{early:.0f} MiB after 4 rooms, {late:.0f} after 100"
