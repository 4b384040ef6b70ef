"""Which methods need the fewest linear solves on how many models, from the benchmark `mbdae atlas`.

`atlas.json` is written by ``mbdae atlas --data atlas.jsonl -o examples/benchmarks/atlas.json``, which resumes; the
same command with ``-o atlas.html`` writes the page. Linear solves repeat to a few in ten thousand. Where even the
loosest run of a method is more accurate than an error, its solves are an upper bound of those it needs, negative in the
file. Bounds are no measurements: they enter no mean, and a method whose bound is the smallest number of a model does
not win there, nor does any other.

A cell of the first table has the number of models on which a method needs the fewest solves, to 1 %, and no bound is
smaller (a method with a larger bound may still need fewer); the geometric mean of its solves over the fewest measured
ones; and the numbers of models on which they are measured and bounded. The second has rates of the energy of
conservative models over ten durations, relative to it, with three standard errors. With ``--guide`` the tables are
written into the guide.

Run: python examples/benchmarks/atlas.py [--guide]
"""

import json
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from math import inf
from pathlib import Path
from statistics import geometric_mean, median
from typing import Any, NamedTuple

DATA = Path(__file__).with_name("atlas.json")
GUIDE = Path(__file__).parents[1] / "guide" / "methods.md"
BEGIN, END = "<!-- atlas: written by examples/benchmarks/atlas.py --guide -->", "<!-- end of atlas -->"
TARGETS = ("1e-02", "1e-04", "1e-06", "1e-08")  # rad or m, of q
EQUAL = 1.01  # ratio of numbers of solves that count as equal


class Column(NamedTuple):
    """The solves that methods need for an error, on all models.

    Attributes:
        ratios: of each method, its solves over the fewest measured ones, on each model on which they are measured.
        wins: numbers of models on which a method needs the fewest, and no bound is smaller.
        bounded: numbers of models on which the solves of a method are an upper bound.
        models: number of models on which methods reach the error.
        undecided: number of models on which the smallest number is a bound.
    """

    ratios: dict[str, list[float]]
    wins: Counter[str]
    bounded: Counter[str]
    models: int
    undecided: int


def column(data: Mapping[str, Any], target: str) -> Column:
    """Return the solves that methods need for an error."""
    ratios, wins, bounded, models, undecided = defaultdict[str, list[float]](list), Counter(), Counter(), 0, 0
    for m in data["models"].values():
        works = m.get("work", {}).get(target)
        found = {name: x for name, x in zip(m["methods"], works["solves"], strict=True) if x} if works else {}
        if not found:
            continue
        measured = {name: x for name, x in found.items() if x > 0}
        fewest, least = min(measured.values(), default=inf), min(map(abs, found.values()))
        models, undecided = models + 1, undecided + (fewest > EQUAL * least)
        bounded.update(found.keys() - measured.keys())
        wins.update(name for name, x in measured.items() if x <= EQUAL * least)
        for name, x in measured.items():
            ratios[name].append(x / fewest)
    return Column(ratios, wins, bounded, models, undecided)


def rows(data: Mapping[str, Any], targets: Sequence[str] = TARGETS) -> Iterator[list[str]]:
    """Yield the table of the methods, those with the most wins first."""
    columns = [column(data, target) for target in targets]
    yield ["method", *(f"{float(x):.0e}, {c.models} models" for x, c in zip(targets, columns, strict=True))]
    names = {name for c in columns for name in (*c.ratios, *c.bounded)}
    for name in sorted(names, key=lambda name: (-sum(c.wins[name] for c in columns), name)):
        yield [f"`{name}`", *(_cell(c, name) for c in columns)]


def _cell(c: Column, name: str) -> str:
    measured, bounded = c.ratios.get(name, []), c.bounded[name]
    if not measured:
        return f"-; -; 0 + {bounded}" if bounded else "-"
    return f"{c.wins[name]}; {geometric_mean(measured):.3g}; {len(measured)} + {bounded}"


def bounds(data: Mapping[str, Any]) -> str:
    """Return how many numbers are upper bounds, and on how many models the smallest one is."""
    columns = {target: column(data, target) for target in TARGETS}
    count = {t: (c.bounded.total(), c.bounded.total() + sum(map(len, c.ratios.values()))) for t, c in columns.items()}
    numbers = ", ".join(f"{few} of {all_of} at {target}" for target, (few, all_of) in count.items())
    models = ", ".join(f"{c.undecided} of {c.models} at {target}" for target, c in columns.items())
    return (
        f"Upper bounds, as the loosest run of the method is more accurate: {numbers}.\n"
        f"The smallest number of a model is a bound, so that no method wins: on {models}."
    )


def energies(data: Mapping[str, Any]) -> Iterator[list[str]]:
    """Yield, for each method, the rates of the energy of conservative models, those with the smallest median first.

    Runs that ended early are the worst.
    """
    rates: dict[str, list[tuple[float, bool]]] = {}
    for m in data["models"].values():
        for name, (x, trend) in m["energy_rate"].items():
            rates.setdefault(name, []).append((inf if x is None else x, trend))
    middle = {name: median(x for x, _ in found) for name, found in rates.items()}
    yield ["method", "models", "median rate, 1/s", "largest rate, 1/s", "with a trend", "ended early"]
    for name in sorted(rates, key=lambda name: (middle[name], name)):
        found = rates[name]
        trends, early = sum(trend for _, trend in found), sum(x == inf for x, _ in found)
        numbers = (f"{x:.1e}".replace("inf", "-") for x in (middle[name], max(found)[0]))
        yield [f"`{name}`", str(len(found)), *numbers, str(trends), str(early)]


def markdown(table: Iterator[list[str]]) -> str:
    """Return a table as Markdown."""
    first, *rest = (f"| {' | '.join(row)} |" for row in table)
    return "\n".join([first, "|" + "---|" * (first.count("|") - 1), *rest]) + "\n"


def written(page: str, text: str) -> str:
    """Return a page with other tables between the comments that enclose them.

    Raises:
        ValueError: for a page without them.
    """
    if END not in page.partition(BEGIN)[2]:
        raise ValueError(f"the page has no comments {BEGIN!r} and {END!r}")
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    return f"{before}{begin}\n\n{text}\n{end}{after}"


def main(path: str | Path = DATA, guide: str | Path | None = None) -> str:
    """Print and return both tables, and write them into the guide if its path is given."""
    data = json.loads(Path(path).read_text("utf-8"))
    about, n = data["meta"], len([m for m in data["models"].values() if "work" in m])
    models = f"{n} of {len(data['models'])} models, {about['backend']} back end, {about['machine']}, {about['date']}."
    text = f"{models}\n{bounds(data)}\n\n{markdown(rows(data))}\n{markdown(energies(data))}"
    print(text)
    if guide:
        Path(guide).write_text(written(Path(guide).read_text("utf-8"), text), "utf-8")
    return text


if __name__ == "__main__":
    main(guide=GUIDE if "--guide" in sys.argv[1:] else None)
