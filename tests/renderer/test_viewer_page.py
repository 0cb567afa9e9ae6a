"""The viewer's folder: everything is in it, nothing is fetched from elsewhere, nothing is lost on the way."""

from __future__ import annotations

import base64
import dataclasses
import gzip
import json
import re
from pathlib import Path

import pytest

from renderer import viewer
from renderer.files import InputError, file_sha256
from renderer.viewer.page import MODULES, ViewerBody, ViewerCamera, ViewerPage, write_page

HOME = Path(str(viewer.__file__)).parent
KHRONOS = Path(__file__).with_name("khronos")
PAGE = ViewerPage(
    scene="booth",
    scene_label="Booth",
    motion_label="sit </script> & stand",
    fps=30.0,
    n_frames=12,
    room_size=(3.0, 4.0, 2.5),
    floor_z=0.0,
    tolerance_mm=7.5,
    room=b"the room",
    bodies=(ViewerBody("pace", "PACE <b>", b"one body", 0.1, 1.2),),
    views=(ViewerCamera("SE", (3.0, 0.0, 2.0), (1.0, 2.0, 0.8)),),
)


def unpacked(script: Path) -> bytes:
    found = re.fullmatch(r'paceViewerData\("[a-z_]+", "([^"]+)"\);\n', script.read_text())
    assert found
    return gzip.decompress(base64.b64decode(found[1]))


@pytest.mark.parametrize("folder", [HOME / "three", KHRONOS])
def test_what_others_wrote_is_here_unmodified(folder: Path) -> None:
    notice = (folder / "NOTICE.md").read_text()
    stated = dict(re.findall(r"^\| `([^`]+)` \|.*`([0-9a-f]{64})` \|$", notice, re.M))
    assert len(stated) == 4
    assert {name: file_sha256(folder / name) for name in stated} == stated


def test_data_scripts_hold_the_models(tmp_path: Path) -> None:
    told = write_page(PAGE, tmp_path)
    assert unpacked(tmp_path / "data/room.js") == (tmp_path / "models/room.glb").read_bytes()
    assert unpacked(tmp_path / "data/pace.js") == b"one body"
    assert told["bodies"]["pace"]["page_bytes"] == (tmp_path / "data/pace.js").stat().st_size


def test_the_program_holds_every_module_and_imports_only_backwards(tmp_path: Path) -> None:
    write_page(PAGE, tmp_path)
    modules = json.loads(unpacked(tmp_path / "data/program.js"))
    assert [name for name, _ in modules] == list(MODULES)
    files = [name.split("/")[-1] for name in MODULES]
    for index, (name, source) in enumerate(modules):
        wanted = {
            "three.module.js" if found == "three" else found.split("/")[-1]
            for found in re.findall(
                r"^(?:import|export|\})[^'\"\n]*\bfrom\s+['\"]([^'\"]+)", source, re.M
            )
        }
        assert wanted <= set(files[:index]), name


def test_the_page_names_nothing_outside_its_folder(tmp_path: Path) -> None:
    write_page(PAGE, tmp_path)
    text = (tmp_path / "index.html").read_text()
    linked = re.findall(r"(?:src|href)=\"([^\"]*)\"", text)
    assert [link for link in linked if re.match(r"[a-z]+:|//", link)] == ["data:,"]
    assert "//cdn" not in text and "{{" not in text


def test_names_from_outside_cannot_end_an_element(tmp_path: Path) -> None:
    write_page(PAGE, tmp_path)
    text = (tmp_path / "index.html").read_text()
    assert "PACE <b>" not in text and "sit </script>" not in text
    manifest = re.search(r'id="manifest">(.*)</script>', text)
    assert manifest
    assert json.loads(manifest[1])["motion_label"] == PAGE.motion_label


def test_equal_input_gives_equal_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        write_page(PAGE, tmp_path / name)
    files = [path for path in sorted((tmp_path / "one").rglob("*")) if path.is_file()]
    twins = [tmp_path / "two" / path.relative_to(tmp_path / "one") for path in files]
    assert len(files) == 7
    assert [path.read_bytes() for path in files] == [path.read_bytes() for path in twins]


def test_a_page_written_again_forgets_nothing_of_the_new_and_keeps_no_partial_file(
    tmp_path: Path,
) -> None:
    write_page(PAGE, tmp_path)
    write_page(dataclasses.replace(PAGE, n_frames=40), tmp_path)
    assert '"n_frames": 40' in (tmp_path / "index.html").read_text()
    assert list(tmp_path.rglob(".partial-*")) == []


def test_a_folder_that_cannot_be_written_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match=r"--out: got .*, wanted a folder that can be written"):
        write_page(PAGE, tmp_path / "file")
