"""Members of a family that are imported on first use."""

import time
from concurrent.futures import ThreadPoolExecutor

from mbdae.discovery import Members


def test_threads_that_ask_at_the_same_time_get_the_same_member():
    def slow(module, name):
        time.sleep(0.01)
        return getattr(module, name)

    family = Members({"isfinite": "math", "dumps": "json"}, slow)
    assert [*family] == ["dumps", "isfinite"]
    with ThreadPoolExecutor(8) as threads:
        found = [*threads.map(family.__getitem__, ["isfinite", "dumps"] * 8)]
    assert [f.__module__ for f in found] == ["math", "json"] * 8
    family["dumps"] = 1
    assert (family["dumps"], len(family)) == (1, 2)
