"""Runs tell the logger of their result."""

import logging

import mbdae


def test_a_run_is_logged_with_its_method_and_its_message(caplog):
    caplog.set_level(logging.INFO, logger="mbdae")
    sol = mbdae.solve("pendulum", (0, 0.1), method="herk3", step=0.01)
    mbdae.solve("pendulum", (0, 0.1), method="herk3", step=0.01, max_steps=3)
    first, second = (record.getMessage() for record in caplog.records)
    assert first.startswith(f"Cartesian pendulum: finished, 10 steps by herk3 ({sol.stats['backend']} back end)")
    assert first.endswith(sol.message)
    assert second.startswith("Cartesian pendulum: max_steps, 3 steps by herk3")
