"""The command line `pace-study`: one entry point, sub-commands imported only when they are called.

`serve`, `study` and `analyze` must start without torch or OpenGL on the machine, so nothing heavy
may be imported here; the table below names each sub-command's home instead.
"""

from __future__ import annotations

import importlib
import sys

import click

from renderer.files import InputError

COMMANDS: dict[str, tuple[str, str]] = {
    "demo": ("demo:demo", "Run the whole path once: place, render, ask, analyse."),
    "assets": (
        "experiments.motion.cli:assets",
        "List bodies, motions and rooms with their checks.",
    ),
    "motion": ("experiments.motion.cli:motion", "Import motion capture onto the embedded body."),
    "scene": ("experiments.scene.cli:scene", "Bake and inspect rooms."),
    "stimuli": ("experiments.cli:stimuli", "Build, verify and tabulate a stimulus set."),
    "evaluate": ("experiments.cli:evaluate", "Place and score methods without rendering."),
    "train": ("experiments.train_cli:train", "Train the networks that the project ships."),
    "render": ("experiments.cli:render", "Render one placement into a clip."),
    "view": ("experiments.view_cli:view", "Write a page that shows placements in 3D."),
    "study": ("study_app.cli:study", "Create, open, watch, close and export studies."),
    "serve": ("study_app.cli:serve", "Serve studies to participants."),
    "simulate": ("study_app.cli:simulate", "Let simulated participants answer over HTTP."),
    "analyze": ("analysis.cli:analyze", "Turn answers into preference tables."),
    "plan": ("analysis.cli:plan", "Forecast power and interval width of a study."),
    "check-claims": ("analysis.cli:check_claims", "Check the numbers of a text."),
}


class LazyCommands(click.Group):
    """A group whose sub-commands are imported on first use."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order of the table, which is the order of the work."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the module that holds the command."""
        if cmd_name not in COMMANDS:
            return None
        module_name, attribute = COMMANDS[cmd_name][0].split(":")
        command = getattr(importlib.import_module(module_name), attribute)
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Print the one-line help from the table, so that `--help` imports nothing."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])


@click.group(cls=LazyCommands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="pace-study")
def pace_study() -> None:
    """Perceptual studies of generated human motion, from motion capture to preference table."""


def main() -> None:
    """Run the command line: exit 2 on bad use, 1 with one clear line on bad input."""
    try:
        pace_study(standalone_mode=True)
    except InputError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(1)


if __name__ == "__main__":
    main()
