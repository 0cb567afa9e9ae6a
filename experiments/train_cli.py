"""The commands `pace-study train ...`: each trains one network whose weights the project ships."""

from __future__ import annotations

import click


@click.group()
def train() -> None:
    """Train the networks whose weights the project ships."""
