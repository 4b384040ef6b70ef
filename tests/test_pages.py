"""The pages of documentation: their code runs, gives the documented output, and their tables agree with the code.

A page is one session, from top to bottom and in a separate folder: Python blocks share their names; a block that begins
with the name of a file in a comment is written there; lines of ``sh`` blocks that call mbdae are run, and end with code
0 or with the one of their comment ``# exit N``. A ``text`` block after one of these is its whole output, with "..." for
anything and 1.23e-14 for any number in this format; only there may a block end in an error or warn.
"""

import json
import re
import shlex
import sys
import warnings
from contextlib import redirect_stderr, redirect_stdout
from doctest import ELLIPSIS, OutputChecker
from functools import cache
from io import StringIO
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import closure_kinds
import key_tables
import numpy as np
import pytest

import mbdae
from mbdae import backend
from mbdae.__main__ import cli, main
from mbdae.errors import InputError
from mbdae.mechanism.closures import kinds_in_files
from mbdae.mechanism.forces import FORCES
from mbdae.mechanism.formats.model_library import MECHANISM, PARAMETRIC, SOURCES
from mbdae.mechanism.time_functions.time_functions import Harmonic

ROOT = Path(__file__).parent.parent
FOLDERS = (".github", "examples", "mbdae", "models")
PAGES = ["README.md", *(str(p.relative_to(ROOT)) for f in FOLDERS for p in sorted((ROOT / f).rglob("*.md")))]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.S | re.M)
FILE = re.compile(r"(?:#|<!--) (\S+\.(?:toml|py|urdf|xml))( -->)?\n")
TEXT = {page: (ROOT / page).read_text() for page in PAGES}
BRIEF = {  # options of commands whose output is not shown: they end by themselves, and take no times of whole runs
    "live": ("--seconds", "0.5"), "compare": ("--repeats", "0"), "compare four_bar": ("-t", "0.02"),
    "solve four_bar -t 10 ": ("-t", "1"),
    "periodic woodpecker": ("--help",),  # test_woodpecker_cycle runs it
    "periodic-branch simplest_walker": ("--rtol", "1e-8"),
    "order hessenberg_a": ("-t", "0.2"),
}  # fmt: skip
COARSE = {  # resolution of studies
    "replay.replay.MIN_FRAMES": 5, "replay.replay.MAX_FRAMES": 9, "replay.plot_panels.POINTS": 50,
    "replay.html_page.COMPRESSION_LEVEL": 0, "statics.equilibria.POINTS": 61,
}  # fmt: skip
OUTSIDE = ("python3", "pip", ".", "pytest", "python")  # commands of sh blocks that are not run here


class Block(NamedTuple):
    """A block of code, and the output after it."""

    language: str
    code: str
    shows: str | None


def blocks(page: str) -> list[Block]:
    found = pairwise([*BLOCK.findall(TEXT[page]), ("", "")])
    return [
        Block(language, code, after[1] if after[0] == "text" else None)
        for (language, code), after in found
        if language != "text"
    ]


def commands(code: str) -> list[tuple[list[str], int]]:
    """Words and exit code of the last command of each line."""
    lines = [line.partition(" #") for line in code.splitlines()]
    codes = [re.fullmatch(r" exit (\d)", comment) for _, _, comment in lines]
    return [
        (shlex.split(line.split("&&")[-1]), int(c[1]) if c else 0) for (line, _, _), c in zip(lines, codes, strict=True)
    ]


