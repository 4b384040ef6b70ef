"""The command line: exit codes, one-line errors, JSON, and files written in spite of a failure."""

import json
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from commands import call, keep_studies, sample_commands, without_layout, without_pictures

import mbdae
from mbdae.__main__ import cli
from mbdae.cli import interrupt
from mbdae.cli import output as console

PIN = 'title = "t"\n[[body]]\nname = "a"\nparent = "world"\nmass = 1.0\ncom = [0, 0, -1]\naxis = [0, 1, 0]\n'


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["solve", "nosuch"], 2, ["unknown model 'nosuch'", "four_bar", "slider_crank"]),
        (["solve", "four_bar", "-m", "herk9"], 2, ["unknown method 'herk9'", "pherk5"]),
        (["solve", "four_bar", "--step", "-1"], 2, ["step must be a positive number, got -1.0"]),
        (["solve", "four_bar", "--rtol", "0"], 2, ["rtol = 0.0 cannot be met"]),
        (["solve", "four_bar", "--rtol", "nan"], 2, ["rtol = nan"]),
        (["solve", "four_bar", "--until", "q.crunk = 1"], 2, ["unknown signal 'q.crunk' (did you mean 'q.crank'?)"]),
        (["solve", "four_bar", "-t", "-1"], 2, ["end time must be positive"]),
        (["solve", "four_bar", "-t", "1,x"], 2, ["expected an end in s, or start,end", "1,x"]),
        (["solve", "four_bar", "-t", "1,1"], 2, ["t_span must be finite and not empty"]),
        (["equilibria", "four_bar", "--drive", "crank", "--to", "1"], 2, ["both --from and --to"]),
        (["solve", "four_bar", "-o", "run.txt"], 2, ["run.txt", ".npz"]),
        (["solve", "four_bar", "-o", "nowhere/run.npz"], 2, ["nowhere", "no such folder"]),
        (["solve", "four_bar", "-o", "a.npz", "-o", "a.csv"], 2, ["'--output'", "one file, got a.npz, a.csv"]),
        (["order", "four_bar", "-m", "rk5"], 2, ["unknown method 'rk5'"]),
        (["order", "four_bar", "--steps", "4"], 2, ["at least 5", "steps = 4"]),
        (["drift", "missing.npz"], 2, ["no such file: missing.npz"]),
        (["animate", "missing.npz", "-o", "a.html"], 2, ["no such file: missing.npz"]),
        (["solve", "--nosuch"], 2, ["--nosuch"]),
        (["nosuch"], 2, ["nosuch"]),
    ],
)
def test_usage_errors_are_one_line(arguments, code, words, tmp_path):
    returned, out, err = call(*arguments, cwd=tmp_path)
    assert returned == code, (out, err)
    assert err.count("\n") == 1, err
    for word in words:
        assert word in err


@pytest.mark.slow
def test_the_program_is_a_program(tmp_path):
    command = [sys.executable, "-m", "mbdae", "drift", "four_bar", "-t", "0.1", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=300)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)
    done = subprocess.run([*command[:3], "solve", "nosuch"], capture_output=True, text=True, cwd=tmp_path, timeout=300)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("mbdae: unknown model 'nosuch'")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [
        (PIN + "[[closure]]\nkind = 'point'\nframes = ['a', 'b']\n", 2, ["unknown frame 'b'", "world, a"]),
        (PIN + "[start]\nq = { elbow = 1.0 }\n", 2, ["unknown joint 'elbow'", "valid: a"]),
        (PIN + "[[force]]\nkind = 'joint_damping'\njoint = 'x'\ndamping = 1.0\n", 2, ["unknown joint 'x'"]),
        (PIN + "[[closure]]\nkind = 'hinge'\nframes = ['a', 'world']\n", 2, ["kind", "revolute"]),
        (PIN + "gravty = [0, 0, 0]\n", 2, ["gravty"]),
        ("gravity = [0, 0]\n" + PIN, 2, ["gravity"]),
        (PIN + "[[closure]]\nname = 'far'\nkind = 'distance'\nlength = 5.0\nframes = ['tip', 'world']\n"
         "[[frame]]\nname = 'tip'\nparent = 'a'\nxyz = [0, 0, -1]\n", 1, ["'far' is violated by 4"]),
        ("title = [", 2, ["not TOML"]),
        ("title = 't'\n", 2, ["source", "body"]),
        ("source = 'gone.urdf'\n", 2, ["gone.urdf"]),
        ("[[body]]\nname = 'a'\n", 2, ["missing key body.a.parent"]),
    ],
)  # fmt: skip
def test_wrong_files_are_one_line(text, code, words, tmp_path):
    (tmp_path / "m.toml").write_text(text)
    returned, out, err = call("solve", "m.toml", "-t", "0.1", cwd=tmp_path)
    assert returned == code, (out, err)
    assert err.count("\n") == 1, err
    for word in words:
        assert word in err


