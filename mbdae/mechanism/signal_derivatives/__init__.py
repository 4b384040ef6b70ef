"""How signals move with the motion that they are read from: exact slopes beside the values in `mbdae.mechanism`."""

from .contacts import contact_slopes, path_slopes
from .efforts import drive_power_slopes, effort_slopes
from .frame_motions import motion_slopes
from .momentum import momentum_slopes
from .motion_tangent import Directions, VariedMotion
from .reactions import load_slopes

__all__ = [
    "Directions",
    "VariedMotion",
    "contact_slopes",
    "drive_power_slopes",
    "effort_slopes",
    "load_slopes",
    "momentum_slopes",
    "motion_slopes",
    "path_slopes",
]
