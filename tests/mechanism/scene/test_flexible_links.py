"""Drawn flexible bodies: rods along the whole body, and enlarged displacements."""

import numpy as np
import pinocchio as pin
import pytest
from flexible_bodies import FOUR_BAR
from scipy.spatial.transform import Rotation

import mbdae
from mbdae.mechanism.scene.flexible_models import with_scaled_deformation
from mbdae.studies.replay.animation_tracks import closure_gaps, traces

LENGTH, SPAN = 0.9, np.linspace(0, 1, 9)  # of the coupler; ends of elements


@pytest.fixture(scope="module")
def four_bar(tmp_path_factory):
    """With the shortening by bending, whose coupler has the shape sin(pi x/L)."""
    path = tmp_path_factory.mktemp("four_bar") / "mechanism.toml"
    path.write_text(FOUR_BAR.read_text().replace("stiffening = false\n", ""))
    mech = mbdae.load(path)
    modes = {"coupler.mode 1": 2e-3} | {f"coupler.mode {i}": 0.0 for i in (2, 3, 4)}
    return mech, mech.assemble({"crank": 1.0} | modes)[0]


def ends_of_rods(scene, q, name):
    """Start and end of each rod of a body at a configuration, (n, 2, 3)."""
    at = [k for k, shape in enumerate(scene.shapes) if shape.name.startswith(f"{name} ") and "rod" in shape.name]
    poses = scene.placements(q)[at]
    z = Rotation.from_quat(poses[:, 3:]).as_matrix()[:, :, 2]
    half = z * [[scene.shapes[k].size[1] / 2] for k in at]
    return np.stack([poses[:, :3] - half, poses[:, :3] + half], axis=1)


def test_rods_bend_from_the_crank_to_the_closure(four_bar):
    mech, q = four_bar
    ends = ends_of_rods(mech.scene, q, "coupler")
    assert len(ends) == 8
    np.testing.assert_allclose(ends[0, 0], 0.3 * np.array([np.cos(1.0), np.sin(1.0), 0]), atol=1e-12)
    np.testing.assert_allclose(ends[-1, 1], mech.frame(q, "rocker_tip")[0], atol=1e-5)
    amplitude = 2e-3 * np.sqrt(2)  # of mean square 1
    p, R = mech.frame(q, "coupler")
    local = (ends[:, 0] - p) @ R
    np.testing.assert_allclose(local[:, 1], amplitude * np.sin(np.pi * SPAN[:-1]), atol=1e-4 * amplitude)


@pytest.mark.parametrize("factor", [0.0, 20.0])
def test_displacements_are_enlarged(four_bar, factor):
    """Also that by the shortening, pi^2 a^2/(4 L), which opens the closure."""
    mech, q = four_bar
    scene, amplitude = mech.scene.with_scaled_deformation(factor), 2e-3 * np.sqrt(2)
    p, R = mech.frame(q, "coupler")
    local = (ends_of_rods(scene, q, "coupler")[:, 0] - p) @ R
    np.testing.assert_allclose(local[:, 1], factor * amplitude * np.sin(np.pi * SPAN[:-1]), atol=0.01 * amplitude)
    shortening = np.pi**2 * amplitude**2 / (4 * LENGTH)
    (gap,) = closure_gaps(scene, q[None])
    assert gap["open"] == pytest.approx(abs(factor - 1) * shortening, rel=1e-3)
    (path,) = traces(mech, ["coupler.middle"], lambda t: np.tile(q, (len(t), 1)), np.arange(2.0), factor)
    assert ((path["points"][0] - p) @ R)[1] == pytest.approx(factor * amplitude, rel=1e-4)


def test_a_scene_without_a_factor_is_that_of_the_mechanism(four_bar):
    mech, q = four_bar
    np.testing.assert_array_equal(mech.scene.with_scaled_deformation(None).placements(q), mech.scene.placements(q))
    unscaled = mech.scene.with_scaled_deformation(1.0).placements(q)
    np.testing.assert_allclose(unscaled, mech.scene.placements(q), atol=1e-15)
    assert with_scaled_deformation(mech.model, None) is mech.model


def test_rods_of_a_body_from_a_file_begin_at_its_joint():
    mech = mbdae.load("flexible_slider_crank")
    q = mech.start[0]
    ends = ends_of_rods(mech.scene, q, "rod")
    np.testing.assert_allclose(ends[0, 0], mech.frame(q, "rod")[0], atol=1e-12)
    nodes = [mech.frame(q, f"rod.{name}")[0] for name in ("quarter", "middle")]
    np.testing.assert_allclose(ends[1:, 0], nodes, atol=1e-12)


@pytest.mark.parametrize("nodes", [None, {"tip": 1.0}])
def test_a_beam_alone_is_drawn(nodes):
    """From its clamped end to its tip, whatever its nodes are."""
    model = pin.Model()
    beam = mbdae.beam(1.0, 7e10, 2700.0, 1e-4, 8e-11, modes=1, stiffening=False, nodes=nodes)
    mbdae.attach_flexible(model, "bar", beam, None)
    mech = mbdae.Mechanism(model)
    ends = ends_of_rods(mech.scene, np.array([0.01]), "bar")
    np.testing.assert_allclose(ends[:, 0, 0], SPAN[:-1], atol=1e-15)
    assert ends[-1, 1, 1] == pytest.approx(0.02, rel=1e-3)  # the tip moves twice the mean deflection
