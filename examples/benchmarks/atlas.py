"""Which methods need the fewest linear solves on how many models, from the atlas of all models.

`atlas.json` is written by ``mbdae atlas --data atlas.jsonl -o examples/benchmarks/atlas.json``, which resumes; the
same command with ``-o atlas.html`` writes the page. Linear solves repeat exactly. A cell of the first table has the
number of models on which a method needs the fewest solves, to 1 %, the geometric mean of its solves over the fewest
ones, and the number of models on which it reaches the error. The second has rates of the energy of conservative models
over ten durations, relative to it, with three standard errors. With ``--guide`` the tables are written into the guide.

Run: python examples/benchmarks/atlas.py [--guide]
"""

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from math import exp, log
from pathlib import Path
from typing import Any

DATA = Path(__file__).with_name("atlas.json")
GUIDE = Path(__file__).parents[1] / "guide" / "methods.md"
BEGIN, END = "<!-- atlas: written by examples/benchmarks/atlas.py --guide -->", "<!-- end of atlas -->"
TARGETS = ("1e-02", "1e-04", "1e-06", "1e-08")  # rad or m, of q
EQUAL = 1.01  # ratio of numbers of solves that count as equal
Ratios = dict[str, list[float]]  # solves over the fewest ones, on each model that a method reaches


def ratios(data: Mapping[str, Any], target: str) -> tuple[Ratios, int]:
    """Return the solves of each method for an error, over the fewest, by model; and the number of models."""
    out: Ratios = {}
    models = 0
    for m in data["models"].values():
        works = m.get("work", {}).get(target)
        if works:
            found = {name: abs(x) for name, x in zip(m["methods"], works["solves"], strict=True) if x}
            least = min(found.values())
            models += 1
            for name, x in found.items():
                out.setdefault(name, []).append(x / least)
    return out, models


def rows(data: Mapping[str, Any], targets: Sequence[str] = TARGETS) -> Iterator[list[str]]:
    """Yield the table of the methods, those with the most wins first."""
    columns = [ratios(data, target) for target in targets]
    yield ["method", *(f"{float(x):.0e}, {n} models" for x, (_, n) in zip(targets, columns, strict=True))]
    wins = {
        name: sum(x <= EQUAL for found, _ in columns for x in found.get(name, ()))
        for name in dict.fromkeys(name for found, _ in columns for name in found)
    }
    for name in sorted(wins, key=lambda name: (-wins[name], name)):
        yield [f"`{name}`", *(_cell(found.get(name)) for found, _ in columns)]


def _cell(found: list[float] | None) -> str:
    if not found:
        return "-"
    mean = exp(sum(map(log, found)) / len(found))
    return f"{sum(x <= EQUAL for x in found)}; {mean:.3g}; {len(found)}"


def energies(data: Mapping[str, Any]) -> Iterator[list[str]]:
    """Yield, for each method, the rates of the energy of conservative models, those with the smallest median first."""
    rates: dict[str, list[tuple[float, bool]]] = {}
    for m in data["models"].values():
        for name, (x, trend) in m["energy_rate"].items():
            rates.setdefault(name, []).append((float("inf") if x is None else x, trend))
    yield ["method", "models", "median rate, 1/s", "largest rate, 1/s", "with a trend", "ended early"]
    for name, found in sorted(rates.items(), key=lambda item: (_median(item[1]), item[0])):
        trends, early = sum(trend for _, trend in found), sum(x == float("inf") for x, _ in found)
        numbers = (f"{_median(found):.1e}", f"{max(found)[0]:.1e}".replace("inf", "-"))
        yield [f"`{name}`", str(len(found)), *numbers, str(trends), str(early)]


def _median(found: Sequence[tuple[float, bool]]) -> float:
    """Return the median, where runs that ended early are the worst."""
    return sorted(x for x, _ in found)[len(found) // 2]


def markdown(table: Iterator[list[str]]) -> str:
    """Return a table as Markdown."""
    first, *rest = (f"| {' | '.join(row)} |" for row in table)
    return "\n".join([first, "|" + "---|" * (first.count("|") - 1), *rest]) + "\n"


def written(page: str, text: str) -> str:
    """Return a page with other tables between the comments that enclose them."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    return f"{before}{begin}\n\n{text}\n{end}{after}"


def main(path: str | Path = DATA, guide: str | Path | None = None) -> str:
    """Print and return both tables, and write them into the guide if its path is given."""
    data = json.loads(Path(path).read_text("utf-8"))
    about, n = data["meta"], len([m for m in data["models"].values() if "work" in m])
    first = f"{n} models, {about['backend']} back end, {about['machine']}, {about['date']}:"
    text = f"{first}\n\n{markdown(rows(data))}\n{markdown(energies(data))}"
    print(text)
    if guide:
        Path(guide).write_text(written(Path(guide).read_text("utf-8"), text), "utf-8")
    return text


if __name__ == "__main__":
    main(guide=GUIDE if "--guide" in sys.argv[1:] else None)
