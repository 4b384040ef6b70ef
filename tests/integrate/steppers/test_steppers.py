"""Step sizes and error norms, one call at a time: by formulas, on a problem without a mechanism."""

from math import nan, ulp
from types import SimpleNamespace

import numpy as np
import pytest

from mbdae.errors import StepError
from mbdae.integrate.events.jumps import Jumps, SmoothInterval
from mbdae.integrate.steppers.adaptive import Adaptive
from mbdae.integrate.steppers.fixed import Fixed
from mbdae.methods.controller import Controller
from mbdae.system import State, Step
from mbdae.tolerances import JUMP_MARGIN


class Rates:
    """y' = f(y); the last component is not under control."""

    ny = 3
    error_components = slice(0, 2)

    def __init__(self, f=None, noise=0.0, jumps=()):
        self.f, self.rounding, self.jumps = f, noise, jumps

    def component_magnitudes(self, y):
        return np.abs(y)

    def first_step(self, *_, **__):
        return None  # no compiled core

    def noise(self, y, relative):
        return np.full(self.ny, self.rounding * relative)

    def add(self, y, x):
        return y + x

    def derivative(self, t, y):
        return self.f(y), None

    def breakpoint(self, t, sign):
        return sign * min((sign * x for x in self.jumps if sign * x > sign * t), default=np.inf)


def at(t, stop, end=None, sign=1.0, y=(1.0, 1.0, 1.0), system=None, t1=None):
    """A run at time t, in a smooth interval."""
    interval = SmoothInterval(stop, stop if end is None else end, None)
    run = SimpleNamespace(
        t=t, t1=interval.end if t1 is None else t1, interval=interval, sign=sign, state=State(np.array(y))
    )
    run.system, run.tableau, run.singularity_monitor = system or Rates(), SimpleNamespace(noise=0.5, blend=1.0), None
    run.time_to_interval_end, run.F = (
        lambda: abs(interval.stop - run.t),
        system.f(run.state.y) if system and system.f else None,
    )
    return run


def adaptive(h=0.1, power=4, rtol=1e-3, atol=0.0, largest=np.inf):
    return Adaptive(power, rtol, atol, h, largest)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_step_ends_where_it_is_long(sign):
    h, end = adaptive(0.1).propose(at(2.0, 2.0 + sign, sign=sign))
    assert (h, end) == (0.1, 2.0 + 0.1 * sign)


