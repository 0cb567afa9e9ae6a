"""The commands `pace-study train ...`: each trains one network whose weights the project ships."""

from __future__ import annotations

import json
from pathlib import Path

import click


@click.group()
def train() -> None:
    """Train the networks whose weights the project ships."""


@train.command()
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder of the run.")
@click.option(
    "--preset",
    type=click.Choice(["default", "official", "spiral"]),
    default="default",
    show_default=True,
    help="Ours, POSA's loss and labels, or POSA's network too.",
)
@click.option(
    "--thickness",
    type=click.Choice(["0.02", "0.05"]),
    help="Label thickness in metres instead of the preset's.",
)
@click.option("--kl", type=click.FloatRange(min=0), help="Weight of the KL term.")
@click.option("--width", type=click.IntRange(8, 512), help="Width of the layers (multiple of 8).")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the run.")
@click.option(
    "--data-seed", type=click.IntRange(0), default=0, show_default=True, help="Of the data."
)
@click.option("--epochs", type=click.IntRange(1), help="Passes over the data.")
@click.option("--device", default="cpu", show_default=True, help="Torch device, e.g. cuda.")
@click.option("--mixed", is_flag=True, help="Forward pass in bfloat16.")
@click.option("--resume", is_flag=True, help="Go on from the checkpoint in the folder.")
@click.option("--sweep", is_flag=True, help="Train once for each of several KL weights.")
@click.option(
    "--report",
    is_flag=True,
    help="Compare the shipped and the folder's networks with all baselines.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def posa(
    out: Path,
    preset: str,
    thickness: str | None,
    kl: float | None,
    width: int | None,
    seed: int,
    data_seed: int,
    epochs: int | None,
    device: str,
    mixed: bool,
    resume: bool,
    sweep: bool,
    report: bool,
    as_json: bool,
) -> None:
    """Train the human-scene interaction model (POSA's cVAE, re-implemented)."""
    from experiments.cli import progress_bars
    from experiments.interaction import training_run
    from experiments.interaction.contact_training import named

    settings = named(
        preset,
        thickness_m=None if thickness is None else float(thickness),
        w_kl=kl,
        width=width,
        epochs=epochs,
        seed=seed,
        data_seed=data_seed,
        mixed=mixed,
    )
    again = f"pace-study train posa --out {out} ... --resume"
    if report:
        from experiments.interaction.posa_report import report_folder

        with progress_bars(f"pace-study train posa --out {out} --report") as bars:
            found, tables = report_folder(out, data_seed, bars)
        click.echo(json.dumps(found) if as_json else tables)
        return
    with progress_bars(again) as bars:
        dataset = training_run.training_data(data_seed, bars)
        run = training_run.sweep_kl if sweep else training_run.train_one
        record = run(dataset, settings, out, device, resume, bars)
    text = training_run.summary(record)
    click.echo(json.dumps(record) if as_json else text)


@train.command()
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder of the run.")
@click.option(
    "--interaction", default="learned", show_default=True, help="Which model makes the features."
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the run.")
@click.option("--epochs", type=click.IntRange(1), default=60, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def weights(out: Path, interaction: str, seed: int, epochs: int, as_json: bool) -> None:
    """Train the network g of the frame weights; go on where an earlier run in --out stopped."""
    from experiments.cli import progress_bars
    from experiments.weighting.training import TrainingSettings
    from experiments.weighting.training_run import run_summary, run_training

    settings = TrainingSettings(interaction, seed=seed, epochs=epochs)
    again = f"pace-study train weights --out {out} --interaction {interaction} --seed {seed}"
    with progress_bars(f"{again} --epochs {epochs}") as bars:
        report = run_training(settings, out, bars)
    click.echo(json.dumps(report) if as_json else run_summary(report))


@train.command()
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder of the run.")
@click.option(
    "--motions",
    type=click.Path(path_type=Path),
    help="Folder with AMASS, CMU or BVH recordings; default: CMU's under PACE_SHARED.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the run.")
@click.option("--epochs", type=click.IntRange(1), help="Of every network; default 30, 25 and 20.")
@click.option("--device", default="cpu", show_default=True, help="Torch device, e.g. cuda.")
@click.option("--resume", is_flag=True, help="Go on from the checkpoints in the folder.")
@click.option("--report", is_flag=True, help="Held-out scores, amounts of capture, pictures.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def synthesis(
    out: Path,
    motions: Path | None,
    seed: int,
    epochs: int | None,
    device: str,
    resume: bool,
    report: bool,
    as_json: bool,
) -> None:
    """Train the three networks of motion synthesis (Wang et al. 2021, re-implemented)."""
    from experiments.cli import progress_bars
    from experiments.interaction.training_run import check_device
    from experiments.synthesis.placed_windows import DataSettings
    from experiments.synthesis.training import Plan
    from experiments.synthesis.training_run import run_training, summary

    check_device(device)
    plan = Plan(seed=seed, device=device)
    if epochs is not None:
        plan = Plan(seed=seed, epochs=(epochs, epochs, epochs), device=device)
    where = "" if motions is None else f" --motions {motions}"
    again = f"pace-study train synthesis --out {out}{where} --seed {seed} ... --resume"
    with progress_bars(again) as bars:
        record = run_training(
            DataSettings(seed=seed, motions=motions), plan, out, resume, report, bars
        )
    click.echo(json.dumps(record) if as_json else summary(record))
