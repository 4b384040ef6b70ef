"""Commands of studies: options from the study, files and exit code from its result."""

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
        written: paths given.
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
        subject: adds the model.
        more: other options.
        types: click types that are narrower than the annotations of the study.
    """

    def decorate(function: Callable[..., None]) -> click.Command:
        package, name = function.__module__.rpartition(".")[0], function.__name__

        @wraps(function)
        def called(as_json: bool, **given: Any) -> None:
            paths = {file.name: given.pop(file.name) for file in files}
            written = writable(*((paths[file.name], file.suffixes) for file in files))
            if "first" in given:
                given["span"] = span_of(given.pop("first"), given.pop("last"))
            study = lazy_import(public_names(package)[name], name) if name in public_names(package) else None
            function(study, Output(paths, written, as_json), **given)

        def add_options(callback: Callable[..., Any]) -> Callable[..., Any]:
            own = options_of(package, name, words, types or {})
            common = [SHARED[word] for word in shared.split()]
            decorators = [*own, *common, *more, *(file.option for file in files), SHARED["json"]]
            for option in reversed([*([subject] if subject else []), *decorators]):
                callback = option(callback)
            return callback

        return click.command(cls=LazyCommand, add_options=add_options)(called)

    return decorate


def study_command(
    words: str = "",
    *files: OutputFile,
    exit_code: Callable[[Any], int] = lambda found: HOLDS,
    missing: Callable[[Any], str] = lambda found: "",
    **settings: Any,
) -> Callable[[Callable[..., Result]], click.Command]:
    """Return a decorator that makes a command of ``function(study, **options)``, which returns a result.

    Args:
        words: options of the study, see `options_of`.
        files: files that the result writes.
        exit_code: exit code by the result.
        missing: description of what an interrupted study did not finish; empty for a finished study.
        settings: as for `command`.
    """

    def decorate(function: Callable[..., Result]) -> click.Command:
        @wraps(function)
        def deliver(study: Study, out: Output, **given: Any) -> None:
            found = function(study, **given)
            for file in files:
                path = out.paths[file.name]
                if path:
                    file.write(found, path, given)
            out.emit(found.to_dict(), str(found))
            if missing(found):
                exit_interrupted(missing(found))
            sys.exit(exit_code(found))

        return command(words, *files, **settings)(deliver)

    return decorate
