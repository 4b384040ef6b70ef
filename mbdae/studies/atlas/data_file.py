"""The data file of a benchmark: a JSON document on each line, appended as results are finished.

The first line describes what all results have in common; then a line for each motion of a model, and for each method on
a model. After a crash all finished lines are readable; an incomplete last line is removed. The same benchmark resumes
from the file, and a larger one computes only the missing results.
"""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...errors import InputError
from .method_runs import MethodRuns
from .model_motion import ModelMotion

ABOUT = "atlas"  # key of the first line
SUFFIX = ".jsonl"


class BenchmarkData:
    """Results of a benchmark, in memory and in a file.

    Args:
        path: path of the file; None to store no file.
        about: settings that all results have in common.
        fresh: replace an existing file, once the first result is finished.

    Attributes:
        motions: motions of the models, by name.
        runs: runs, by model and method.

    Raises:
        InputError: for the file of another benchmark, another file, or an unwritable one.
    """

    def __init__(self, path: Path | None, about: Mapping[str, Any], fresh: bool) -> None:
        if path and path.suffix != SUFFIX:
            raise InputError(f"the data of an atlas are stored in a {SUFFIX} file, got {str(path)!r}")
        self.path, self.about, self._replace_old = path, about, fresh
        self.motions: dict[str, ModelMotion] = {}
        self.runs: dict[tuple[str, str], MethodRuns] = {}
        if path and path.exists() and not fresh:
            self._read(path)

    def add(self, result: ModelMotion | MethodRuns) -> None:
        """Add a result, and append it to the file."""
        if isinstance(result, ModelMotion):
            if self.motions.get(result.model) == result:
                return
            self.motions[result.model] = result
        else:
            self.runs[result.model, result.method] = result
        if self.path:
            self._append(self.path, result.to_dict())

    def _append(self, path: Path, row: Mapping[str, Any]) -> None:
        """Append a line in one write, in a new file together with the line of the settings."""
        try:
            new = self._replace_old or not path.exists() or not path.stat().st_size
            flags = os.O_WRONLY | os.O_CREAT | (os.O_TRUNC if new else os.O_APPEND)
            lines = [{ABOUT: self.about}, row] if new else [row]
            content = b"".join(json.dumps(line).encode() + b"\n" for line in lines)
            handle = os.open(path, flags, 0o666)
            try:
                os.write(handle, content)
            finally:
                os.close(handle)
        except OSError as e:
            raise InputError(f"cannot write {path}, finished results are stored: {e.strerror}") from None
        self._replace_old = False

    def _read(self, path: Path) -> None:
        try:
            content = path.read_bytes()
            complete = content[: content.rfind(b"\n") + 1]
            first, *rows = [json.loads(line) for line in complete.splitlines()] or [{ABOUT: self.about}]
            self._require_same_benchmark(path, first[ABOUT])
            for row in rows:
                if "points" in row:
                    runs = MethodRuns.read(row)
                    self.runs[runs.model, runs.method] = runs
                else:
                    self.motions[row["model"]] = ModelMotion.read(row)
            if len(complete) < len(content):
                os.truncate(path, len(complete))
        except OSError as e:
            raise InputError(f"cannot read {path}: {e.strerror}") from None
        except (ValueError, KeyError, TypeError, AttributeError) as e:
            raise InputError(f"{path} is damaged or not the data of an atlas ({type(e).__name__}: {e})") from None

    def _require_same_benchmark(self, path: Path, stored: Mapping[str, Any]) -> None:
        """Refuse to mix results of two back ends, machines, versions or settings."""
        for name, value in self.about.items():
            if stored[name] != value:
                raise InputError(
                    f"{path} has an atlas of another {name}, {_text(stored[name])}, not {_text(value)}: "
                    "give another data file, or fresh"
                )


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)
