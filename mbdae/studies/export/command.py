"""Sub-command ``export``."""

from typing import Any

from ...cli.model import ChosenModel
from ...cli.output import output_file
from ...cli.study_command import Output, Study, command

UNIT = output_file("-o", "--output", required=True, suffixes=(".fmu",), help="The FMU to write.")


@command("kind inputs outputs parameters sources", UNIT, shared="method step rtol")
def export(study: Study, out: Output, model: ChosenModel, **options: Any) -> None:
    """Write a model as an FMU for other programs. It is one of FMI 3.0, with the compiled core inside."""
    given = {name: x for name, x in options.items() if x is not None}
    found = study(model.load(), out.written[0], **given)
    out.emit(found.to_dict(), str(found), [])
