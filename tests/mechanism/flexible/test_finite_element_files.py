"""Bodies from files of CalculiX and Exudyn, and consistent mass matrices."""

from dataclasses import fields
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csr_array, csr_matrix, kron

import mbdae
from mbdae.errors import InputError

FOLDER = Path(__file__).parents[2] / "data" / "calculix"
HELD = 3021.661, 3021.661, 8614.786, 14655.02  # rad/s, by CalculiX with the nodes of LEFT fixed


def test_calculix_finds_the_same_frequencies():
    found = mbdae.read_finite_elements(FOLDER / "bar.inp")
    assert found.sets["ENDS"] == [0, 1, 2, 3, 8, 9, 10, 11]
    bar = {"interface": {"A": found.sets["LEFT"]}, "clamped": "A"}
    body = mbdae.modal_body(found.points, found.M, found.K, modes=8, **bar)
    np.testing.assert_allclose(body.frequencies[:4], HELD, rtol=5e-7)  # seven digits are printed
    assert body.mass == pytest.approx(7850 * 0.6 * 0.1**2, rel=1e-12)
    np.testing.assert_allclose(body.s0 / body.mass, [0.3, 0, 0], atol=1e-12)
    long, thick = body.mass * 0.6**2 / 3, body.mass * 0.1**2 / 12
    np.testing.assert_allclose(body.I0, np.diag([2 * thick, long + thick, long + thick]), atol=1e-12)


def test_a_file_of_exudyn_holds_the_same_body(tmp_path):
    fem = pytest.importorskip("exudyn.FEM").FEMinterface()
    found = mbdae.read_finite_elements(FOLDER / "bar.inp")
    fem.nodes["Position"] = found.points
    fem.massMatrix, fem.stiffnessMatrix = csr_matrix(found.M), csr_matrix(found.K)
    fem.nodeSets = [{"Name": "tip", "NodeNumbers": np.array([8, 9]), "NodeWeights": np.ones(2) / 2}]
    fem.SaveToFile(str(tmp_path / "bar.npz"))
    again = mbdae.read_finite_elements(tmp_path / "bar.npz")
    assert abs(again.M - found.M).max() == 0
    assert abs(again.K - found.K).max() == 0
    np.testing.assert_array_equal(again.points, found.points)
    assert again.sets == {"tip": [8, 9]}


def test_a_mass_matrix_is_that_of_interpolated_points():
    """Points g with masses w_g at sum_i N_gi r_i are a body with the masses m_ij = sum_g w_g N_gi N_gj."""
    rng = np.random.default_rng(5)
    N, w = rng.dirichlet(np.ones(6), 20), rng.uniform(1, 2, 20)
    r, Phi, Phi2 = rng.normal(size=(6, 3)), rng.normal(size=(6, 3, 2)), rng.normal(size=(6, 3, 2, 2))
    Phi2 = Phi2 + Phi2.swapaxes(2, 3)
    at_points = [np.einsum("gi,i...->g...", N, x) for x in (r, Phi, Phi2)]
    m = (N.T * w) @ N
    reference = mbdae.ModalBody.of_points(at_points[0], w, at_points[1], np.ones(2), Phi2=at_points[2])
    for masses in (m, csr_array(m)):
        body = mbdae.ModalBody.of_points(r, masses, Phi, np.ones(2), Phi2=Phi2)
        for x in fields(body):
            if x.name not in ("nodes", "outline"):
                np.testing.assert_allclose(getattr(body, x.name), getattr(reference, x.name), rtol=1e-12, atol=1e-12)


def test_masses_by_points_or_by_displacements_are_the_same_body():
    found = mbdae.read_finite_elements(FOLDER / "bar.inp")
    m = found.M[::3, ::3]
    assert abs(kron(m, np.eye(3)) - found.M).max() < 1e-12
    options = {"interface": {"A": found.sets["LEFT"], "B": found.sets["RIGHT"]}, "modes": 3}
    a, b = (mbdae.modal_body(found.points, x, found.K, **options) for x in (m, found.M.toarray()))
    np.testing.assert_allclose(a.frequencies, b.frequencies, rtol=1e-9)
    squares = eigh(found.K.toarray(), found.M.toarray(), eigvals_only=True)
    assert a.frequencies[0] > 0.999 * np.sqrt(squares[6])  # rigid ends: not below those of the whole body
    coupled = found.M.tolil()
    coupled[0, 1] = coupled[1, 0] = 0.1
    for masses, words in (
        (coupled, "is not the same in x, y and z, or couples them"),
        (np.triu(m.toarray()), "is not symm"),
    ):
        with pytest.raises(InputError, match=f"modal_body: the mass matrix {words}"):
            mbdae.modal_body(found.points, masses, found.K, **options)


