"""Values of options: lists with commas, numbers, values by name, spans."""

import re
from collections.abc import Iterable
from typing import Any

import click

from ..errors import InputError


class TimeSpan(click.ParamType):
    """One number, or two separated by a comma."""

    name = "end|start,end"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Return the numbers of the text."""
        try:
            times = tuple(float(text) for text in value.split(","))
        except ValueError:
            times = ()
        if len(times) not in (1, 2):
            self.fail(f"expected an end in s, or start,end, got {value!r}", param, ctx)
        return times


def span_of(first: float | None, last: float | None) -> tuple[float, float] | None:
    """Return the span of ``--from`` and ``--to``; None without both.

    Raises:
        InputError: for one of them without the other.
    """
    if (first is None) != (last is None):
        raise InputError("give both --from and --to, or none")
    return None if first is None or last is None else (first, last)


def split_names(values: Iterable[str]) -> list[str]:
    """Return names from a repeated option or a list with commas; numbers after a comma belong to the name before it."""
    return [text for value in values for text in re.split(r",(?=[A-Za-z])", value) if text]


def parsed_numbers(values: Iterable[str], kind: Any, name: str) -> list[Any] | None:
    """Return numbers from a repeated option or a list with commas; None when left out.

    Raises:
        InputError: naming the option.
    """
    try:
        return [kind(text) for value in values for text in value.split(",")] or None
    except ValueError:
        raise InputError(f"{name} takes numbers, got {', '.join(values)}") from None


def values_by_name(texts: Iterable[str], option: str) -> dict[str, Any]:
    """Return numbers by name from a repeated option ``name=value``; numbers separated by commas become a list.

    Raises:
        InputError: naming the option.
    """
    out: dict[str, Any] = {}
    for text in split_names(texts):
        name, _, value = text.partition("=")
        numbers = parsed_numbers((value,), float, f"{option} {name}") if value else None
        if not numbers:
            raise InputError(f"{option} takes name=value, got {text!r}")
        out[name] = numbers[0] if len(numbers) == 1 else numbers
    return out


def texts_by_name(texts: Iterable[str], option: str) -> dict[str, str]:
    """Return texts by name from a repeated option ``name=text``, or a list with commas.

    Raises:
        InputError: naming the option.
    """
    pairs = [text.partition("=") for text in split_names(texts)]
    for name, sign, text in pairs:
        if not (name and text):
            raise InputError(f"{option} takes name=text, got {name + sign + text!r}")
    return {name: text for name, _, text in pairs}


def locked_joints(texts: Iterable[str], option: str) -> dict[str, float | None]:
    """Return joints from an option ``name`` or ``name=value``, with their locked values; None for the start value.

    Raises:
        InputError: naming the option.
    """
    out: dict[str, float | None] = {}
    for text in split_names(texts):
        name, equals, value = text.partition("=")
        try:
            out[name] = float(value) if equals else None
        except ValueError:
            raise InputError(f"{option} takes joint or joint=value, got {text!r}") from None
    return out


def panels(plots: tuple[str, ...]) -> list[tuple[str, ...]] | None:
    """Return the plots of a replay; signals separated by commas share axes."""
    return [tuple(entry.split(",")) for entry in plots] or None
