"""Outputs of each run of a sweep: signals at given times, and scalars.

"q.slider"                     a signal at the times of the sweep
"final q.slider"               its value at the end; max, min, and peak, the largest magnitude
"rms effort.motor"             over time; also mean and integral
"peak force.wrist pin"         of a joint or closure: force in N and torque in N m, magnitudes or components
"max effort.motor"             of a coupling or a driver; power of a driver or a force
"min normal.front"             of a rolling body; also longitudinal, lateral and friction, the required coefficient
a function of the Solution     returns a table of numbers: {"period": 1.2}

Extrema and integrals come from the solution between the steps, `mbdae.solution.statistics`: they depend only on
the error of the run, not on the times of its steps or of the sweep.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...callbacks import function_name
from ...errors import InputError, MbdaeError, UnknownNameError
from ...solution.signals import signals, units
from ...solution.solution import Solution
from ...solution.statistics import Extremum, Integrals, extrema, integrals
from ...system import Array
from ...units import substituted

Function = Callable[[Solution], Mapping[str, float]]
Output = str | Function
EXTREMA: dict[str, Callable[[tuple[Extremum, Extremum]], float]] = {
    "min": lambda x: x[0].value,
    "max": lambda x: x[1].value,
    "peak": lambda x: max(abs(x[0].value), abs(x[1].value)),
}
REDUCTIONS = ("final", *EXTREMA, *Integrals._fields)


class ParsedOutput(NamedTuple):
    """A parsed output: a signal, and its reduction to a scalar; None for values at the times of the sweep."""

    text: str
    reduction: str | None
    signal: str

    def unit(self, known: Mapping[str, str]) -> str:
        """Return the unit of the output from the units of signals by name: an integral is over time."""
        unit = known[self.signal]
        return substituted("x s", {"x": unit}) if self.reduction == "integral" and "," not in unit else unit


def parse(text: str) -> ParsedOutput:
    """Read an output: a signal, or a reduction and a signal."""
    first, _, rest = text.strip().partition(" ")
    return (
        ParsedOutput(text, first, rest.strip())
        if first in REDUCTIONS and rest
        else ParsedOutput(text, None, text.strip())
    )


def check(known: Mapping[str, str], outputs: Sequence[Output], timed: bool) -> None:
    """Reject outputs that no run can have.

    Args:
        known: signals of the runs.
        outputs: the outputs.
        timed: whether signals are taken at given times.

    Raises:
        UnknownNameError: for a signal or a reduction that does not exist.
        InputError: for a signal without times, or an output that is neither text nor function.
    """
    for output in outputs:
        if not isinstance(output, str):
            if not callable(output):
                raise InputError(f"an output is a text or a function of the solution, got {output!r:.60}")
            continue
        parsed = parse(output)
        first, _, rest = parsed.signal.partition(" ")
        if parsed.signal not in known and rest in known:
            raise UnknownNameError("reduction", first, REDUCTIONS)
        if parsed.signal not in known:
            raise UnknownNameError("signal", parsed.signal, known)
        if parsed.reduction is None and not timed:
            raise InputError(f"output {output!r} needs times=, or a reduction as in 'max {output}'")
    if len(set(outputs)) < len(outputs):
        raise InputError(f"an output is given twice: {', '.join(map(label, outputs))}")


def label(output: Output) -> str:
    """Return an output as text."""
    return output if isinstance(output, str) else function_name(output)


def evaluate(
    sol: Solution, outputs: Sequence[Output], n: int | None
) -> tuple[dict[str, float], dict[str, Array], dict[str, float]]:
    """Return the outputs of a run: scalars, signals at ``n`` times (nan after its end), results of functions.

    Signals that the mechanism of the run does not have are omitted; those of other runs may have more bodies, say.

    Raises:
        InputError: for a function that fails, or does not return a table of numbers.
    """
    parsed = [p for x in outputs if isinstance(x, str) and (p := parse(x)).signal in units(sol.mechanism)]
    found = signals(sol, [p.signal for p in parsed if p.reduction in (None, "final")])
    numbers = _reduced_values(sol, parsed, found)
    samples = {p.text: np.full(n, np.nan) for p in parsed if p.reduction is None and n is not None}
    for text, values in samples.items():
        values[: len(sol.t)] = found[parse(text).signal]
    return numbers, samples, _function_results(sol, [x for x in outputs if not isinstance(x, str)])


def _reduced_values(sol: Solution, parsed: Sequence[ParsedOutput], found: Mapping[str, Array]) -> dict[str, float]:
    """Return the scalar outputs; ``found`` has the signals of final values."""
    extremes = extrema(sol, [p.signal for p in parsed if p.reduction in EXTREMA])
    integrated = integrals(sol, [p.signal for p in parsed if p.reduction in Integrals._fields])
    numbers = {}
    for p in parsed:
        if p.reduction in EXTREMA:
            numbers[p.text] = EXTREMA[p.reduction](extremes[p.signal])
        elif p.reduction in Integrals._fields:
            numbers[p.text] = getattr(integrated[p.signal], p.reduction)
        elif p.reduction:
            numbers[p.text] = float(found[p.signal][-1])
    return numbers


def _function_results(sol: Solution, functions: Sequence[Function]) -> dict[str, float]:
    """Return the results of all functions as one table."""
    out: dict[str, float] = {}
    for function in functions:
        result = _call(function, sol)
        if twice := sorted(result.keys() & out.keys()):
            raise InputError(f"two output functions return {twice[0]!r}")
        out |= result
    return out


def _call(function: Function, sol: Solution) -> dict[str, float]:
    name = function_name(function)
    try:
        result = function(sol)
        return {str(key): float(value) for key, value in result.items()}
    except Exception as e:
        reason = str(e) if isinstance(e, MbdaeError) else f"{type(e).__name__}: {e}"
        expected = "a function of the solution that returns a table of numbers"
        raise InputError(f"output {name!r}, {expected}: {reason}") from e