def run_block(block: Block, names: dict, monkeypatch) -> None:
    if file := FILE.match(block.code):
        Path(file[1]).write_text(block.code)
    elif block.language == "python":
        try:
            exec(compile(block.code, "page", "exec"), names)
        except mbdae.MbdaeError as e:
            if block.shows is None:
                raise
            print(f"{type(e).__module__}.{type(e).__name__}: {e}")
    elif block.language == "sh":
        for words, code in commands(block.code):
            if words[0] != "mbdae":
                assert words[0] in OUTSIDE, words
                assert all((ROOT / w).is_file() for w in words if w.endswith(".py")), words
                continue
            more = (x for begin, options in BRIEF.items() if " ".join(words[1:]).startswith(begin) for x in options)
            monkeypatch.setattr(sys, "argv", [*words, *more])
            with pytest.raises(SystemExit) as ended:
                main()
            assert ended.value.code == code, words
    else:
        assert block.language not in ("toml", "xml"), f"a block without the name of its file: {block.code}"


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)])
def test_blocks(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for constant, value in COARSE.items():
        monkeypatch.setattr(f"mbdae.studies.{constant}", value)
    names: dict = {"__name__": "page"}
    files = [file[1] for block in blocks(page) if (file := FILE.match(block.code))]
    assert all(sum(block.code.count(file) for block in blocks(page)) > 1 for file in files), "a file that nothing reads"
    for block in blocks(page):
        said = StringIO()
        with redirect_stdout(said), redirect_stderr(said), warnings.catch_warnings():
            warnings.simplefilter("error" if block.shows is None else "always")
            run_block(block, names, monkeypatch)
        if block.shows is not None:
            shown, printed = (re.sub(r"\d\.\d+e-\d\d", "#", x) for x in (block.shows, said.getvalue()))
            assert OutputChecker().check_output(shown, printed, ELLIPSIS), said.getvalue()


def test_commands_within_sentences_are_complete():
    for page in PAGES:
        for command in re.findall(r"`(mbdae [^`-]+ -[^`]+)`", TEXT[page].replace("\n", " ")):
            name, *words = shlex.split(command)[1:]
            if "--help" not in words:
                cli.commands[name].make_context(name, words)


# -- links ---------------------------------------------------------------------------------------------------------


@cache
def anchors(page: Path) -> set[str]:
    """The anchors that GitHub makes of headings: lower case, hyphens for spaces, without punctuation."""
    headings = re.findall(r"^#+ (.*)$", BLOCK.sub("", page.read_text()), re.M)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}


def links(page: str) -> list[tuple[Path, str]]:
    """Files and anchors that a page links to."""
    found = [x for x in re.findall(r"\]\(([^)\s]+)\)", BLOCK.sub("", TEXT[page])) if "://" not in x]
    at = (x.partition("#") for x in found)
    return [((ROOT / page).parent / path if path else ROOT / page, anchor) for path, _, anchor in at]


def test_links_lead_somewhere():
    for page in PAGES:
        for path, anchor in links(page):
            assert path.exists(), f"{page} links to {path}"
            assert not anchor or anchor in anchors(path), f"{page}: {path} has no heading {anchor}"


def test_paths_named_exist():
    for page in PAGES:
        for path in re.findall(r"\b(?:examples|models|tests)/[\w/]+\.\w+", TEXT[page]):
            assert (ROOT / path).exists(), f"{page} names {path}"


def test_every_page_and_picture_is_linked():
    linked = {path.resolve() for page in PAGES for path, _ in links(page)}
    pages = {ROOT / page for page in PAGES} - {ROOT / "README.md", *(ROOT / ".github").rglob("*")}
    assert {*pages, *(ROOT / "examples" / "pictures").iterdir()} <= linked


@pytest.mark.parametrize("folder", ["examples", "examples/benchmarks"])
def test_every_script_is_linked_from_the_page_of_its_folder(folder):
    linked = {path.resolve() for path, _ in links(f"{folder}/README.md")}
    assert {*(ROOT / folder).glob("*.py"), *(ROOT / folder).glob("notebooks/*.ipynb")} <= linked


# -- tables --------------------------------------------------------------------------------------------------------


def table(page: str, header: str) -> dict[str, list[str]]:
    body = TEXT[page].split(f"| {header} |")[1].split("\n\n")[0].splitlines()[2:]
    rows = [[cell.strip().strip("`") for cell in line.strip("|").split("|")] for line in body]
    return {re.sub(r"\[`(\w+)`\].*", r"\1", row[0]): row[1:] for row in rows}


def test_methods_table():
    assert table("examples/guide/methods.md", "method") == {
        n: [str(m.order), m.title] for n, m in mbdae.METHODS.items()
    }


def test_models_table():
    """`python tests/key_tables.py` writes those that `mbdae models` lists."""
    listed = key_tables.MODELS_FILE.read_text()
    assert listed == key_tables.models()
    assert table("models/README.md", "model") == {model["name"]: [model["title"]] for model in json.loads(listed)}


