"""Documents cannot go stale: they name every command and every configuration key there is."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import click
import pytest

import pace_study
from experiments.config import ExtrasConfig, PlacementConfig, RenderConfig, StimulusSetConfig

DOCS = Path(__file__).resolve().parents[2] / "docs"
SECTIONS: list[tuple[str, Any]] = [
    ("", StimulusSetConfig),
    ("placement.", PlacementConfig),
    ("render.", RenderConfig),
    ("extras.", ExtrasConfig),
]


def _leaf_commands(group: click.Command, path: str) -> list[str]:
    if not isinstance(group, click.Group):
        return [path]
    context = click.Context(group)
    found = []
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        found += _leaf_commands(command, f"{path} {name}")
    return found


def test_the_command_page_names_every_command() -> None:
    page = (DOCS / "reference" / "cli.md").read_text()
    commands = _leaf_commands(pace_study.pace_study, "pace-study")
    assert [command for command in commands if command not in page] == []


@pytest.mark.parametrize(("prefix", "kind"), SECTIONS)
def test_the_stimulus_set_page_names_every_key(prefix: str, kind: Any) -> None:
    page = (DOCS / "reference" / "stimulus-set.md").read_text()
    nested = {"placement", "render", "extras"}
    keys = [item.name for item in dataclasses.fields(kind) if item.name not in nested]
    assert [key for key in keys if f"| `{prefix}{key}` |" not in page] == []


def test_every_decision_note_says_what_was_decided_in_its_heading() -> None:
    notes = sorted((DOCS / "decisions").glob("*.md"))
    assert len(notes) > 1
    assert [note.name for note in notes if not note.read_text().startswith("# ")] == []
