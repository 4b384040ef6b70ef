"""Summary of the impacts of a run: participants, times, and the energy lost."""

from typing import NamedTuple

from ...solution.solution import Solution
from ...units import listed_times, quantity


class ImpactSummary(NamedTuple):
    """The impacts of a run.

    Attributes:
        names: participating stops, closures and drivers, each once.
        times: times in s.
        loss: energy lost in all impacts in J; negative if drivers added more.
    """

    names: tuple[str, ...]
    times: tuple[float, ...]
    loss: float

    def __str__(self) -> str:
        energy = f"{quantity(abs(self.loss), 'J', '.4g')} {'lost' if self.loss >= 0 else 'added by drivers'}"
        return f"impacts on {', '.join(self.names)}: {listed_times(self.times)}, {energy}"


def impact_summary(sol: Solution) -> ImpactSummary | None:
    """Return the summary of the impacts of a run, None without impacts."""
    if not sol.impacts:
        return None
    names = dict.fromkeys(name for x in sol.impacts for name in x.where)
    return ImpactSummary(tuple(names), tuple(x.t for x in sol.impacts), sum(x.loss for x in sol.impacts))