@pytest.mark.parametrize("h", [0.25, 0.25 * (1 - 1e-12), 0.3, 7.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_last_step_of_an_interval_ends_at_its_end(h, sign):
    stepper, stop = adaptive(h), 2.0 + 0.25 * sign
    assert stepper.propose(at(2.0, stop, stop + 8 * sign * ulp(2), sign)) == (0.25, stop + 8 * sign * ulp(2))


def test_a_step_that_leaves_a_little_of_its_interval_is_not_extended():
    h, end = adaptive(0.2499).propose(at(2.0, 2.25))
    assert (h, end) == (0.2499, pytest.approx(2.2499))


def test_steps_stay_below_the_largest_and_the_cap():
    assert adaptive(0.1, largest=0.03).propose(at(0.0, 1.0)) == (0.03, 0.03)
    stepper = adaptive(0.1)
    stepper.cap = 0.02
    assert stepper.propose(at(0.0, 1.0)) == (0.02, 0.02)


def test_a_step_size_below_the_rounding_of_time_is_no_step():
    with pytest.raises(StepError, match="step size fell to") as e:
        adaptive(15 * ulp(2.0)).propose(at(2.0, 2.25))
    assert e.value.status == "step_size"
    assert adaptive(17 * ulp(2.0)).propose(at(2.0, 2.25))[0] == 17 * ulp(2.0)


@pytest.mark.parametrize("largest", [np.inf, 0.05])
def test_after_a_truncated_step_the_previous_size_returns(largest):
    """The error of a short step is no guide: h = 0.9 h err^(0.03 - 1/k) err_last^0.04 would have to grow again."""
    run, stepper = at(2.0, 2.01), adaptive(0.1, largest=largest)
    h, _ = stepper.propose(run)
    assert stepper.accept_or_reject(run, h, 0.5)
    assert stepper.h == 0.1 > Controller(4).next_step(0.01, 0.5)


def test_after_a_slightly_truncated_step_the_size_may_grow():
    run, stepper = at(2.0, 2.09), adaptive(0.1)
    assert stepper.accept_or_reject(run, stepper.propose(run)[0], 1e-6)
    assert stepper.h == pytest.approx(Controller(4).next_step(0.09, 1e-6))
    assert stepper.h > 0.1


def test_a_step_in_the_middle_of_its_interval_may_shrink():
    run, stepper = at(2.0, 3.0), adaptive(0.1)
    assert stepper.accept_or_reject(run, stepper.propose(run)[0], 0.99)
    assert stepper.h == Controller(4).next_step(0.1, 0.99) < 0.1


def test_a_step_that_was_cut_short_and_rejected_shrinks():
    run, stepper = at(2.0, 2.01), adaptive(0.1)
    assert not stepper.accept_or_reject(run, stepper.propose(run)[0], 16.0)
    assert stepper.h == pytest.approx(0.009 * 16**-0.25)


def test_largest_steps_are_not_cut():
    """After a bound by the user the size from the error returns, not the bound."""
    run, stepper = at(2.0, 3.0), adaptive(0.5, largest=0.1)
    assert stepper.accept_or_reject(run, stepper.propose(run)[0], 0.5)
    assert stepper.h == Controller(4).next_step(0.1, 0.5)


@pytest.mark.parametrize(("error", "accepted"), [(0.0, True), (1.0, True), (1.0 + 1e-15, False), (nan, False)])
def test_steps_are_accepted_up_to_an_error_of_one(error, accepted):
    stepper = adaptive(0.1)
    assert stepper.accept_or_reject(at(0.0, 1.0), 0.1, error) is accepted
    assert stepper.controller.rejected is not accepted
    assert accepted or stepper.h < 0.1


def test_a_step_that_cannot_be_taken_is_tried_with_a_fifth():
    run, stepper = at(0.0, 1.0), adaptive(0.1)
    assert stepper.may_retry(run, 0.1, StepError("newton", "no root"))
    assert stepper.h == pytest.approx(0.02)
    stepper.h = 1e-17
    with pytest.raises(StepError, match="no root"):
        stepper.propose(run)
    assert not stepper.may_retry(run, 1e-17, StepError("newton", "no root"))


def test_the_reason_of_a_step_that_was_not_taken_is_forgotten_two_steps_later():
    run, stepper = at(0.0, 1.0), adaptive(0.1)
    stepper.may_retry(run, 0.1, StepError("newton", "no root"))
    reasons = []
    for _ in range(2):
        stepper.accept_or_reject(run, 0.02, 0.5)
        reasons.append(stepper.reason)
    assert reasons == ["no root", ""]


def test_errors_are_measured_in_the_larger_of_both_ends():
    """err^2 = mean (e_i / (atol_i + rtol max(|y_n|, |y_n+1|)))^2 over measured components, with rounding of v added."""
    run = at(0.0, 1.0, y=(3.0, -1.0, 9.0))
    errors, ends = np.array([[0.3, 0.08, 1e9]]), State(np.array([-2.0, 4.0, 0.0]))
    scale = np.array([0.01 + 0.1 * 3, 0.02 + 0.1 * 4])
    stepper = adaptive(rtol=0.1, atol=np.array([0.01, 0.02]))
    expected = np.sqrt(((errors[0, :2] / scale) ** 2).mean())
    assert stepper.error(run, Step(ends, None, errors)) == pytest.approx(expected)
    run.system = Rates(noise=0.2)
    expected = np.sqrt(((errors[0, :2] / (scale + 0.2 * 0.5)) ** 2).mean())
    assert stepper.error(run, Step(ends, None, errors)) == pytest.approx(expected)
    expected = [np.sqrt(((errors[0, :2] / scale) ** 2).mean())]
    assert stepper.tolerance_norms(run, ends.y, errors) == pytest.approx(expected)


def test_both_error_vectors_count():
    run, errors = at(0.0, 1.0), np.array([[2e-3, 2e-3, 0.0], [0.3, 0.3, 0.0]])
    assert adaptive(rtol=1e-3).error(run, Step(run.state, None, errors)) == pytest.approx(4 / (2 + 0.01 * 300))


def test_atol_is_a_hundredth_of_rtol_where_it_is_left_out():
    run = at(0.0, 1.0, y=(0.0, 0.0, 0.0))
    stepper, moves = adaptive(rtol=1e-3, atol=None), np.full((1, 3), 1e-5)
    assert stepper.tolerance_norms(run, run.state.y, moves) == pytest.approx([1.0])


def first_step(f, y, k, scale, left=1e3):
    """Hairer, Noersett, Wanner I, II.4, (a) to (f), with k - 1 the assumed order."""

    def norm(x):
        return np.sqrt(np.mean((np.asarray(x, float)[:2] / scale) ** 2))

    d0, d1 = norm(y), norm(f(y))
    h0 = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
    h0 = min(h0, left)
    d2 = norm(f(y + h0 * f(y)) - f(y)) / h0
    h1 = max(1e-6, 1e-3 * h0) if max(d1, d2) <= 1e-15 else (0.01 / max(d1, d2)) ** (1 / k)
    return min(100 * h0, h1)


@pytest.mark.parametrize(
    ("f", "by_hand"),
    [
        (lambda y: -20 * y, (0.01 * 0.101 / 400) ** 0.25),  # the second derivative is the steepest: d2 = 400 / scale
        (lambda y: -0.1 * y, (0.01 * 0.101 / 0.1) ** 0.25),  # the first one: d1 = 0.1 / scale
        (lambda y: np.full(3, 1e3), 1e-3),  # a hundred times h0 = 0.01 |y| / |y'|
        (lambda y: 0 * y, 1e-6),  # nothing changes
        (lambda y: np.array([-8.0, 0.5, 1e5]) * y, None),
    ],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_first_step_is_that_of_the_book(f, by_hand, sign):
    run = at(0.0, sign * 1e3, sign=sign, y=(1.0, 1.0, 7.0), system=Rates(f))
    stepper = adaptive(None, rtol=0.1, atol=1e-3)
    assert stepper.ready_for_core(run)
    assert stepper.h == pytest.approx(first_step(lambda y: sign * f(y), run.state.y, 4, 0.101), rel=1e-9)
    assert by_hand is None or stepper.h == pytest.approx(by_hand, rel=1e-9)


def grid(stepper, t, stop, end=None, t1=1.0):
    """Steps of a run to the end of its interval: their sizes and their end times."""
    out, sign = [], 1.0 if t1 > 0 else -1.0
    while not out or out[-1][1] != (stop if end is None else end):
        h, t = stepper.propose(at(t, stop, end, sign, t1=t1))
        out.append((h, t))
        assert len(out) < 20
    return [x for pair in out for x in pair]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_fixed_steps_follow_the_grid_to_the_end(sign):
    found = grid(Fixed(0.3, 0.0, sign), 0.0, sign, t1=sign)
    assert found == pytest.approx([0.3, 0.3 * sign, 0.3, 0.6 * sign, 0.3, 0.9 * sign, 0.1, sign], abs=1e-15)
    assert found[-1] == sign
    tenths = grid(Fixed(0.1, 0.0, sign), 0.0, sign, t1=sign)
    assert len(tenths) == 20
    assert tenths[1::2] == [sign * i * 0.1 for i in range(1, 10)] + [sign]


@pytest.mark.parametrize("step", [0.1 * (1 + 1e-14), 0.1 * (1 - 1e-14)])
def test_a_grid_that_misses_the_end_by_rounding_has_no_step_more(step):
    stepper = Fixed(step, 0.0, 1.0)
    assert stepper.n == 10
    assert len(grid(stepper, 0.0, 1.0)) == 20
    assert Fixed(0.1 * (1 - 1e-9), 0.0, 1.0).n == 11


def test_fixed_steps_leave_the_grid_for_the_end_of_an_interval_and_return():
    stepper = Fixed(0.25, 0.0, 1.0)
    assert grid(stepper, 0.0, 0.4, 0.4 + 1e-14) == pytest.approx([0.25, 0.25, 0.15, 0.4], abs=1e-13)
    assert grid(stepper, 0.4, 1.0) == pytest.approx([0.1, 0.5, 0.25, 0.75, 0.25, 1.0])


@pytest.mark.parametrize("off", [-1e-12, 0.0, 1e-12])
def test_an_interval_that_ends_on_the_grid_has_no_remainder_step(off):
    stepper, stop = Fixed(0.25, 0.0, 1.0), 0.5 + off
    first = grid(stepper, 0.0, stop, stop + 1e-15)
    assert first == pytest.approx([0.25, 0.25, 0.25, 0.5])
    assert first[-1] == stop + 1e-15
    assert grid(stepper, stop, 1.0) == pytest.approx([0.25, 0.75, 0.25, 1.0])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_interval_ends_a_few_roundings_before_a_jump_and_the_next_begins_at_it(sign):
    ahead = Jumps(Rates(jumps=[sign * 0.5]), [], sign, sign)
    first = ahead.interval(0.0)
    margin = JUMP_MARGIN * ulp(1.0)
    assert first.stop == first.end == sign * (0.5 - margin)
    # a point belongs to the interval after the jump in time: backwards, the next interval begins before it
    assert first.restart == (0.5 if sign > 0 else -0.5 - margin)
    assert ahead.interval(first.restart) == SmoothInterval(sign, sign, None)


@pytest.mark.parametrize("off", [-1e-15, 0.0, 1e-15])
def test_a_jump_at_the_end_of_the_span_is_not_crossed(off):
    stop, end, restart = Jumps(Rates(), [1.0 + off], 1.0, 1.0).interval(0.0)
    assert 1.0 + off - stop == pytest.approx(JUMP_MARGIN * ulp(1.0))
    assert (end, restart) == (1.0, None)


def test_jumps_that_differ_by_rounding_are_crossed_together():
    ahead = Jumps(Rates(jumps=[0.5]), [0.5 + 1e-15, 0.7], 1.0, 1.0)
    first = ahead.interval(0.0)
    assert first.stop < 0.5 < first.restart == 0.5 + 1e-15
    assert ahead.interval(first.restart).restart == 0.7