def test_closures_table():
    found = table("models/README.md", "closure")
    assert list(found) == list(kinds_in_files())
    for kind, (rows, needs, _, what) in found.items():
        closure = closure_kinds.KINDS[kind].closure
        assert int(rows) == closure.m
        assert what in mbdae.Closure.__doc__, f"page and docstring say different things of {kind}"
        for key in re.findall(r"\w+", needs):
            with pytest.raises(InputError, match=f"missing key {key}"):
                mbdae.Closure(**closure.model_dump(exclude={key}, exclude_none=True))


def test_files_table():
    read = [suffix.strip(" `") for row in table("models/README.md", "file") for suffix in row.split(",")]
    assert sorted(read) == sorted([MECHANISM, PARAMETRIC, *SOURCES])


def test_forces_table():
    assert sorted(table("models/README.md", "force")) == sorted(f.model_fields["kind"].default for f in FORCES)


def test_key_tables():
    """`python tests/key_tables.py` writes them; the message of this test shows them."""
    for part in key_tables.PARTS.values():
        assert part() in TEXT["models/README.md"], part()


def test_key_tables_have_each_key_once_with_a_whole_description():
    for table in key_tables.keys().split("\n\n| key |")[1:]:
        rows = [row.split(" | ") for row in table.splitlines() if row.startswith("| `")]
        names = [row[0] for row in rows]
        assert len(names) == len(set(names)), names
        assert not [row for row in rows if row[-1].removesuffix(" |").rstrip().endswith((",", ":", ";"))]


def test_formulas_of_functions_of_time_are_on_the_page():
    """Sine or cosine: a harmonic motion at three instants by the formula of the page."""
    formula = re.search(r'\*\*`kind = "harmonic"`\*\*: (.*)', TEXT["models/README.md"])[1].replace(" sin", "*sin")
    values = {"amplitude": 2.0, "omega": 3.0, "phase": 0.4, "offset": 0.7}
    for t in (0.0, 0.3, 1.1):
        value = eval(formula.replace("omega t", "omega*t"), {"sin": np.sin, "t": t, **values})
        assert abs(Harmonic(**values).at(t) - value) < 1e-15


# -- what pages tell and no block shows -----------------------------------------------------------------------------


def test_the_commands_of_installation_are_in_the_readme():
    activate = "python3 -m venv .venv && . .venv/bin/activate && pip install "
    install, test = (code for language, code, _ in blocks("README.md")[:2])
    assert install == f"{activate}. && mbdae solve slider_crank -t 5 -o run.npz --html run.html\n"
    command = "pytest -W error -n 2 --dist worksteal -m"
    assert test == f'{activate}".[test]" && {command} "not slow"\n'
    ran = (ROOT / ".ci" / "run").read_text().splitlines()
    assert f'{command} "not slow"' in ran
    assert f"{command} slow" in ran


def test_reactions_along_the_axes_of_the_world():
    """`Reaction.force` is along the axes of the first frame."""
    texts = [*TEXT.values(), *(p.read_text() for p in (ROOT / "examples").rglob("*.py"))]
    found = [line for text in texts for line in text.splitlines() if "reaction(" in line and "world's axes" in line]
    assert len(found) == 3
    assert all("force_world" in line for line in found)


def test_the_mechanism_with_parameters_moves(tmp_path):
    code = next(b.code for b in blocks("models/README.md") if b.code.startswith("# tower.py"))
    (tmp_path / "tower.py").write_text(code)
    sol = mbdae.solve(mbdae.load(tmp_path / "tower.py", floors=3), (0, 1))
    assert np.abs(np.diff(sol.q[[0, -1]], axis=0)).max() > 0.1


def test_what_is_said_without_the_core(monkeypatch):
    reported = TEXT["examples/guide/messages.md"].split("## mbdae computes in Python\n\n")[1].splitlines()[0]
    reason = "python: not built for this Python; " + reported.split("; ")[-1]
    monkeypatch.setattr(backend, "_core", lambda: (None, reason))
    with pytest.warns(UserWarning, match=backend.SLOW_WARNING) as found:
        backend._warn.__wrapped__()
    assert reported == f"    mbdae: warning: {found[0].message}"
    assert reported.split("; ", 1)[1].removeprefix("python: ") == backend._not_built(ROOT / "nowhere")
