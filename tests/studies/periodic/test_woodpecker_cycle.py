"""The woodpecker's cycle: impacts, a sleeve that jams and slips, and a height that advances."""

import numpy as np
import pytest
from commands import call, keep_studies


@pytest.mark.slow
def test_the_cycle(monkeypatch):
    """Its period and advance are those of a long run; time and height are neutral; a disturbance dies in a period.

    By the command of guide/periodic.md.
    """
    keep_studies(monkeypatch, found := [])
    assert call("periodic", "woodpecker")[0] == 0
    (cycle,) = found
    period = cycle.T
    assert period == pytest.approx(0.132003468, abs=2e-8)
    assert cycle.advances["height"] == pytest.approx(-0.0152323748, abs=1e-8)
    assert cycle.stability == "stable"
    assert [x.name for x in cycle.neutral] == ["time", "height"]
    assert max(x.error for x in cycle.neutral) < 1e-8
    assert cycle.multipliers[0].real == pytest.approx(0.018056, abs=1e-5)
    assert np.abs(cycle.multipliers[1:]).max() < 1e-6
    assert len(cycle.multipliers) == 2  # an edge slides at the start: one speed and one coordinate less
    assert cycle.section.startswith("q.bird < ")
    _require_quotient_of_runs(cycle)


def _require_quotient_of_runs(cycle):
    """Compare the monodromy matrix along one direction, of fourth order, through all impacts and modes of a period."""
    shooting, d = cycle.shooting, np.array([0.0, 0.02, 0.001, -0.2])
    chart = shooting.charts[0]

    def end(x):
        q, v, s = chart.state(0.0, chart.x0 + x * d)
        run = shooting.flow.run(0.0, np.concatenate([q, v, s, [0.0]]), cycle.T, None)
        return chart.coordinates_of(run.y[-1])

    h = 1e-3
    quotient = (8 * (end(h) - end(-h)) - (end(2 * h) - end(-2 * h))) / (12 * h)
    found = shooting.factors[0] @ d
    np.testing.assert_allclose(found, quotient, atol=1e-5 * np.abs(quotient).max())
