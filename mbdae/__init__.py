"""mbdae: constrained mechanisms as index-2 DAEs, integrated by half-explicit Runge-Kutta methods and Radau IIA.

Names are imported on first use: importing Pinocchio, numpy and scipy takes a second, too long for completion on the
command line.
"""

from .cli import interrupt  # noqa: F401, before all slow imports

# isort: split
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from .discovery import class_names, public_names

if TYPE_CHECKING:  # names from `_modules_of_names`, for editors and type checkers
    from .errors import MbdaeError as MbdaeError
    from .integrate.events.event import Event as Event
    from .integrate.simulator.simulator import Simulator as Simulator
    from .integrate.solve import solve as solve
    from .mechanism import Closure as Closure
    from .mechanism import Clutch as Clutch
    from .mechanism import Driver as Driver
    from .mechanism import Function as Function
    from .mechanism import Input as Input
    from .mechanism import Mechanism as Mechanism
    from .mechanism import Reset as Reset
    from .mechanism import Stop as Stop
    from .mechanism import load as load
    from .mechanism import model_names as model_names
    from .mechanism.flexible import ModalBody as ModalBody
    from .mechanism.flexible import attach_flexible as attach_flexible
    from .mechanism.flexible import beam as beam
    from .mechanism.flexible.craig_bampton import modal_body as modal_body
    from .mechanism.flexible.finite_element_files import FiniteElements as FiniteElements
    from .mechanism.flexible.finite_element_files import read_finite_elements as read_finite_elements
    from .mechanism.flexible.modal_data import save_modal_body as save_modal_body
    from .mechanism.forces.actuator import Actuator as Actuator
    from .mechanism.forces.bushing import Bushing as Bushing
    from .mechanism.forces.coulomb_friction import CoulombFriction as CoulombFriction
    from .mechanism.forces.dc_motor import DCMotor as DCMotor
    from .mechanism.forces.fmu import FMU as FMU
    from .mechanism.forces.joint_damping import JointDamping as JointDamping
    from .mechanism.forces.joint_friction import JointFriction as JointFriction
    from .mechanism.forces.joint_pid import JointPID as JointPID
    from .mechanism.forces.joint_spring import JointSpring as JointSpring
    from .mechanism.forces.joint_torque import JointTorque as JointTorque
    from .mechanism.forces.sampled import Sampled as Sampled
    from .mechanism.forces.spring_damper import SpringDamper as SpringDamper
    from .mechanism.forces.wrench import Wrench as Wrench
    from .methods import METHODS as METHODS
    from .methods import Tableau as Tableau
    from .progress import progress_bar as progress_bar
    from .solution.solution import Solution as Solution
    from .studies.atlas.atlas import atlas as atlas
    from .studies.comparison.compare import compare as compare
    from .studies.drift.drift import drift as drift
    from .studies.ensemble.ensemble import ensemble as ensemble
    from .studies.ensemble.result import Ensemble as Ensemble
    from .studies.export.export import export as export
    from .studies.fit.fit import fit as fit
    from .studies.info.info import info as info
    from .studies.inverse.inverse import inverse_dynamics as inverse_dynamics
    from .studies.kinematics.assembly_modes import assembly_modes as assembly_modes
    from .studies.kinematics.kinematics import kinematics as kinematics
    from .studies.live.live import live as live
    from .studies.modes.linear_system import linearize as linearize
    from .studies.modes.modes import modes as modes
    from .studies.modes.root_locus import root_locus as root_locus
    from .studies.optimal_control.optimal_control import optimal_control as optimal_control
    from .studies.optimize.optimize import optimize as optimize
    from .studies.order.gradients import check_gradients as check_gradients
    from .studies.order.order import order as order
    from .studies.periodic.branch import periodic_branch as periodic_branch
    from .studies.periodic.periodic import periodic as periodic
    from .studies.replay.replay import animate as animate
    from .studies.report.report import report as report
    from .studies.schema.schema import schema as schema
    from .studies.sensitivity.cost import Squares as Squares
    from .studies.sensitivity.gradient import gradient as gradient
    from .studies.sensitivity.sensitivity import sensitivity as sensitivity
    from .studies.statics.equilibria import equilibria as equilibria
    from .studies.statics.equilibrium import equilibrium as equilibrium
    from .studies.statics.load_path import load_path as load_path
    from .studies.sweep.plan import Random as Random
    from .studies.sweep.sweep import sweep as sweep
    from .studies.sweep.table import Sweep as Sweep
    from .studies.tolerance.tolerance import tolerance as tolerance
    from .studies.view.view import view as view
    from .textbook.hessenberg import Hessenberg as Hessenberg
    from .textbook.mixed import MixedHessenberg as MixedHessenberg
    from .units import display_units as display_units

    __version__: str

_NAMES = {
    "errors": ["MbdaeError"],
    "integrate.events.event": ["Event"],
    "integrate.simulator.simulator": ["Simulator"],
    "integrate.solve": ["solve"],
    "mechanism.flexible": ["ModalBody", "attach_flexible", "beam"],
    "mechanism.flexible.craig_bampton": ["modal_body"],
    "mechanism.flexible.finite_element_files": ["FiniteElements", "read_finite_elements"],
    "mechanism.flexible.modal_data": ["save_modal_body"],
    "mechanism": [
        "Closure",
        "Clutch",
        "Driver",
        "Function",
        "Input",
        "Mechanism",
        "Reset",
        "Stop",
        "load",
        "model_names",
    ],
    "methods": ["METHODS", "Tableau"],
    "progress": ["progress_bar"],
    "solution.solution": ["Solution"],
    "textbook.hessenberg": ["Hessenberg"],
    "textbook.mixed": ["MixedHessenberg"],
    "units": ["display_units"],
}
_CORE = {name: f"mbdae.{module}" for module, names in _NAMES.items() for name in names}


@cache
def _modules_of_names() -> dict[str, str]:
    """Return the module of each public name: `_CORE`, force classes, and functions in ``__all__`` of studies."""
    forces = class_names("mbdae.mechanism.forces", "Force", "PythonForce")
    return _CORE | forces | public_names("mbdae.studies", "*/*.py")


def _value(name: str) -> Any:
    if name == "__all__":
        return sorted(_modules_of_names())
    if name == "__version__":
        return import_module("importlib.metadata").version("mbdae")
    if module := _CORE.get(name) or _modules_of_names().get(name):  # names that need no search first
        return getattr(import_module(module), name)
    if name[0].isupper():  # a force class from another package
        forces = import_module("mbdae.mechanism.forces").NAMES
        if name in forces:
            return forces[name]
    spec = None if name.startswith("_") else find_spec(f"mbdae.{name}")
    if spec and spec.origin:  # a module such as mbdae.backend, not a data folder
        return import_module(f"mbdae.{name}")
    raise AttributeError(f"module 'mbdae' has no attribute {name!r}")


if not TYPE_CHECKING:  # otherwise a type checker would accept every name of mbdae

    def __getattr__(name: str) -> Any:
        globals()[name] = value = _value(name)
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *_modules_of_names(), "__version__"})
