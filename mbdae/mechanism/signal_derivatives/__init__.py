"""Exact derivatives of signals of a motion; their values are computed by `mbdae.mechanism`."""

from .contacts import contact_derivatives, path_derivatives
from .deformation import deformation_derivatives
from .efforts import driver_power_derivatives, effort_derivatives, friction_power_derivatives
from .frame_motions import frame_motion_derivatives
from .gaps import gap_derivatives, unilateral_rows
from .momentum import momentum_derivatives, shaking_derivatives
from .motion_tangent import MotionTangent, TangentDirections
from .reactions import reaction_derivatives

__all__ = [
    "MotionTangent",
    "TangentDirections",
    "contact_derivatives",
    "deformation_derivatives",
    "driver_power_derivatives",
    "effort_derivatives",
    "frame_motion_derivatives",
    "friction_power_derivatives",
    "gap_derivatives",
    "momentum_derivatives",
    "path_derivatives",
    "reaction_derivatives",
    "shaking_derivatives",
    "unilateral_rows",
]
