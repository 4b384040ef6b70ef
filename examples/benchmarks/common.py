"""Shared by the benchmarks: the machine, medians of interleaved runs, tables in Markdown, available back ends."""

import argparse
import os
import platform
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from datetime import date
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import TypeVar

from mbdae import backend

K = TypeVar("K", bound=Hashable)
R = TypeVar("R")


def backends() -> list[str]:
    """Back ends of `mbdae.solve` that work here, the Python one first."""
    return ["python", "native"] if backend.load() else ["python"]


def brief(argv: Sequence[str] | None, about: str | None) -> bool:
    """Read the command line: True with --brief."""
    parser = argparse.ArgumentParser(description=(about or "").split("\n")[0])
    parser.add_argument("--brief", action="store_true", help="few and short runs, to see that it works")
    return parser.parse_args(argv).brief


def machine(*packages: str) -> str:
    """Return one line: processor, cores, versions of Python, mbdae, Pinocchio and further packages, date."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    found = [f"Python {platform.python_version()}"]
    for package in ("mbdae", "pin", "numpy", "scipy", *packages):
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"{package} not installed")
    return f"{names[0] if names else platform.machine()}, {cores} cores, {', '.join(found)}, {date.today()}"


def programs(
    ours: Callable[[float], R], tolerances: Sequence[float], steps: Sequence[float], **others: Callable[[float], R]
) -> dict[str, Callable[[], R]]:
    """Runs by name and setting: mbdae's by rtol, and those of other installed programs by step in s."""
    out: dict[str, Callable[[], R]] = {f"mbdae, rtol {rtol:.0e}": partial(ours, rtol) for rtol in tolerances}
    for h in steps:
        out |= {f"{name}, step {h:.0e} s": partial(run, h) for name, run in others.items() if find_spec(name)}
    return out


def medians(runs: Mapping[K, Callable[[], float]], repeats: int) -> dict[K, float]:
    """Median of the seconds that each run returns, interleaved so that a busy machine slows all runs equally."""
    seconds: dict[K, list[float]] = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            seconds[name].append(run())
    return {name: median(values) for name, values in seconds.items()}


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def digits(x: float | None, n: int = 3) -> str:
    """Return a number in at least n digits without an exponent, or a dash."""
    if x is None:
        return "-"
    return f"{x:.0f}" if x >= 10**n else f"{x:.{n}g}"


def ratio(a: float | None, b: float | None) -> str:
    """Return a / b in two digits, or a dash."""
    return digits(a / b, 2) if a and b else "-"


def microseconds(seconds: float | None) -> str:
    """Return microseconds in three digits, or a dash."""
    return digits(None if seconds is None else 1e6 * seconds)
