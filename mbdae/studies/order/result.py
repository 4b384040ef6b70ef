"""What an order study found: a slope for each quantity of each method."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Slope:
    """One quantity of one method.

    Attributes:
        quantity: q, v, own lam or lam (hidden constraint); y, own z or z of a textbook problem.
        claimed: the method's claim.
        observed: fitted slope, None when it cannot be judged.
        verdict: ``"holds"`` (observed >= claimed - 0.2), ``"misses"`` or the reason why it cannot be judged.
        steps: numbers of steps that were tried.
        errors: the errors there.
        floors: 100 times the uncertainty and rounding floor there.
        fitted: first and last plus one of the errors that the slope is fitted to.
    """

    quantity: str
    claimed: int
    observed: float | None
    verdict: str
    steps: tuple[int, ...]
    errors: tuple[float, ...]
    floors: tuple[float, ...]
    fitted: tuple[int, int] = (0, 0)

    @property
    def judged(self) -> bool:
        """True when a slope could be fitted."""
        return self.observed is not None


@dataclass(frozen=True)
class OrderStudy:
    """Result of `check_order`.

    Attributes:
        title: of the problem.
        T: end time in s.
        slopes: by method.
        backend: of all runs.
        because: what keeps them from the compiled core, in words; "" where nothing does.
    """

    title: str
    T: float
    slopes: dict[str, tuple[Slope, ...]]
    backend: str = "python"
    because: str = ""

    @property
    def holds(self) -> bool:
        """True when every slope was judged and reaches its claim."""
        return all(s.verdict == "holds" for row in self.slopes.values() for s in row)

    @property
    def refuted(self) -> bool:
        """True when some observed order misses its claim."""
        return any(s.verdict == "misses" for row in self.slopes.values() for s in row)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        slopes = {name: [asdict(s) for s in row] for name, row in self.slopes.items()}
        return {
            "title": self.title,
            "T": self.T,
            "backend": self.backend,
            "because": self.because,
            "holds": self.holds,
            "refuted": self.refuted,
            "methods": slopes,
        }

    def plot(self, path: str | Path) -> None:
        """Draw the errors over the step with the fitted and the claimed slopes as .png, .svg or .pdf.

        Raises:
            InputError: for another format or an unwritable path.
        """
        from .. import figures
        from .figure import convergence

        figures.save(convergence(self), path)

    def __str__(self) -> str:
        because = f" ({self.because})" if self.because else ""
        lines = [f"observed (claimed) order, {self.title}, T = {self.T:g} s, {self.backend} back end{because}"]
        for name, row in self.slopes.items():
            cells = [
                f"{s.quantity} {s.observed:.2f} ({s.claimed})" if s.judged else f"{s.quantity} - ({s.claimed})"
                for s in row
            ]
            bad = [f"{s.quantity}: {s.verdict}" for s in row if s.verdict != "holds"]
            lines.append(f"{name:8s} " + "  ".join(cells) + ("  " + "; ".join(bad) if bad else ""))
        return "\n".join(lines)
