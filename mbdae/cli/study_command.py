"""Commands of studies: options from the signature of the study, files and exit code from its result."""

import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import wraps
from typing import Any, Protocol

import click

from ..data_types import JsonObject
from ..discovery import lazy_import, public_names
from .lazy_command import LazyCommand
from .model import model_argument
from .options import SHARED, Decorator, options_of
from .output import HOLDS, OutputFile, emit, exit_interrupted, writable
from .values import span_of

Study = Callable[..., Any]


class Result(Protocol):
    """Result of a study, with methods `save` and `plot` if its command has these options."""

    def to_dict(self) -> JsonObject:
        """Return JSON data."""


@dataclass(frozen=True)
class Output:
    """Files and format of the output of a command.

    Attributes:
        paths: paths by argument, None where left out.
        written: the given paths.
        as_json: print one JSON document.
    """

    paths: Mapping[str, str | None]
    written: list[str]
    as_json: bool

    def emit(self, data: Mapping[str, object], text: str, written: list[str] | None = None) -> None:
        """Print a result and the files that were written."""
        names = self.written if written is None else written
        lines = [*filter(None, [text]), *(f"wrote {path}" for path in names)]
        emit({**data, "written": names}, "\n".join(lines), self.as_json)


def command(
    words: str = "",
    *files: OutputFile,
    shared: str = "",
    subject: Decorator | None = model_argument,
    more: Iterable[Decorator] = (),
    types: Mapping[str, object] | None = None,
) -> Callable[[Callable[..., None]], click.Command]:
    """Return a decorator that makes a command of ``function(study, out, **options)``.

    Args:
        words: options of the study, see `options_of`; the study has the name of the function.
        files: files that it writes.
        shared: names of `SHARED`.
        subject: decorator that adds the model argument.
        more: decorators of other options.
        types: click types that are narrower than the annotations of the study.
    """

    def decorate(function: Callable[..., None]) -> click.Command:
        package, name = function.__module__.rpartition(".")[0], function.__name__

        @wraps(function)
        def run_study(as_json: bool, **options: Any) -> None:
            paths = {file.name: options.pop(file.name) for file in files}
            written = writable(*((paths[file.name], file.suffixes) for file in files))
            if "first" in options:
                options["span"] = span_of(options.pop("first"), options.pop("last"))
            study = lazy_import(public_names(package)[name], name) if name in public_names(package) else None
            function(study, Output(paths, written, as_json), **options)

        def add_options(callback: Callable[..., Any]) -> Callable[..., Any]:
            options_of_study = options_of(package, name, words, types or {})
            shared_options = [SHARED[word] for word in shared.split()]
            decorators = [*options_of_study, *shared_options, *more, *(file.option for file in files), SHARED["json"]]
            for option in reversed([*([subject] if subject else []), *decorators]):
                callback = option(callback)
            return callback

        return click.command(cls=LazyCommand, add_options=add_options)(run_study)

    return decorate


def study_command(
    words: str = "",
    *files: OutputFile,
    exit_code: Callable[[Any], int] = lambda result: HOLDS,
    missing: Callable[[Any], str] = lambda result: "",
    **settings: Any,
) -> Callable[[Callable[..., Result]], click.Command]:
    """Return a decorator that makes a command of ``function(study, **options)``, which returns a result.

    Args:
        words: options of the study, see `options_of`.
        files: files that the result writes.
        exit_code: exit code for a result.
        missing: description of what an interrupted study did not finish; empty for a finished study.
        settings: as for `command`.
    """

    def decorate(function: Callable[..., Result]) -> click.Command:
        @wraps(function)
        def deliver(study: Study, out: Output, **options: Any) -> None:
            result = function(study, **options)
            for file in files:
                path = out.paths[file.name]
                if path:
                    file.write(result, path, options)
            out.emit(result.to_dict(), str(result))
            if missing(result):
                exit_interrupted(missing(result))
            sys.exit(exit_code(result))

        return command(words, *files, **settings)(deliver)

    return decorate