def test_what_is_said_is_one_line(capsys):
    """Warnings and run messages may contain names from files; those of errors are cleaned by the errors."""
    mbdae.__main__._print_error("warning: 'a\nb', and\x1b[31m red")
    assert capsys.readouterr().err == "mbdae: warning: 'a b', and\\x1b[31m red\n"


EVERY = (
    "models",
    "methods",
    "methods --check herk3",
    "info four_bar",
    "solve four_bar -t 0.5 -o run.npz",
    "drift run.npz",
    "drift run.npz run.npz",
    "order hessenberg_a -m herk1 -t 0.2",
    "check-gradients pendulum -m herk2 -t 0.2 --steps 10",
    "compare pendulum -t 0.1 -m pherk5,herk3 --rtol 1e-3 --repeats 1",
    "report pendulum -t 0.2 -m ggl:herk3 --rtol 1e-4 --repeats 1 -o report.html",
    "animate run.npz -o run.html",
    "sweep sweep.toml",
)


@pytest.mark.slow
def test_every_command_in_a_pipe_is_plain_text_or_one_document(tmp_path, monkeypatch):
    every = [*EVERY, *sample_commands()]
    assert {arguments.split()[0] for arguments in every} == set(cli.commands)
    (tmp_path / "sweep.toml").write_text('model = "pendulum"\nend = 0.1\n[grid]\nsolve.rtol = [1e-3, 1e-6]\n')
    monkeypatch.setenv("FORCE_COLOR", "1")  # as on machines that run tests
    monkeypatch.setattr("mbdae.studies.statics.equilibria.POINTS", 61)
    for arguments in every:
        results = []
        for more in ([], ["--json"]):
            with monkeypatch.context() as patch:
                without_pictures(patch)
                keep_studies(patch, results, bool(more))
                if more:  # the same figures as before
                    without_layout(patch)
                    patch.setattr("matplotlib.figure.Figure.savefig", lambda _, path, **__: Path(path).touch())
                code, out, err = call(*shlex.split(arguments), *more, cwd=tmp_path)
            assert (code, err) == (0, ""), arguments
            if more:
                assert json.loads(out, parse_constant=pytest.fail), arguments
            else:
                assert not set(out) & set("\x1b\r\b"), arguments


def test_folders_of_files_that_are_not_asked_for_do_not_matter(monkeypatch, tmp_path):
    monkeypatch.setattr(console.os, "access", lambda folder, mode: folder == tmp_path.resolve())
    page = str(tmp_path / "run.html")
    assert console.writable((None, (".npz",)), (page, (".html",))) == [page]
    with pytest.raises(mbdae.errors.InputError, match=r"cannot write run\.npz: the folder is read-only"):
        console.writable(("run.npz", (".npz",)))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("drift run.npz -m herk3", "options of a run need a model"),
        ("drift run.npz --rtol 1e-3", "options of a run need a model"),
        ("drift four_bar --project --formulation ggl", "not both"),
    ],
)
def test_no_option_of_drift_is_passed_over(arguments, words):
    code, _, err = call(*arguments.split())
    assert code == 2
    assert words in err


def test_events_of_a_run(tmp_path):
    ends = ("--until", "q.crank > 4", "--until", "q.slider = 9")
    arguments = ("solve", "slider_crank", "-t", "2", "--event", "v.slider", *ends)
    code, out, err = call(*arguments, cwd=tmp_path)
    assert (code, err) == (0, "")
    data = json.loads(call(*arguments, "--json", cwd=tmp_path)[1])
    assert data["status"] == "event"
    assert data["events"]["q.crank > 4"] == [data["t"]]
    assert f"event: a terminal event occurred: q.crank > 4, t = {data['t']:.9g} s\n" in out
    assert "  q.crank > 4: " not in out
    assert "  q.slider = 9: never\n" in out
    assert f"  v.slider: t = {data['events']['v.slider'][0]:.9g}" in out


