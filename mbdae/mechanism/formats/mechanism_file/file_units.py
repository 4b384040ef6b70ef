"""The table ``[units]`` of mechanism files."""

from pydantic import ValidationInfo, field_validator

from ....units import DIMENSIONS, Units
from ...checked_table import Table


class FileUnits(Table):
    """Units of the numbers of a mechanism file; units of products follow: N mm and kg mm^2 with lengths in mm.

    Attributes:
        length: m, mm, cm, um, km, in, ft.
        angle: rad, mrad, deg, rev.
        mass: kg, g, t, lb.
        time: s, ms, min, h.
        force: N, mN, kN, MN, kgf, lbf.
        torque: N m, N mm, N cm, kN m, lbf in, lbf ft; if omitted, force times length.
        rotation: angular velocity, rad/s or rpm; if omitted, angle per time.
        pressure: N/m^2, Pa, kPa, MPa, GPa, bar; if omitted, force per area.
        energy: J, mJ, kJ.
        power: W, mW, kW.
    """

    length: str = "m"
    angle: str = "rad"
    mass: str = "kg"
    time: str = "s"
    force: str = "N"
    torque: str = ""
    rotation: str = ""
    pressure: str = ""
    energy: str = "J"
    power: str = "W"

    @field_validator("*")
    @classmethod
    def _require_known(cls, value: str, info: ValidationInfo) -> str:
        known = DIMENSIONS[info.field_name or ""]
        if value and value not in known:
            raise ValueError(f"unknown unit, known: {', '.join(known)}")
        return value

    @property
    def units(self) -> Units:
        """Units given in the file."""
        return Units({name: x for name in sorted(self.model_fields_set) if (x := getattr(self, name))})
