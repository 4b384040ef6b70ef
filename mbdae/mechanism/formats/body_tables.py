"""Tables of frames, bodies, flexible bodies and sources in a mechanism file."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from ..checked_table import Table
from ..flexible.beam import EndCondition, Plane
from ..key_units import Unit

Vector = tuple[float, float, float]
JointKind = Literal[
    "revolute", "continuous", "prismatic", "spherical", "planar", "translation", "universal", "free", "fixed"
]
BEAM = (
    "length", "young", "density", "area", "second_moment", "polar_moment", "shear_stiffness", "fibre", "modes",
    "elements", "ends", "plane", "axial", "damping", "stiffening", "loads",
)  # fmt: skip
WITH_AXIS = ("revolute", "continuous", "prismatic", "planar")


class Frame(Table):
    """An extra frame on a link.

    Attributes:
        name: name of the frame.
        parent: link, body, joint or frame to which it is attached, or ``"world"``.
        xyz: position in the parent frame, in m.
        rpy: rotation in the parent frame, in rad: roll, pitch, yaw as in URDF.
    """

    name: str = Field(min_length=1)
    parent: str
    xyz: Annotated[Vector, Unit("m")] = (0.0, 0.0, 0.0)
    rpy: Annotated[Vector, Unit("rad")] = (0.0, 0.0, 0.0)


class Body(Frame):
    """An extra body and its joint; the joint and the link have the name of the body.

    Attributes:
        name: name of the joint, the link and the frame at the joint.
        joint: kind of the joint; a continuous joint is unbounded, a translation has the coordinates x, y and z, a
            universal joint the angles about x of the frame and about y of the body. Velocities of free and planar
            joints are along the axes of the moving body.
        axis: axis of a revolute, continuous or prismatic joint, or normal of the plane of a planar joint, whose x and y
            result from the shortest rotation of the frame that maps z to the normal: x and -z for [0, 1, 0].
        mass: mass in kg.
        com: centre of mass in the body's frame, in m.
        inertia: ixx, iyy, izz, ixy, ixz, iyz about the centre of mass, in kg m^2.
    """

    joint: JointKind = "revolute"
    axis: Annotated[Vector, Unit("1")] = (0.0, 0.0, 1.0)
    mass: Annotated[float, Unit("kg")] = Field(default=0.0, ge=0)
    com: Annotated[Vector, Unit("m")] = (0.0, 0.0, 0.0)
    inertia: Annotated[tuple[float, float, float, float, float, float], Unit("kg m^2")] = (0.0,) * 6

    @model_validator(mode="after")
    def _check_axis(self) -> "Body":
        if "axis" in self.model_fields_set and self.joint not in WITH_AXIS:
            raise ValueError(f"axis does not belong to a {self.joint} joint; rotate its frame by rpy")
        return self


class Flexible(Frame):
    """A straight elastic beam along x of its frame, see `mbdae.beam`, or a body from a file; nodes are ``name.node``.

    Attributes:
        name: name of the body and of the joint of its frame; ``"name.mode 1"``, ... are the joints of its modes.
        joint: kind of the joint between the parent and its frame; "fixed" clamps the frame to the parent.
        axis: axis of a revolute or prismatic joint.
        file: data of a modal body, ``"rod.npz"`` of `mbdae.save_modal_body`, instead of a beam.
        data: the same data as a table, as stored in archives.
        length: length in m.
        young: Young's modulus in N/m^2.
        density: density in kg/m^3.
        area: area of the cross-section in m^2.
        second_moment: second moment of area for bending along y, and along z if it differs, in m^4.
        polar_moment: second moment of area about x in m^4, for inertia about the axis; without it Iy + Iz if rotations
            of the joint have a component about x, or with shear, else 0.
        shear_stiffness: shear coefficient x shear modulus x area in N; 0 is rigid against shear.
        fibre: position (y, z) in the cross-section in m of the strain and stress at nodes; if omitted, axial beams have
            strain and stress by stretching only.
        modes: number of normal modes; if omitted, 4 for a beam, all for a body from a file.
        elements: number of elements.
        ends: displacements fixed to the frame at the left and at the right end.
        plane: direction of bending, or both.
        axial: whether the beam stretches, too.
        damping: damping ratio of all modes, or of each mode, also of loads, by frequency; if omitted, 0, or as in the
            file.
        stiffening: whether bending shortens the beam, so that tension stiffens it and compression makes it buckle.
        loads: static deflections in the frame that additional modes represent exactly: by the weight, "gravity y", or
            by a force or a moment on a node, "force y B", "moment z B".
        nodes: nodes and their positions along x in m, ends of elements; A and B at both ends if omitted.
    """

    joint: Literal["revolute", "prismatic", "spherical", "planar", "translation", "free", "fixed"] = "free"
    axis: Annotated[Vector, Unit("1")] = (0.0, 0.0, 1.0)
    file: str = ""
    data: dict[str, Any] | None = None
    length: Annotated[float | None, Unit("m")] = Field(default=None, gt=0)
    young: Annotated[float | None, Unit("N/m^2")] = Field(default=None, gt=0)
    density: Annotated[float | None, Unit("kg/m^3")] = Field(default=None, gt=0)
    area: Annotated[float | None, Unit("m^2")] = Field(default=None, gt=0)
    second_moment: Annotated[float | tuple[float, float] | None, Unit("m^4")] = None
    polar_moment: Annotated[float, Unit("m^4")] = Field(default=0.0, ge=0)
    shear_stiffness: Annotated[float, Unit("N")] = Field(default=0.0, ge=0)
    fibre: Annotated[tuple[float, float] | None, Unit("m")] = None
    modes: int | None = Field(default=None, ge=1)
    elements: int = Field(default=8, ge=1)
    ends: EndCondition = "clamped"
    plane: Plane = "y"
    axial: bool = False
    damping: Annotated[float | tuple[float, ...] | None, Unit("1")] = None
    stiffening: bool = True
    loads: tuple[str, ...] = ()
    nodes: Annotated[dict[str, float], Unit("m")] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check_body(self) -> "Flexible":
        fields = type(self).model_fields
        of_beams = [x for x in (*BEAM, "nodes") if x not in ("modes", "damping")]
        given = [x for x in of_beams if getattr(self, x) != fields[x].get_default(call_default_factory=True)]
        if self.file or self.data is not None:
            if given:
                raise ValueError(f"{given[0]} belongs to a beam, not to a body from a file")
        elif missing := [name for name in BEAM[:5] if getattr(self, name) is None]:
            raise ValueError(f"a beam needs {', '.join(missing)}; another body has a file")
        if "axis" in self.model_fields_set and self.joint not in ("revolute", "prismatic"):
            raise ValueError(f"axis does not belong to a {self.joint} joint; rotate its frame by rpy")
        return self


class Source(Table):
    """A file with joints and bodies: URDF, MJCF, SDF, or robot.yaml next to a robot.urdf.

    Attributes:
        file: relative to the mechanism file, or ``"example-robot-data:..."``.
        prefix: added to every name of the file.
        parent: frame to which it is attached: ``"world"`` or a frame of another source or body.
        xyz: position in the parent frame, in m.
        rpy: rotation in the parent frame, in rad.
        free_flyer: add a free joint between the world and the root link of a URDF.
        key: keyframe of an MJCF file with the initial state.
        quiet: report unsupported features of the file in ``mbdae info`` only, without a warning.
        packages: further folders from which files named in the source may be read, also by ``package://`` names.
    """

    file: str
    prefix: str = ""
    parent: str = "world"
    xyz: Annotated[Vector, Unit("m")] = (0.0, 0.0, 0.0)
    rpy: Annotated[Vector, Unit("rad")] = (0.0, 0.0, 0.0)
    free_flyer: bool = False
    key: str = ""
    quiet: bool = False
    packages: tuple[str, ...] = ()