def test_drift_limit(tmp_path):
    assert call("drift", "four_bar", "-t", "1", "--max", "1e-3")[::2] == (0, "")
    data = json.loads(call("drift", "four_bar", "-t", "1", "--json")[1])
    largest = max(data["g_max"], data["Gv_max"], data["energy_relative"])
    code, _, err = call("drift", "four_bar", "-t", "1", "--max", "1e-20")
    assert (code, err) == (1, f"mbdae: |g|, |G v| or the relative energy error is {largest:.3g}, above 1e-20\n")


@pytest.mark.native
def test_info_reports_what_computes_the_inertia():
    assert "inertia   by the core's planar sweep through the tree" in call("info", "four_bar")[1]


def test_info_says_what_is_not_modelled():
    code, out, _ = call("info", "slider_crank")
    assert code == 0
    for word in ("contact", "joint limits", "degrees of freedom 1", "wrist pin", "3 dependent"):
        assert word in out


TELLING = """
import mbdae.__main__
from mbdae.integrate.run.run_state import RunState

to_go, told = RunState.time_left, []

def tell(run):
    if len(run.ts) > 10 and not told:
        told.append(print("under way", flush=True))
    return to_go(run)

RunState.time_left = tell
mbdae.__main__.main()
"""


@pytest.mark.slow
def test_a_stopped_run_is_written(tmp_path):
    arguments = ["solve", "four_bar", "-t", "100000", "-o", "run.npz", "--html", "run.html"]
    process = subprocess.Popen(
        [sys.executable, "-c", TELLING, *arguments], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stdout.readline() == b"under way\n"
    os.kill(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 1
    assert b"interrupted" in err
    sol = mbdae.Solution.load(tmp_path / "run.npz")
    assert sol.status == "interrupted"
    assert len(sol.t) > 10
    assert (tmp_path / "run.html").exists()


@pytest.mark.parametrize(
    ("module", "arguments"),
    [
        *((name, "info pendulum") for name in ("pinocchio", "scipy", "click")),
        ("matplotlib", "solve pendulum -t 0.1 --plot a.png"),
    ],
)
def test_ctrl_c_during_the_imports_is_one_line(module, arguments, tmp_path):
    (tmp_path / f"{module}.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    paths = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    command, environment = [sys.executable, "-m", "mbdae", *arguments.split()], os.environ | {"PYTHONPATH": paths}
    done = subprocess.run(command, env=environment, capture_output=True, timeout=60, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (130, b"", b"mbdae: stopped by the user\n")


def test_nothing_that_takes_time_comes_before_ctrl_c_is_caught():
    """Except for the modules that Python imports before mbdae."""
    program = """
import signal, sys
sys.orig_argv = ["python", "-m", "mbdae"]
class Finder:
    def find_spec(self, name, *_):
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            print(name)
sys.meta_path.insert(0, Finder())
sys.path.insert(0, sys.argv[1])
import mbdae
"""
    root = str(Path(mbdae.__file__).parent.parent)
    done = subprocess.run([sys.executable, "-I", "-S", "-c", program, root], capture_output=True, text=True, timeout=60)
    sought = done.stdout.split()
    assert sought[:3] == ["mbdae", "mbdae.cli", "mbdae.cli.interrupt"], done.stderr
    assert not {"typing", "pathlib", "functools", "importlib.metadata", "click", "mbdae.discovery"} & set(sought)


def test_ctrl_c_between_the_imports_can_be_caught():
    before = signal.signal(signal.SIGINT, interrupt._stop)
    try:
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_damaged_tableau_is_refuted(monkeypatch):
    from dataclasses import replace

    from mbdae import METHODS

    rows = [list(r) for r in METHODS["herk3"].A]
    rows[2][0], rows[2][1] = "-9/10", "19/10"  # the nodes are unchanged, the order is not
    monkeypatch.setitem(METHODS, "herk3", replace(METHODS["herk3"], A=tuple(tuple(r) for r in rows)))
    code, out, _ = call("order", "four_bar", "-m", "herk3")
    assert code == 1
    assert "misses" in out


def test_tables_on_narrow_screens_wrap_words_and_cut_no_name(monkeypatch, capsys):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "60")
    rows = [{"name": "x" * 30, "n": 123, "words": None}, {"name": "y", "n": None, "words": "word " * 20}]
    console.print_table(rows, False)
    out = capsys.readouterr().out
    assert "x" * 30 in out
    assert "123" in out
    assert out.count("word") == 21
