"""Fuzzing: mutated files of every format that mbdae reads, loaded in separate processes.

    python tests/fuzzing.py --count 3000

A mutant may be read, or rejected by an `mbdae.errors.MbdaeError` of one line; it must not end the process, print a
traceback, take longer than ``TIMEOUT``, or use more memory than ``MEMORY``.
"""

import argparse
import json
import os
import random
import resource
import select
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from contextlib import closing
from pathlib import Path

import numpy as np
from fuzz_seeds import (
    CUBE,
    DAE,
    MATERIAL,
    PARAMETRIC,
    REPLICATED,
    SHOWN,
    STL,
    SWEEPS,
    TABLE,
    TABLEAU,
    mutated_bytes,
    mutated_text,
    write_mutated_run,
)

DATA = Path(__file__).parent / "data"
TIMEOUT = 20.0  # s without an answer
MEMORY = 1e9  # bytes, the peak of a process
ADDRESSES = 16 * 2**30  # bytes of address space, so that an error here does not stop the machine


def models_of_runs(folder):
    """Save runs of mechanisms from different file formats; return their paths."""
    sys.path.insert(0, str(Path(__file__).parent))
    from chains import JOINTS, tree

    import mbdae

    kinds = sorted(JOINTS)
    mechanisms = [
        mbdae.Mechanism(tree(kinds, list(range(len(kinds))))),
        mbdae.load("four_bar"),
        mbdae.load(DATA / "robot"),
        mbdae.load(DATA / "mjcf" / "trees.xml"),
        mbdae.load(DATA / "linkage.sdf"),
    ]
    paths = []
    for i, mech in enumerate(mechanisms):
        paths.append(folder / f"run{i}.npz")
        mbdae.solve(mech, (0, 1e-3), method="herk2", step=5e-4).save(paths[-1])
    return paths


class Mutants:
    """Generator of mutants in a folder, one after another; a seed determines the file."""

    KINDS = (
        "urdf", "mjcf", "replicated", "sdf", "toml", "parameters", "yaml", "sweep", "tableau", "table", "obj", "mtl",
        "stl", "dae", "saved",
    )  # fmt: skip

    def __init__(self, folder):
        self.folder = folder
        self.runs = []
        self.inside = folder / "model"
        self.inside.mkdir()
        shutil.copy(DATA / "mjcf" / "materials.xml", self.inside)

    def make(self, kind, seed):
        """Write a mutant; return its path, with parameters."""
        rng, folder = random.Random(f"{kind} {seed}"), self.inside
        match kind:
            case "urdf":
                return self._text("x.urdf", (DATA / "robot" / "robot.urdf").read_text(), rng)
            case "sdf":
                name = rng.choice(["all_sorts", "linkage"])
                return self._text("x.sdf", (DATA / f"{name}.sdf").read_text(), rng)
            case "mjcf":
                name = rng.choice(["trees", "loops", "actuated"])
                return self._text("x.xml", (DATA / "mjcf" / f"{name}.xml").read_text(), rng)
            case "replicated":
                return self._text("x.xml", REPLICATED, rng)
            case "toml":
                from mbdae.mechanism.formats.model_library import models_directory

                source = rng.choice(sorted(models_directory().glob("*/mechanism.toml")))
                for file in source.parent.glob("*.urdf"):
                    shutil.copy(file, folder)
                return self._text("x.toml", source.read_text(), rng)
            case "parameters":
                (folder / "tower.py").write_text(PARAMETRIC)
                return str(folder / "tower.py") + "?" + mutated_text("floors=2&height=0.5", rng)
            case "yaml":
                shutil.copy(DATA / "robot" / "robot.urdf", folder)
                return self._text("robot.yaml", (DATA / "robot" / "robot.yaml").read_text(), rng)
            case "sweep":
                return self._text("sweep.toml", rng.choice(SWEEPS), rng)
            case "tableau":
                return self._text("tableau.toml", TABLEAU, rng)
            case "table":
                return self._text("table.csv", TABLE, rng)
            case "obj" | "mtl" | "stl" | "dae":
                return self._mesh(kind, rng)
            case "saved":
                self.runs = self.runs or models_of_runs(self.folder)
                write_mutated_run(folder / "x.npz", rng, self.runs)
                return str(folder / "x.npz")
        raise ValueError(kind)

    def _text(self, name, text, rng):
        (self.inside / name).write_text(mutated_text(text, rng), encoding="utf-8")
        return str(self.inside / name)

    def _mesh(self, kind, rng):
        folder, files = self.inside, {"box.obj": CUBE, "box.mtl": MATERIAL, "box.stl": STL, "box.dae": DAE}
        for name, text in files.items():
            (folder / name).write_text(text)
        name = f"box.{kind}"
        if kind == "stl" and rng.random() < 0.6:
            triangle = np.array([0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0], "<f4").tobytes() + b"\0\0"
            (folder / name).write_bytes(mutated_bytes(b"\0" * 80 + (1).to_bytes(4, "little") + triangle, rng))
        else:
            (folder / name).write_text(mutated_text(files[name], rng), encoding="utf-8")
        (folder / "shown.urdf").write_text(SHOWN.replace("NAME", "box.obj" if kind == "mtl" else name))
        return str(folder / "shown.urdf")


