"""The motion of a model in a benchmark: its reference, its number of fixed steps, and the methods that suit it."""

import atexit
import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ...data_types import JsonObject
from ...errors import InputError, MbdaeError
from ...integrate.run.run_setup import common_backend
from ...mechanism import Mechanism, load
from ...solution.archive import problem_data
from ...tolerances import SUM_ROUNDING
from ..comparison.compare import REFERENCE, motion_of
from ..comparison.comparison_runs import without_geometry
from ..comparison.reference_motion import ReferenceMotion, Samples, Trial
from ..comparison.selection import all_variants, suitable
from ..drift.drift import drift
from ..method_variant import Variant, variants
from ..workers import Stop

OUTPUTS = 20  # common times of errors, as in `mbdae.compare`
MAX_STEPS = 20_000  # steps of a run
PROBE = "radau5"  # the steps of its run are the coarsest number of fixed steps
RUN_TOLERANCES = {"reference": 1e-12, PROBE: 1e-3}  # rtol; that of the reference as in `mbdae.compare`
LOADED = 4  # number of mechanisms in the cache of a worker


@dataclass(frozen=True)
class Settings:
    """Settings of all runs of a benchmark.

    Attributes:
        methods: names of variants; empty for all.
        rtol: relative tolerances, the loosest first.
        refinements: numbers of fixed steps as multiples of the coarsest one of a model.
        backend: back end of all runs, ``"native"`` or ``"python"``.
    """

    methods: tuple[str, ...]
    rtol: tuple[float, ...]
    refinements: tuple[int, ...]
    backend: str


@dataclass(frozen=True)
class ModelMotion:
    """The motion of a model from its start, over its duration.

    Attributes:
        model: name or path.
        key: hash of the mechanism.
        title: title of the mechanism.
        duration: duration of the motion in s.
        steps: the coarsest number of fixed steps, a multiple of the number of common times.
        conservative: whether all forces derive from potentials, and no discrete mode switches.
        reference: the reference run, in words.
        cross_check: the run that checks it, in words.
        uncertainty: largest difference between these two, by quantity.
        samples: samples of the reference by quantity, lists of lists.
        methods: names of the variants that suit the model.
        omitted: reasons why other variants do not, by name.
        failure: why the model has no runs; "" if it has.
    """

    model: str
    key: str
    title: str = ""
    duration: float = 0.0
    steps: int = 0
    conservative: bool = False
    reference: str = ""
    cross_check: str = ""
    uncertainty: dict[str, float] = field(default_factory=dict)
    samples: dict[str, list] = field(default_factory=dict, repr=False)
    methods: tuple[str, ...] = ()
    omitted: dict[str, str] = field(default_factory=dict)
    failure: str = ""

    def to_dict(self) -> JsonObject:
        """Return JSON data, the arguments of the class."""
        return asdict(self)

    @classmethod
    def read(cls, data: Mapping[str, Any]) -> "ModelMotion":
        """Return the motion from JSON data."""
        return cls(**{**data, "methods": tuple(data["methods"])})

    @property
    def reference_samples(self) -> Samples:
        """Samples of the reference as arrays."""
        return {name: np.array(x, dtype=float) for name, x in self.samples.items()}


@dataclass(frozen=True)
class MotionTask:
    """The task of a worker to compute the motion of a model.

    Attributes:
        model: name or path.
        known: its motion in the data of the benchmark, if any.
    """

    model: str
    known: ModelMotion | None = None

    def __str__(self) -> str:
        return f"reference of {self.model}"

    def run(self, settings: Settings, stop: Stop | None) -> ModelMotion:
        """Return the motion, with the suitable methods among those of the settings.

        Raises:
            InputError: if the model has changed since.
        """
        mech = mechanism(self.model)
        key = hashlib.sha256(json.dumps(problem_data(mech), sort_keys=True).encode()).hexdigest()
        if self.known and self.known.key != key:
            raise InputError(f"{self.model} has changed since the atlas was begun: give another data file, or fresh")
        try:
            methods, omitted = _methods(mech, settings)
            known = self.known if self.known and not self.known.failure else None
            motion = known or _motion(self.model, key, mech, settings, stop)
            return replace(motion, methods=methods, omitted=omitted)
        except MbdaeError as e:
            return ModelMotion(self.model, key, mech.title, failure=str(e))


@lru_cache(LOADED)
def mechanism(model: str) -> Mechanism:
    """Return the mechanism of a model, without geometry."""
    return without_geometry(load(model))  # type: ignore[return-value]


atexit.register(mechanism.cache_clear)  # the core reports remaining objects as leaks when it is unloaded


def common_motion(mech: Mechanism, backend: str) -> ReferenceMotion:
    """Return the motion of all runs of a mechanism: from its start, over its duration."""
    return replace(motion_of(mech, None, None, None, OUTPUTS, MAX_STEPS), backend=backend)


def _methods(mech: Mechanism, settings: Settings) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the methods that suit a mechanism, and the reasons why others do not."""
    candidates: list[Variant] = variants(settings.methods) if settings.methods else all_variants()
    chosen, omitted = suitable(mech, candidates, True, settings.backend)
    common_backend(mech, [(v.formulation, v.baumgarte) for v in chosen], settings.backend)
    return tuple(map(str, chosen)), omitted


def _motion(model: str, key: str, mech: Mechanism, settings: Settings, stop: Stop | None) -> ModelMotion:
    """Return the motion of a mechanism, without its methods."""
    motion = common_motion(mech, settings.backend)
    probe = motion.solve(Trial(Variant(PROBE), RUN_TOLERANCES[PROBE]), stop)
    if not probe.ended:
        raise InputError(f"no number of fixed steps: {PROBE} ends with {probe.status}, {probe.message}")
    (reference, cross_check), samples, uncertainty = motion.reference(variants(REFERENCE), RUN_TOLERANCES["reference"])
    return ModelMotion(
        model, key, mech.title, mech.duration,
        steps=OUTPUTS * -(-probe.stats["steps"] // OUTPUTS),
        conservative=_conservative(mech, probe),
        reference=reference, cross_check=cross_check, uncertainty=uncertainty,
        samples={name: x.tolist() for name, x in samples.items()},
    )  # fmt: skip


def _conservative(mech: Mechanism, sol: Any) -> bool:
    """Return whether a run has energy, and nonconservative forces do no work."""
    scale = drift(sol).energy_scale or 0.0
    work = float(np.abs(sol.work - sol.work[0]).max())
    return not mech.switches and scale > 0 and work <= SUM_ROUNDING * scale
