"""The types of the core in the repository are those of the core that is built."""

import native_stub
import pytest


@pytest.mark.native
def test_types_are_those_of_the_core():
    pytest.importorskip("nanobind", reason="needs nanobind, which writes the types")
    assert native_stub.STUB.read_text("utf-8") == native_stub.stub()
