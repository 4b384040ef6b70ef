"""Factories of mechanisms with given values of their parameters: from files, loaded mechanisms and functions."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from ..callbacks import call_and_report, function_name
from ..errors import InputError, MbdaeError, UnknownNameError, require
from ..mechanism import Mechanism, ModelSource, load
from ..mechanism.formats.mechanism_file.loaded_model import LoadedModel
from ..mechanism.formats.mechanism_file.template import START, Template, check_start, with_start

Model = ModelSource | Mechanism | Callable[..., Mechanism]


class MechanismFactory(Protocol):
    """Factory of mechanisms, from values of their parameters."""

    def make(self, values: Mapping[str, object]) -> Mechanism:
        """Return the mechanism with these values."""


class ParametricFactory(MechanismFactory, Protocol):
    """A factory that knows the names of its parameters."""

    parameters: tuple[str, ...]

    def check(self, values: Mapping[str, object], others: Sequence[str] = ()) -> None:
        """Reject unknown names; ``others`` are valid elsewhere, and named in messages."""


class FunctionFactory:
    """Factory from a user's function: the parameters are its arguments and start values."""

    def __init__(self, function: Callable[..., Mechanism]) -> None:
        self.function, self.name = function, function_name(function)
        try:
            arguments = inspect.signature(function).parameters.values()
        except (TypeError, ValueError):  # for a function written in C
            raise InputError(f"model {self.name!r} has no readable signature: give a Python function") from None
        self.parameters = tuple(p.name for p in arguments if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY))
        self.accepts_any_name = any(p.kind == p.VAR_KEYWORD for p in arguments)

    def check(self, values: Mapping[str, object], others: Sequence[str] = ()) -> None:
        """See `ParametricFactory`."""
        start = [name for name in values if name.startswith(START)]
        for name in values:
            if not (name in self.parameters or name in start or (self.accepts_any_name and name.isidentifier())):
                raise UnknownNameError(f"parameter of {self.name}", name, (*self.parameters, "start. ...", *others))
        if start:
            mech = self.make({name: x for name, x in values.items() if name not in start})
            for name in start:
                check_start(mech, name)

    def make(self, values: Mapping[str, object]) -> Mechanism:
        """See `ParametricFactory`."""
        start = {name: x for name, x in values.items() if name.startswith(START)}
        arguments = {name: x for name, x in values.items() if name not in start}

        def arguments_text() -> str:
            return ", ".join(f"{name} = {x!r:.60}" for name, x in arguments.items())

        mech = call_and_report(f"model {self.name!r}", lambda: self.function(**arguments), arguments_text, MbdaeError)
        require(mech, Mechanism, f"{self.name} must return a Mechanism")
        return with_start(mech, start)


def factory_of(model: Any) -> ParametricFactory:
    """Return the factory of the mechanisms of a model; a factory is returned unchanged.

    Args:
        model: a mechanism that was loaded, an argument of `mbdae.load`, or a function that returns a Mechanism.

    Raises:
        UnknownNameError, InputError: as raised by `mbdae.load`; InputError for any other argument, too.
    """
    model = with_tables_loaded(model)
    if isinstance(model, Mechanism):
        return LoadedModel(model)
    if isinstance(model, str | Path):
        return Template(model)
    if hasattr(model, "make"):
        return model  # type: ignore[no-any-return]
    if not callable(model):
        kinds = "a Mechanism, a name, a path, tables or a function that returns one"
        raise InputError(f"a model is {kinds}, got {model!r:.60}")
    return FunctionFactory(model)


def with_tables_loaded(model: Any) -> Any:
    """Return the mechanism of tables; any other model unchanged."""
    return load(model) if isinstance(model, Mapping) else model


def model_title(model: Model) -> str:
    """Return the name of a model in tables and figures."""
    if isinstance(model, Mechanism):
        return model.title
    return str(model) if isinstance(model, str | Path) else function_name(model)