def test_decks_may_be_written_in_other_ways(tmp_path):
    """Included files, solids over several lines, commas at ends, nodes of elements, comments in any code, any case."""
    folder, known = copytree(FOLDER, tmp_path / "bar"), mbdae.read_finite_elements(FOLDER / "bar.inp")
    text = (folder / "bar.inp").read_text()
    start, end = text.index("*NODE"), text.index("*MATERIAL")
    mesh = text[start:end].replace("*NODE, NSET", "*Node, NSET").replace("NSET=LEFT", "NSET=LEFT,")
    mesh = mesh.replace("2, 5, 9, 11, 7,", "2, 5, 9, 11, 7,\n")
    mesh += "*ELSET, ELSET=END\n2,\n*NSET, NSET=SECOND, ELSET=END\n*NSET, NSET=ODD, GENERATE\n1, 5, 2\n12,\n"
    (folder / "mesh.inp").write_bytes("** f\u00fcr\n".encode("latin-1") + mesh.encode())
    (folder / "bar.inp").unlink()
    (folder / "bar.INP").write_text(text[:start] + '*include, Input="mesh.inp"\n' + text[end:])
    found = mbdae.read_finite_elements(folder / "bar.INP")
    np.testing.assert_array_equal(found.points, known.points)
    assert found.sets == known.sets | {"SECOND": [4, 8, 10, 6, 5, 9, 11, 7], "ODD": [0, 2, 4, 11]}


def _without_rows(text):
    return text[: len(text) // 3].rpartition("\n")[0]


@pytest.mark.parametrize(
    ("suffix", "change", "message"),
    [
        ("inp", lambda x: "*INCLUDE, INPUT=bar.inp\n" + x, "bar.inp includes itself$"),
        ("inp", lambda x: "*INCLUDE, INPUT=none.inp\n" + x, "none.inp: No such file"),
        ("inp", lambda x: x + "*NSET, NSET=X\nNONE\n", "unknown set of bar.inp: .NSET 'NONE'; valid: ALL, LEFT"),
        ("inp", lambda x: x + "*NSET, NSET=X, ELSET=NONE\n", "unknown set of elements 'NONE'; valid: BRICKS"),
        ("inp", lambda x: x + "*NSET\n1\n", "bar.inp: .NSET needs a name, NSET = .."),
        (
            "inp",
            lambda x: x + "*NSET, NSET=X, GENERATE\n1, 5, 0\n",
            "bar.inp: .NSET needs numbers from 1, got '1, 5, 0'",
        ),
        ("inp", lambda x: x.replace("-0.05", "nan", 1), "bar.inp: .NODE needs finite positions, got '1, 0, NAN"),
        ("inp", lambda x: "\0" * 99, "bar.dof has displacements of nodes that bar.inp does not have: CalculiX"),
        ("dof", lambda x: x + "1.1\n", "bar.dof has displacements of nodes that bar.inp does not have: CalculiX"),
        ("dof", lambda x: "", "bar.dof is empty$"),
        ("sti", lambda x: x + "0 0 1.0\n", "bar.sti has rows and columns other than 1 to 36, as bar.dof$"),
        ("sti", lambda x: x + "1 99 1.0\n", "bar.sti has rows and columns other than 1 to 36, as bar.dof$"),
        ("sti", lambda x: x + "1 1 nan\n", "bar.sti needs rows of three finite numbers: row, column, value$"),
        ("sti", _without_rows, "bar.sti is incomplete: .* of 36 diagonal entries are missing"),
        ("mas", lambda x: "", "bar.mas is incomplete: 36 of 36 diagonal entries are missing"),
        ("mas", lambda x: "\x1b" * 9999, r"^.{,200}$"),
    ],
)
def test_bad_jobs_are_rejected_in_one_line(tmp_path, suffix, change, message):
    file = copytree(FOLDER, tmp_path / "bar") / f"bar.{suffix}"
    file.write_text(change(file.read_text()))
    with pytest.raises(InputError, match=message) as error:
        mbdae.read_finite_elements(tmp_path / "bar" / "bar.inp")
    assert str(error.value).isprintable()


def test_bad_files_are_rejected_in_one_line(tmp_path):
    folder = copytree(FOLDER, tmp_path / "bar")
    with pytest.raises(InputError, match="finite elements: the path of a file, got None"):
        mbdae.read_finite_elements(None)
    cases = {
        "bar.txt": r"bar.txt: valid files end with .inp, .npz",
        "none.inp": "none.inp: No such file",
        "none.npz": "none.npz: No such file",
    }
    for name, words in cases.items():
        with pytest.raises(InputError, match=words):
            mbdae.read_finite_elements(folder / name)
    rows = (folder / "bar.dof").read_text().split()
    (folder / "bar.dof").write_text("\n".join(rows[1:]))
    with pytest.raises(InputError, match=r"bar.dof: 1 displacements are fixed; store a free body"):
        mbdae.read_finite_elements(folder / "bar.inp")
    (folder / "bar.sti").unlink()
    (folder / "bar.dof").write_text("\n".join(rows))
    with pytest.raises(InputError, match=r"bar\.sti"):
        mbdae.read_finite_elements(folder / "bar.inp")
    np.savez(folder / "bar.npz", nodes=np.array({"Position": print}, object))
    with pytest.raises(InputError, match=r"builtins.print does not hold numbers|incomplete"):
        mbdae.read_finite_elements(folder / "bar.npz")
