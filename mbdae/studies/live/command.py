"""The sub-command ``live``."""

import sys
from time import sleep
from typing import Any

import click

from ...cli.model import ChosenModel
from ...cli.output import exit_unless_successful, output_file
from ...cli.study_command import Output, Study, command
from ...units import quantity

RUN = output_file("-o", "--output", suffixes=(".npz", ".csv"), help="Save the simulated run at the end.")
SECONDS = click.option("--seconds", type=click.FloatRange(min=0, min_open=True), help="End after this time.")
INTERVAL = 0.2  # s between polls for Ctrl-C


@command("range parameter trace speed fps port paused shadows rtol", RUN, shared="method step units", more=(SECONDS,))
def live(study: Study, out: Output, model: ChosenModel, seconds: float | None, **options: Any) -> None:
    """Simulate a model in real time in a browser. Inputs, joints and lengths have sliders; it ends with Ctrl-C.

    Dragging a body applies a spring force to it.
    """
    record = out.paths["output"] is not None
    view = study(model.load(), record=record, **options)
    if not out.as_json:
        click.echo(f"{view.mechanism.title}: {view.url} (Ctrl-C ends it)")
    if sys.stdout.isatty():
        click.launch(view.url)
    try:
        remaining = seconds if seconds is not None else float("inf")
        while remaining > 0:
            sleep(min(INTERVAL, remaining))
            remaining -= INTERVAL
    except KeyboardInterrupt:
        pass
    sol = view.stop()
    written = view.save(out.paths["output"]) if record else []
    data = {"t": float(sol.t[-1]), "status": sol.status, "message": sol.message, "resets": len(view.runs)}
    out.emit(data, f"simulated {quantity(sol.t[-1], 's')}: {sol.status}", written)
    exit_unless_successful(sol)
