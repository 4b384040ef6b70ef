"""FMUs without pictures and with less compression, which take longer than most tests; `test_fmu_pictures` has both."""

import zlib
from importlib import import_module

import pytest


@pytest.fixture(scope="module", autouse=True)
def bare_files(request):
    """Exported files have no picture of the mechanism, and are compressed fast."""
    with pytest.MonkeyPatch.context() as patch:
        if request.module.__name__ != "test_fmu_pictures":
            patch.setattr(import_module("mbdae.studies.export.export"), "picture", lambda mech: b"")
            patch.setattr(zlib, "Z_DEFAULT_COMPRESSION", zlib.Z_BEST_SPEED)
        yield
