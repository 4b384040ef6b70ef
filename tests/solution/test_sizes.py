"""Untrusted saved runs: sizes are read before arrays, and nothing is unpacked that a run does not contain."""

import json
import tracemalloc
import zipfile

import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae.errors import InputError

SMALL = 60e6  # bytes, a small fraction of the unpacked size of each file


@pytest.fixture(scope="module")
def arrays(tmp_path_factory):
    path = tmp_path_factory.mktemp("sizes") / "run.npz"
    mbdae.solve(shared_model("four_bar"), (0, 0.1), events=["t = 0.05"]).save(path)
    with np.load(path) as file:
        return dict(file)


def rejected(path, words):
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=words):
            mbdae.Solution.load(path)
        assert tracemalloc.get_traced_memory()[1] < SMALL
    finally:
        tracemalloc.stop()


def zeros(path, arrays, **more):
    """A file with further or other arrays of zeros, never complete in memory."""
    np.savez_compressed(path, **{name: x for name, x in arrays.items() if name not in more})
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as file:
        for name, shape in more.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as stream:
                head = {"descr": "<f8", "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(stream, head)
                left, block = 8 * int(np.prod(shape)), bytes(2**20)
                while left > 0:
                    left -= stream.write(block[: min(left, len(block))])
    return path


def unannounced(arrays):
    """Without the declared sizes of a file, as in older versions."""
    meta = {key: x for key, x in json.loads(str(arrays["meta"])).items() if key != "arrays"}
    return {**arrays, "meta": np.array(json.dumps(meta))}


MANY = 10_000_000


def test_an_unknown_array_is_rejected(arrays, tmp_path):
    rejected(zeros(tmp_path / "a.npz", unannounced(arrays), more=(MANY,)), "unknown array 'more'")


def test_arrays_that_do_not_fit_each_other_are_not_read(arrays, tmp_path):
    rejected(zeros(tmp_path / "a.npz", unannounced(arrays), y=(MANY, 1)), r"arrays have shapes .*\(10000000, 1\)")


def test_more_than_is_announced_is_not_read(arrays, tmp_path):
    width, ng = arrays["y"].shape[1], arrays["z_own"].shape[1]
    wrong = zeros(tmp_path / "a.npz", arrays, t=(MANY // 20,), y=(MANY // 20, width), z_own=(MANY // 20, ng))
    rejected(wrong, "its arrays do not have the shapes in its metadata")


@pytest.mark.slow
def test_what_unfolds_to_hundreds_of_times_its_size_is_not_read(arrays, tmp_path):
    width, n = arrays["y"].shape[1], 4 * MANY // arrays["y"].shape[1]
    more = {"t": (n,), "y": (n, width), "z_own": (n, arrays["z_own"].shape[1])}
    rejected(zeros(tmp_path / "a.npz", unannounced(arrays), **more), r"MB unpack to \d+ MB, too much for a run")


def test_a_long_text_is_not_read(arrays, tmp_path):
    np.savez(tmp_path / "a.npz", **{k: x for k, x in arrays.items() if k != "meta"})
    with zipfile.ZipFile(tmp_path / "a.npz", "a", zipfile.ZIP_DEFLATED) as file, file.open("meta.npy", "w") as stream:
        head = {"descr": "<U100000000", "fortran_order": False, "shape": ()}
        np.lib.format.write_array_header_1_0(stream, head)
    rejected(tmp_path / "a.npz", "not a text of at most 33554432 characters")


def test_other_packings_and_kinds_are_rejected(arrays, tmp_path):
    np.savez(tmp_path / "a.npz", **arrays)
    with zipfile.ZipFile(tmp_path / "a.npz") as old, zipfile.ZipFile(tmp_path / "b.npz", "w", zipfile.ZIP_LZMA) as new:
        for name in old.namelist():
            new.writestr(name, old.read(name))
    rejected(tmp_path / "b.npz", "its compression is not that of numpy")
    np.savez(tmp_path / "c.npz", **{**arrays, "t": np.array([{}], object)}, allow_pickle=True)
    rejected(tmp_path / "c.npz", "expected arrays of real numbers")


def test_a_run_announces_its_arrays(arrays, tmp_path):
    said = json.loads(str(arrays["meta"]))["arrays"]
    assert said == {name: list(x.shape) for name, x in arrays.items() if name != "meta"}
    np.savez(tmp_path / "old.npz", **unannounced(arrays))
    assert len(mbdae.Solution.load(tmp_path / "old.npz").t) == len(arrays["t"])