class ProgressReported(Exception):
    """A sweep reported progress, so that it need not be finished."""


def attempt(kind, path):
    """Use a file as the commands do; return the outcome as a word."""
    import mbdae
    from mbdae.methods import method
    from mbdae.studies.info.info import info
    from mbdae.studies.sweep.sweep import sweep
    from mbdae.studies.sweep.toml_file import read_sweep
    from mbdae.tabular import read_csv

    def report(*_):
        raise ProgressReported

    if kind == "sweep":
        arguments = {"max_steps": 2000, **read_sweep(path)}  # a run of an hour is no error
        return "read" if sweep(**arguments, progress=report) else "nothing"
    if kind == "tableau":
        tableau_method = method(str(path))
        return mbdae.solve(mbdae.load("four_bar"), (0.0, 0.02), method=tableau_method, step=0.01).status
    if kind == "table":
        return "read" if read_csv(path).values else "nothing"
    if kind == "saved":
        sol = mbdae.Solution.load(path)
        mech = sol.mechanism
        repr(sol), sol.signals(), sol((sol.t[0] + sol.t[-1]) / 2)
    else:
        mech = mbdae.load(path)
        sol = mbdae.solve(mech, (0.0, 1e-4), method="herk2", step=5e-5)
        assert np.isfinite(sol.q).all()
    str(info(mech))
    mbdae.animate(sol, Path(path.partition("?")[0]).with_name("page.html"))
    return sol.status


def child():
    """Print a line for each kind and path on the standard input: a status, or the failure."""
    from mbdae.errors import MbdaeError

    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    answers = sys.stdout
    sys.stdout = sys.stderr
    for line in sys.stdin:
        kind, path = json.loads(line)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                answer = attempt(kind, path)
        except ProgressReported:
            answer = "busy"
        except MbdaeError as e:
            message = str(e)
            answer = type(e).__name__ if len(message.splitlines()) == 1 and message.isprintable() else f"! {message!r}"
        except BaseException as e:
            import traceback

            where = "; ".join(f"{f.name} {f.lineno}" for f in traceback.extract_tb(e.__traceback__)[-3:])
            answer = f"! {type(e).__name__}: {e} ({where})"
        peak = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # of all files so far
        print(json.dumps(answer if peak <= MEMORY else f"! {peak / 1e6:.0f} MB"), file=answers, flush=True)


class Child:
    """A child process that loads files, restarted when it ends."""

    def __init__(self):
        self.process = None

    def ask(self, kind, path):
        """Return the outcome for a file; failures begin with ``!``."""
        if self.process is None or self.process.poll() is not None:
            paths = [str(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])]
            self.process = subprocess.Popen(
                [sys.executable, __file__, "--child"], env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)},
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            )  # fmt: skip
            self.process.stdin.write(json.dumps(["warm up", ""]) + "\n")
            self.process.stdin.flush()
            self._answer(60)
        self.process.stdin.write(json.dumps([kind, path]) + "\n")
        self.process.stdin.flush()
        answer = self._answer(TIMEOUT)
        if answer.endswith("MB"):
            self.close()
        return answer

    def _answer(self, timeout):
        ready, _, _ = select.select([self.process.stdout], [], [], timeout)
        line = self.process.stdout.readline() if ready else ""
        if line:
            return json.loads(line)
        if ready:
            return f"! the process ended with {self.process.wait()}"
        self.close()
        return f"! no answer in {timeout:g} s"

    def close(self):
        """End the process."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process.stdin.close()
            self.process.stdout.close()
            self.process = None


def try_mutants(worker, kinds, count, first=0, keep=None):
    """Try ``count`` mutants of each kind in a child; return the failures, and the count of each answer."""
    failures, answers = [], {}
    with tempfile.TemporaryDirectory() as folder:
        mutants = Mutants(Path(folder))
        for kind in kinds:
            for seed in range(first, first + count):
                path = mutants.make(kind, seed)
                answer = worker.ask(kind, path)
                answers[kind, answer[:40]] = answers.get((kind, answer[:40]), 0) + 1
                if answer.startswith("!"):
                    failures.append(f"{kind} {seed}: {answer}")
                    if keep:
                        shutil.copytree(mutants.inside, keep / f"{kind}_{seed}", dirs_exist_ok=True)
                        print(failures[-1], flush=True)
    return failures, answers


def main():
    """Try many mutants, and report the failures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=3000, help="of all kinds together")
    parser.add_argument("--kinds", nargs="*", default=Mutants.KINDS)
    parser.add_argument("--first", type=int, default=0, help="seed of the first mutant of each kind")
    parser.add_argument("--keep", type=Path, default=Path("mutants"), help="folder for mutants that failed")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child:
        child()
        return
    started = time.perf_counter()
    with closing(Child()) as worker:
        failures, answers = try_mutants(worker, args.kinds, -(-args.count // len(args.kinds)), args.first, args.keep)
    for (kind, answer), n in sorted(answers.items()):
        print(f"{n:6d} {kind:10s} {answer}")
    print(f"{len(failures)} failed, {time.perf_counter() - started:.0f} s")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
