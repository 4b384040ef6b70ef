"""Names of signals, for tests."""

from mbdae.solution.signals import units


def without_works(mech):
    """Units of the signals that a run has without being asked, by name: works of drivers and forces are integrated."""
    return {name: unit for name, unit in units(mech).items() if not name.startswith("work.")}
