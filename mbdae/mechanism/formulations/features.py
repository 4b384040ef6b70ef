"""Features of a mechanism that some methods do not support."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .index2 import Index2System


def features(system: "Index2System") -> dict[str, str]:
    """Return kinds of features with the names of their elements, see `mbdae.system.System`.

    ``"switches"``: stops, brakes, clutches, contacts; ``"events"`` at which the state jumps; ``"velocity rows"``:
    closures without a position level; ``"states"`` of actuators and controllers; ``"closure friction"``: friction
    proportional to multipliers.
    """
    mech = system.mechanism
    found: dict[str, list[str]] = {
        "switches": [switch.name for switch in mech.switches],
        "velocity rows": [mech.row_names[i] for i, positional in enumerate(mech.positional) if not positional],
        "events": [reset.name for reset in mech.resets],
        "states": list(mech.states),
        "closure friction": [interface.force.name for interface in system.closure_friction.interfaces],
    }
    return {kind: ", ".join(map(repr, dict.fromkeys(names))) for kind, names in found.items() if names}
