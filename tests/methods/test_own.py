"""User tableaus: as numbers, fractions and text, in files, in saved runs, and in studies."""

from fractions import Fraction

import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae import Tableau
from mbdae.errors import InputError, UnknownNameError
from mbdae.methods import METHODS, method
from mbdae.methods.custom_tableau import read_tableau

RALSTON = "name = 'ralston3'\nA = [[], ['1/2'], [0, 0.75]]\nb = ['2/9', '1/3', '4/9']\n"


@pytest.fixture
def ralston():
    return Tableau("ralston3", A=((), (Fraction(1, 2),), (0, 0.75)), b=("2/9", "1/3", "4/9"))


def test_all_ways_to_write_one_agree(ralston, tmp_path):
    (tmp_path / "mine.toml").write_text(RALSTON)
    text = Tableau("ralston3", A="0\n1/2\n0 3/4", b="2/9 1/3 4/9")
    for found in (text, read_tableau(tmp_path / "mine.toml")):
        for x, y in zip(vars(found.arrays).values(), vars(ralston.arrays).values(), strict=True):
            np.testing.assert_array_equal(x, y)
    found = method(ralston)
    assert (found.order, found.order_linear, found.order_own) == (2, 2, 1)


@pytest.mark.parametrize("name", ["herk3", "herk4", "pherk3", "pherk5", "arnold4", "rk4", "kutta3"])
def test_claims_that_are_left_out_are_proven(name):
    known = METHODS[name]
    found = method(Tableau("own", A=known.A, Ahat=known.Ahat, b=known.b))
    assert (found.order, found.order_linear, found.order_own) == (known.order, known.order_linear, known.order_own)


@pytest.mark.parametrize("back", ["native", "python"])
def test_a_run_with_it_is_saved_whole(ralston, back, tmp_path):
    if back == "native" and mbdae.backend.load() is None:
        pytest.skip("there is no core")
    mech = shared_model("four_bar")
    sol = mbdae.solve(mech, (0, 0.2), method=ralston, step=0.01, backend=back)
    again = mbdae.solve(mech, (0, 0.2), method="herk2", step=0.01, backend=back)
    assert np.abs(sol.y[-1] - again.y[-1]).max() > 1e-9
    sol.save(tmp_path / "run.npz")
    loaded = mbdae.Solution.load(tmp_path / "run.npz")
    assert "ralston3, h = 0.01 s" in str(mbdae.drift(loaded))
    assert loaded.settings["tableau"]["A"]
    assert mbdae.methods.method_from_settings(loaded.settings).arrays.A.tolist() == ralston.arrays.A.tolist()


@pytest.mark.usefixtures("forked_workers")
def test_studies_take_it(ralston, tmp_path):
    (tmp_path / "mine.toml").write_text(RALSTON)
    mech = shared_model("four_bar")
    study = mbdae.order(mech, [ralston])
    assert study.holds
    assert list(study.orders) == ["ralston3"]
    options = {"steps": [50, 100], "repeats": 0}
    one = mbdae.compare(mech, (0, 0.2), methods=[ralston, "herk2"], **options)
    two = mbdae.compare(mech, (0, 0.2), methods=[str(tmp_path / "mine.toml"), "herk2"], workers=2, **options)
    assert one.methods == ["ralston3", "herk2"]
    assert [p.errors["q"] for p in one.points] == pytest.approx([p.errors["q"] for p in two.points], rel=1e-9)
    one.plot(tmp_path / "a.svg")


def test_wrong_ones_are_rejected(tmp_path):
    with pytest.raises(InputError, match=r"tableau 'a', b: expected exact numbers.*got 'pi'"):
        Tableau("a", A=((),), b=("pi",))
    with pytest.raises(InputError, match="tableau 'a': its weights b must add up to 1"):
        method(Tableau("a", A=((),), b=("1/2",)))
    with pytest.raises(InputError, match="tableau 'a': A strictly lower"):
        Tableau("a", A=(("1",),), b=("1",))
    with pytest.raises(InputError, match="tableau 'a': its weights divided by the diagonal of Ahat overflow"):
        Tableau("a", A=((), ("5e-321",)), b=("0", "1"), b_embedded=("1",))
    with pytest.raises(InputError, match="a row has more than 1 entries"):
        Tableau("a", A=((),), b=("1/2", "1/2"))
    with pytest.raises(InputError, match="'rk4' is the name of a method of mbdae"):
        mbdae.solve(shared_model("pendulum"), (0, 1), method=Tableau("rk4", A=((),), b=("1",)))
    for text, words in (
        ("name = 1\nA = [[]]\nb = [1]", "a name is a text"),
        ("name = 'a'\nA = [[]]\nb = [1]\norder = -1", "'a': order is a whole number, not negative, got -1"),
        ("name = 'a'\nA = [[]]\nb = [1]\norder_own = true", "order_own is a whole number, not negative, got True"),
        ("name = 'x'\nA = [[]]", "needs b"),
        ("name = 'x'\nA = [[]]\nb = [1]\nc = [0]", "unknown key of .*mine.toml 'c'"),
        ("name =", "mine.toml: "),
        ("name = 'x'\nA = 3\nb = [1]", "mine.toml"),
    ):
        (tmp_path / "mine.toml").write_text(text)
        with pytest.raises(InputError, match=words):
            read_tableau(tmp_path / "mine.toml")
    deep = "(" * 300 + "1" + ")" * 300
    for number in ("1e400", "1e-400", "1e9999999999", "1/0", "9" * 5000, deep, "-" * 5000 + "1", "0x10", "1_0", "True"):
        (tmp_path / "mine.toml").write_text(f"name = 'x'\nA = [[]]\nb = ['{number}']\n")
        with pytest.raises(InputError, match=r"^tableau 'x', b: expected exact numbers.*, got '.*$"):
            read_tableau(tmp_path / "mine.toml")
    (tmp_path / "mine.toml").write_text('name = "a\\nb"\nA = [[]]\nb = ["1"]\n')
    with pytest.raises(InputError, match=r"^\S*mine.toml: a name is a text of one line"):
        read_tableau(tmp_path / "mine.toml")
    with pytest.raises(InputError, match="cannot read"):
        mbdae.order(shared_model("pendulum"), ["gone.toml"])
    with pytest.raises(UnknownNameError, match="unknown method"):
        mbdae.order(shared_model("pendulum"), ["gone"])
