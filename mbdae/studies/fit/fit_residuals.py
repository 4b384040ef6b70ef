"""Residuals between measurements and runs, and their exact derivatives."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...callbacks import values_text
from ...errors import InputError, MbdaeError, UnknownNameError, is_number
from ...integrate.options.span import checked_span
from ...integrate.solve import solve
from ...integrate.trajectory.differentiable_runs import has_jumps
from ...integrate.trajectory.signal_jacobian import differentiable
from ...mechanism import Mechanism
from ...solution.signals import signals as computed_signals
from ...solution.signals import units as signal_units
from ...solution.solution import Solution, uninterrupted
from ...system import Array
from ..data_files import check_headings
from ..factories import MechanismFactory
from ..sensitivity.run_parameters import VaryingParameters
from ..sensitivity.sensitivity import trajectory_sensitivity
from .data import Recording

VALUES_PER_PARAMETER = 3  # minimum number of measured values in a span


class FitResiduals:
    """Residuals of all runs and their derivatives, for the first ``fraction`` of the samples."""

    def __init__(
        self,
        factory: MechanismFactory,
        names: list[str],
        recordings: list[Recording],
        known: list[dict[str, float]],
        sigma: float | Mapping[str, float] | None,
        t_span: float | Sequence[float] | None,
        settings: dict[str, Any],
    ) -> None:
        self.factory, self.names, self.recordings, self.known = factory, names, recordings, known
        self.noise_known, self.fraction, self.runs, self.gradients = sigma is not None, 1.0, 0, 0
        self.parameters = [VaryingParameters(_FixedParameters(factory, table)) for table in known]
        self.settings = settings
        latest = max(float(r.t[-1]) for r in recordings)
        start, end = checked_span((0.0, latest) if t_span is None else t_span, may_be_empty=True)
        self.start = start
        for r in recordings:
            outside = r.t[(r.t < start) | (r.t > end)]
            if len(outside):
                raise InputError(f"{r.name}: t = {outside[0]:g} s is outside the span, {start:g} to {end:g} s")
        self.sigma = _noise_levels(sigma, [name for r in recordings for name in r.columns])
        self._cached: tuple[tuple[tuple[float, ...], float] | None, list[Solution]] = (None, [])
        self._size, self._derivatives = 0, dict[tuple[tuple[float, ...], float], Array]()
        self.rejected, self.all_rejected = list[str](), list[str]()  # of the current search, and of all

    def span_fractions(self, spans: Sequence[float], k: int) -> list[float]:
        """Return the fractions within which each run has enough measured values for k parameters, then 1 for all."""
        if not isinstance(spans, Sequence) or not all(is_number(s) and 0 < s <= 1 for s in spans):
            raise InputError(f"spans are fractions of the samples between 0 and 1, got {spans!r:.60}")
        fewest = VALUES_PER_PARAMETER * k
        return [*(s for s in sorted(set(spans)) if s < 1 and self._count_values(s) >= fewest), 1.0]

    def _count_values(self, fraction: float) -> int:
        """Return the smallest number of measured values of a run after its start, which depends on few parameters."""
        counts = []
        for r in self.recordings:
            n = _sample_count(r, fraction)
            counts.append(sum(int(np.isfinite(x[:n][r.t[:n] > self.start]).sum()) for x in r.columns.values()))
        return min(counts)

    def simulate(self, x: Array) -> list[Solution]:
        """Return a run for each recording with parameters x (k,), cached for the last x.

        Raises:
            InputError, MbdaeError: for a run that fails.
        """
        key = (tuple(x), self.fraction)
        if self._cached[0] != key:
            values, out = dict(zip(self.names, map(float, x), strict=True)), []
            for recording, known in zip(self.recordings, self.known, strict=True):
                mech = self.factory.make({**known, **values})
                times = recording.t[: _sample_count(recording, self.fraction)]
                span = (self.start, float(times[-1]))
                for name in recording.columns:
                    differentiable(mech, name)
                check_headings(recording.name, recording.units, signal_units(mech))
                has_duration = times[-1] > self.start
                sol = uninterrupted(solve(mech, span, t_eval=times, **self.settings)) if has_duration else None
                if sol is None or not sol.ended:
                    reason = f"with {values_text(values)}, {sol.message}" if sol else "no time passes"
                    raise InputError(f"{recording.name}: {reason}")
                self.runs += 1
                out.append(sol)
            self._cached = key, out
        return self._cached[1]

    def residuals(self, x: Array) -> Array:
        """Return (signal - data)/sigma of all measured values; inf if a run fails or has no derivative."""
        try:
            runs = self.simulate(x)
            blocks = [self.run_residuals(recording, computed_signals(sol, recording.columns), len(sol.t))
                      for recording, sol in zip(self.recordings, runs, strict=True)]  # fmt: skip
            if any(has_jumps(sol) for sol in runs):
                self.jacobian(x)
        except MbdaeError as e:
            if not self._size:
                raise
            self.rejected.append(str(e))
            self.all_rejected.append(str(e))
            return np.full(self._size, np.inf)
        out = np.concatenate(blocks)
        self._size = len(out)
        return out

    def run_residuals(self, recording: Recording, computed: Mapping[str, Array], n: int) -> Array:
        """Return residuals of one run at its first n times, signals concatenated, without missing values."""
        columns = recording.columns
        out = np.concatenate([(computed[name] - data[:n]) / self.sigma[name] for name, data in columns.items()])
        return out[~np.isnan(np.concatenate([data[:n] for data in columns.values()]))]

    def signal_indices(self) -> Array:
        """Return the index of the signal of each residual of all samples, (n,)."""
        columns = [(name, data) for recording in self.recordings for name, data in recording.columns.items()]
        index = {name: i for i, name in enumerate(dict.fromkeys(name for name, _ in columns))}
        return np.repeat([index[name] for name, _ in columns], [np.count_nonzero(~np.isnan(x)) for _, x in columns])

    def jacobian(self, x: Array) -> Array:
        """Return derivatives of the residuals, (n, k), cached for the last x.

        Raises:
            InputError, MbdaeError: for a run that fails or has no derivative.
        """
        key = (tuple(x), self.fraction)
        if key not in self._derivatives:
            self._derivatives = {key: self._computed_derivatives(x)}
        return self._derivatives[key]

    def _computed_derivatives(self, x: Array) -> Array:
        values, rows = dict(zip(self.names, map(float, x), strict=True)), []
        for recording, parameters, sol in zip(self.recordings, self.parameters, self.simulate(x), strict=True):
            found = trajectory_sensitivity(parameters.trajectory(sol, values))
            self.gradients += 1
            n = len(sol.t)
            block = np.vstack([found.signal(name) / self.sigma[name] for name in recording.columns])
            rows.append(block[~np.isnan(np.concatenate([data[:n] for data in recording.columns.values()]))])
        J = np.vstack(rows)
        if not np.isfinite(J).all():
            raise InputError("derivatives of a run are not finite: it diverges; use a smaller step")
        return J


def _sample_count(recording: Recording, fraction: float) -> int:
    return max(1, round(fraction * len(recording.t)))


class _FixedParameters:
    """Mechanism factory with some parameters fixed."""

    def __init__(self, factory: MechanismFactory, known: Mapping[str, float]) -> None:
        self.base, self.known = factory, known

    def make(self, values: Mapping[str, object]) -> Mechanism:
        """Return the mechanism with these values and the fixed parameters."""
        return self.base.make({**self.known, **values})


def _noise_levels(sigma: float | Mapping[str, float] | None, names: list[str]) -> dict[str, float]:
    """Return the noise levels of the measured signals.

    Raises:
        InputError: for a level that is missing or not positive.
        UnknownNameError: for a level of a signal that was not measured.
    """
    levels = sigma if isinstance(sigma, Mapping) else dict.fromkeys(names, 1.0 if sigma is None else sigma)
    for name in names:
        level = levels.get(name)
        if not (is_number(level) and level > 0):
            raise InputError(f"the noise level of {name!r} must be given and positive: sigma={{{name!r}: ...}}")
    if unused := [name for name in levels if name not in names]:
        raise UnknownNameError("measured signal in sigma", unused[0], names)
    return {name: float(levels[name]) for name in names}
