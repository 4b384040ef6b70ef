"""Names of signals, for tests."""

from mbdae.solution.signals import units


def without_work(mech):
    """Return units by name of the default signals of a run: without the work of single drivers and forces."""
    return {name: unit for name, unit in units(mech).items() if not name.startswith("work.")}
