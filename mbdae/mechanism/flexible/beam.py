"""Straight beams: Hermite elements with shear, consistent mass at Gauss points, and modes for end conditions.

    EI theta'' + k (v' - theta) = rho I theta_tt,   k (v'' - theta') = rho A v_tt,   EA u'' = rho A u_tt

along x of the body's frame, from its origin to (length, 0, 0), in both planes; k is the shear stiffness.
Without shear (Euler-Bernoulli beams) theta = v', and cross-sections have rotary inertia only about x.

Modes of each direction are computed for EI = rho A = 1: they do not depend on the density, and without shear they
depend on neither the modulus nor the section. Their modal mass is the mass of the beam, so a modal coordinate is the
root-mean-square deflection of its mode in m.

Source of the elements: J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), chapter 11.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from ...errors import InputError, UnknownNameError
from ...system import Array
from .beam_modes import ENDS, ROTATION_AXES, Direction, Elements, Shapes
from .checked_numbers import array, integer, real, require_loads
from .modal_body import ModalBody, Node
from .points import OutlinePoints

PLANES = {"y": "y", "z": "z", "space": "yz"}
Plane = Literal["y", "z", "space"]
EndCondition = Literal["clamped", "pinned", "clamped-clamped", "clamped-pinned"]


def beam(  # noqa: PLR0913 - the properties of a beam
    length: float,
    young: float,
    density: float,
    area: float,
    second_moment: float | Sequence[float],
    *,
    modes: int = 4,
    elements: int = 8,
    ends: EndCondition = "clamped",
    plane: Plane = "y",
    axial: bool = False,
    damping: float | Sequence[float] = 0.0,
    polar_moment: float = 0.0,
    shear_stiffness: float = 0.0,
    fibre: Sequence[float] | None = None,
    stiffening: bool = True,
    loads: Sequence[str] = (),
    nodes: Mapping[str, float] | None = None,
) -> ModalBody:
    """Return a straight beam as a modal body with its lowest modes, which are positive near the left end.

    Args:
        length: length in m, along x from the origin of the frame.
        young: Young's modulus in N/m^2.
        density: density in kg/m^3.
        area: area of the cross-section in m^2.
        second_moment: second moment of area for bending along y, and along z if it differs, in m^4.
        modes: number of normal modes; each of the `loads` adds a mode.
        elements: number of elements of equal length.
        ends: displacements that the frame prevents at the left and at the right end: ``"clamped"`` (a cantilever),
            ``"pinned"`` (the frame is the chord between both), ``"clamped-clamped"`` or ``"clamped-pinned"``.
        plane: bending along ``"y"``, along ``"z"``, or both, ``"space"``.
        axial: whether the beam also stretches.
        damping: damping ratio of each mode by frequency, including modes of loads; or one ratio for all modes.
        polar_moment: second moment of area about x in m^4; without it, or shear, a beam has no inertia about its axis.
        shear_stiffness: shear coefficient x shear modulus x area in N, of a Timoshenko beam with rotary inertia;
            0 for an Euler-Bernoulli beam, which is rigid in shear.
        fibre: position (y, z) in the cross-section in m at which nodes report strain and stress; if omitted, nodes of
            axial beams report those of stretching.
        stiffening: whether bending shortens the beam along x, by the integral of v'^2 / 2: tension then increases its
            bending stiffness, and compression can cause buckling.
        loads: loads whose deflections modes represent exactly, in addition to normal modes: the weight,
            ``"gravity y"``, or a force or a moment on a node, ``"force y B"``, ``"moment z B"``.
        nodes: names of nodes and their positions along x in m, at ends of elements; if omitted, A at the left end and
            B at the right end.

    Raises:
        InputError: for values that are not positive, more modes than the elements have, negative damping, or a node
            inside an element.
        UnknownNameError: for unknown ends, an unknown plane or load.
    """
    moments = _moments(second_moment)
    _require_numbers({"length": length, "young": young, "density": density, "area": area}, positive=True)
    _require_numbers({"shear_stiffness": shear_stiffness, "polar_moment": polar_moment})
    if fibre is not None or axial:
        fibre = array((0.0, 0.0) if fibre is None else fibre, "beam: fibre", (2,)).tolist()
    modes, elements = integer(modes, "beam: modes", 1), integer(elements, "beam: elements", 1)
    _require_known("ends", ends, ENDS)
    _require_known("plane", plane, PLANES)
    grid, per_length = Elements(length, elements), density * area
    gyration = {axis: x / area for axis, x in moments.items()} if shear_stiffness else {}
    directions = [Direction(grid, "x", ends, young / density)] if axial else []
    for axis in PLANES[plane]:
        bending = young * moments[axis]
        shear = bending / shear_stiffness if shear_stiffness else 0.0
        directions.append(Direction(grid, axis, ends, bending / per_length, shear, gyration.get(axis, 0.0)))
    positions = _positions(nodes or {"A": 0.0, "B": length})
    elements_at = {name: grid.node(x, name) for name, x in positions.items()}
    shapes = _lowest_shapes(directions, modes, loads, elements_at)
    r, masses, Phi = shapes.points(per_length, gyration)
    Phi2 = shapes.shortening_at_points(len(r)) if stiffening else None
    found = {name: _node(shapes, (*elements_at[name], x), stiffening, young, fibre) for name, x in positions.items()}
    body = ModalBody.of_points(r, masses, Phi, per_length * length * shapes.squares, damping, found, Phi2)
    if polar_moment:
        body.I0[0, 0] = density * polar_moment * length
    outline = [_node(shapes, (*grid.node(x, "end"), x), stiffening, young, fibre) for x in grid.x.tolist()]
    return replace(body, outline=OutlinePoints.of_beam(outline))


def _require_numbers(values: Mapping[str, float], positive: bool = False) -> None:
    for name, value in values.items():
        real(value, f"beam: {name}", positive=positive)


def _require_known(what: str, given: str, known: Mapping[str, object]) -> None:
    if given not in list(known):
        raise UnknownNameError(what, given, known)


def _positions(nodes: Mapping[str, float]) -> dict[str, float]:
    if not isinstance(nodes, Mapping):
        raise InputError(f"beam: nodes are positions by name, got {nodes!r:.60}")
    return {name: real(x, f"beam: node {name!r}") for name, x in nodes.items()}


def _moments(second_moment: float | Sequence[float]) -> dict[str, float]:
    pair = np.broadcast_to(second_moment, 2) if np.ndim(second_moment) == 0 else np.asarray(second_moment)
    if pair.shape != (2,):
        raise InputError(f"beam: second_moment needs one number, or two of y and z, got {second_moment!r:.60}")
    moments = dict(zip("yz", pair.tolist(), strict=True))
    return {axis: real(x, f"beam: second_moment along {axis}", positive=True) for axis, x in moments.items()}


def _lowest_shapes(
    directions: Sequence[Direction], modes: int, loads: Sequence[str], elements_at: Mapping[str, tuple[int, float]]
) -> Shapes:
    """Return the lowest modes of all directions and modes of deflections under loads, by frequency."""
    count = sum(d.free for d in directions)
    if modes > count:
        elements = directions[0].grid.elements
        raise InputError(f"beam: {elements} elements have {count} modes with these ends, got modes = {modes}")
    known = [_loads(d, elements_at) for d in directions]
    require_loads(loads, [load for table in known for load in table])
    normal = [d.normal_modes(min(modes, d.free)) for d in directions]
    lowest = np.argsort(np.concatenate([squares for squares, _ in normal]), kind="stable")[:modes]
    direction_of_mode = np.repeat(np.arange(len(directions)), [len(squares) for squares, _ in normal])[lowest]
    columns = []
    for i, (d, (squares, U)) in enumerate(zip(directions, normal, strict=True)):
        k = int(np.count_nonzero(direction_of_mode == i))
        found = squares[:k], U[:, :k]
        given = {load: known[i][load] for load in loads if load in known[i]}
        columns.append(d.with_loads(*found, given) if given else found)
    return Shapes.of(directions, columns)


def _loads(d: Direction, elements_at: Mapping[str, tuple[int, float]]) -> dict[str, Array]:
    """Return the loads along a direction by name: the weight, and forces and moments on nodes."""
    out = {f"gravity {d.axis}": d.weight()}
    for name, (e, s) in elements_at.items():
        v, theta, _, _ = d.rows(e, s)
        out[f"force {d.axis} {name}"] = v
        if d.axis in ROTATION_AXES:
            out[f"moment {ROTATION_AXES[d.axis]} {name}"] = theta
    return out


def _node(
    shapes: Shapes, at: tuple[int, float, float], stiffening: bool, young: float, fibre: Sequence[float] | None
) -> Node:
    """Return the node at an end of an element; its strain, if any, is the mean of the adjacent elements."""
    e, s, x = at
    displacement, rotation, strains = shapes.at(e, s)
    if s == 0 and e > 0:
        strains = (strains + shapes.at(e - 1, 1.0)[2]) / 2
    strain = None if fibre is None else strains[0] - fibre[0] * strains[1] - fibre[-1] * strains[2]
    Phi2 = shapes.shortening(e, s) if stiffening else None
    return Node(np.array([x, 0.0, 0.0]), displacement, rotation, Phi2, strain, young)
