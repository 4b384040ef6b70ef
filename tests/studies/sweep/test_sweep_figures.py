"""Figures of sweeps: a curve over one parameter, a heat map over a grid of two, otherwise points."""

import numpy as np

import mbdae

SPEEDS = [8.0, 1.0, 4.0]


def test_one_parameter_is_a_curve_in_the_order_of_its_values():
    runs = mbdae.sweep("slider_crank", {"start.v.crank": SPEEDS}, 0.1, outputs=["final q.slider"])
    (line,) = runs.plot().axes[0].lines
    order = np.argsort(SPEEDS)
    np.testing.assert_array_equal(line.get_xdata(), np.array(SPEEDS)[order])
    np.testing.assert_array_equal(line.get_ydata(), runs["final q.slider"][order])
    assert line.get_linestyle() == "-"


def test_a_grid_of_two_parameters_is_a_heat_map():
    grid = {"start.v.crank": SPEEDS, "solve.rtol": [1e-3, 1e-7]}
    runs = mbdae.sweep("slider_crank", grid, 0.1, outputs=["final q.slider"])
    axes, colours = runs.plot().axes
    (cells,) = axes.collections
    table = np.asarray(cells.get_array()).reshape(2, 3)
    expected = runs["final q.slider"].reshape(3, 2)[np.argsort(SPEEDS)][:, ::-1].T
    np.testing.assert_array_equal(table, expected)
    assert (axes.get_xscale(), axes.get_yscale()) == ("linear", "log")
    assert colours.get_ylabel() == "final q.slider (m)"
    np.testing.assert_allclose(cells.get_coordinates()[:, 0, 1], [1e-9, 1e-5, 1e-1], rtol=1e-12)


def test_repeated_pairs_are_drawn_as_points():
    """There are as many runs as cells, but two of them in one cell."""
    pairs = [{"start.v.crank": v, "solve.rtol": rtol} for v, rtol in [(1, 1e-3), (1, 1e-3), (2, 1e-4), (2, 1e-3)]]
    axes = mbdae.sweep("slider_crank", pairs, 0.02, outputs=["final q.slider"]).plot().axes
    assert [len(ax.lines[0].get_xdata()) for ax in axes[:2]] == [4, 4]


def test_an_incomplete_grid_is_drawn_as_points():
    pairs = [{"start.v.crank": v, "solve.rtol": 10**-v} for v in SPEEDS]
    axes = mbdae.sweep("slider_crank", pairs, 0.1, outputs=["final q.slider"]).plot().axes
    assert [ax.lines[0].get_linestyle() for ax in axes[:2]] == ["None", "None"]
    assert [ax.get_xscale() for ax in axes[:2]] == ["linear", "log"]


def test_values_over_decades_at_even_distances_are_drawn_on_a_linear_axis():
    runs = mbdae.sweep("slider_crank", {"start.v.crank": [0.05, 2.5, 5.0]}, 0.02, outputs=["final q.slider"])
    assert runs.plot().axes[0].get_xscale() == "linear"
