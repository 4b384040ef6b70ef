"""Figures drawn from results; only this file and ``figure.py`` of each study import matplotlib.

Every figure uses the same colour and marker for a method, and the same line style for a formulation; axes have units;
legends are next to the data. They are designed for a page 18 cm wide, and are readable in greyscale.
"""

from collections.abc import Callable
from functools import wraps
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np

from ..errors import InputError
from ..file_io import PICTURE_SUFFIXES, atomic_write, find_latex

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

P = ParamSpec("P")
T = TypeVar("T")
WIDTH = 7.1  # inches: two columns of a journal
STYLE: Any = {  # matplotlib's keys
    "font.size": 8.5,
    "axes.labelsize": 8.5,
    "axes.titlesize": 9,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "lines.linewidth": 1.2,
    "lines.markersize": 4.5,
    "lines.markeredgewidth": 0.9,
    "figure.dpi": 200,  # slightly affects the width of characters
    "savefig.dpi": 200,
    "svg.hashsalt": "mbdae",
    "pdf.fonttype": 42,
}
STYLES = {  # a hue for a family, a shade and a marker for a method
    "herk1": ("#9ecae1", "."), "herk2": ("#6baed6", "<"), "herk3": ("#3182bd", "v"), "herk4": ("#2c6fbb", "p"),
    "herk5": ("#08306b", "s"),
    "pherk3": ("#fdae6b", ">"), "pherk4": ("#f16913", "H"), "pherk5": ("#d94801", "o"), "pherk6": ("#7f2704", "D"),
    "arnold4": ("#74c476", "8"), "hedop5": ("#238b45", "^"),
    "radau1": ("#bcbddc", "1"), "radau3": ("#9e9ac8", "2"), "radau5": ("#6a51a3", "*"), "radau7": ("#54278f", "P"),
    "radau9": ("#3f007d", "X"),
    "kutta3": ("#c49c94", "+"), "rk4": ("#8c564b", "x"), "rule38": ("#a1887f", "d"),
    "rattle2": ("#fa9fb5", "<"), "rattle4": ("#f768a1", "o"), "rattle6": ("#c51b8a", "D"), "rattle8": ("#7a0177", "s"),
    "alpha": ("#01665e", "^"), "alpha_i3": ("#5ab4ac", "v"), "hht": ("#8c510a", "^"), "hht_i3": ("#d8b365", "v"),
    "midpoint": ("#fa9fb5", "1"), "gauss2": ("#f768a1", "2"), "gauss3": ("#ae017e", "*"), "radau_ia2": ("#dd3497", "P"),
    "lobatto_iiic2": ("#fcc5c0", "X"), "lobatto_iiic3": ("#7a0177", "8"), "sdirk2": ("#e7298a", "H"),
    "dop853": ("#000000", "P"), "ida": ("#b8860b", "*"),
    "RK45": ("#969696", "<"), "DOP853": ("#252525", "p"), "Radau": ("#636363", "X"), "LSODA": ("#525252", "h"),
}  # fmt: skip
DEFAULT_STYLE = ("#17becf", "d")
QUANTITY_NAMES = {  # names of quantities by unit
    "rad": "angles", "m": "positions", "1": "quaternions", "rad/s": "angular velocities", "m/s": "speeds",
    "J": "energies", "N": "forces", "N m": "torques", "W": "powers", "rad/s^2": "angular accelerations",
    "m/s^2": "accelerations", "kg m/s": "momentum", "kg m^2/s": "angular momentum", "m, rad": "residuals",
    "m/s, rad/s": "residual rates", "": "states",
}  # fmt: skip
PATTERNS = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (8, 2)))
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9")
SHORT_AXIS = 4.0  # ratio of limits below which an axis may contain at most one multiple of a power of ten
FORMULATION_LINES: dict[str, Any] = {
    "": "-", "project": (0, (6, 1.5)), "ggl": (0, (3, 1.5)), "index1": ":", "baumgarte": "-.",
}  # fmt: skip


def line_style(name: str) -> dict[str, Any]:
    """Return colour, marker and line style of a method in a formulation, ``"pherk5"`` or ``"ggl:pherk5"``."""
    prefix, _, method = name.rpartition(":")
    colour, marker = STYLES.get(method, DEFAULT_STYLE)
    face = colour if not prefix else "white"
    line = FORMULATION_LINES[prefix.partition("=")[0]]
    return {"color": colour, "marker": marker, "markerfacecolor": face, "linestyle": line}


def styled(draw: Callable[P, T]) -> Callable[P, T]:
    """Draw with `STYLE` over matplotlib's defaults, independent of the user's settings."""

    @wraps(draw)
    def inner(*args: P.args, **kwargs: P.kwargs) -> T:
        import matplotlib

        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(STYLE)
            return draw(*args, **kwargs)

    return inner


def fixed_layout(draw: Callable[P, "Figure"]) -> Callable[P, "Figure"]:
    """Like `styled`, with the layout computed once, so that repeated saves give identical files."""

    @wraps(draw)
    def inner(*args: P.args, **kwargs: P.kwargs) -> "Figure":
        figure = draw(*args, **kwargs)
        figure.get_layout_engine().execute(figure)  # type: ignore[union-attr]  # set by `empty_figure`
        figure.set_layout_engine(None)  # with a placeholder, each save would draw the figure twice
        return figure

    return styled(inner)


def empty_figure(width: float, height: float) -> "Figure":
    """Return an empty figure, in inches, with room for legends outside its axes and a notebook representation."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    class NotebookFigure(Figure):
        def _repr_svg_(self) -> str:
            return svg(self).decode()

    return NotebookFigure(figsize=(width, height), layout=ConstrainedLayoutEngine(w_pad=0.06))


def escaped(text: str) -> str:
    """Return a user's text with dollar signs escaped, so that they do not start a formula."""
    return text.replace("$", r"\$")


def logarithmic(axis: "Axis", labels: int = 9) -> None:
    """Make an axis logarithmic with at most ``labels`` labels: at powers of ten, or also in between on a short axis."""
    from matplotlib.ticker import LogFormatterSciNotation, LogLocator, MaxNLocator

    class Minor(LogLocator):
        """Multiples of powers of ten; round numbers instead if there are too few of them."""

        def tick_values(self, vmin: float, vmax: float) -> Any:
            short = vmin > 0 and vmax < SHORT_AXIS * vmin
            return (
                MaxNLocator(4, steps=[1, 2, 5, 10]).tick_values(vmin, vmax)
                if short
                else super().tick_values(vmin, vmax)
            )

    axis.axes.set(**{f"{axis.axis_name}scale": "log"})  # type: ignore[attr-defined]
    axis.set_major_locator(LogLocator(numticks=labels))
    axis.set_minor_locator(Minor(subs=tuple(range(2, 10)), numticks=labels))
    axis.set_minor_formatter(LogFormatterSciNotation(minor_thresholds=(1.3, 0.4)))


def curve_style(i: int) -> dict[str, Any]:
    """Return colour and line style of the i-th of several curves."""
    colour = COLOURS[i % len(COLOURS)]
    return {"color": colour, "markerfacecolor": colour, "linestyle": PATTERNS[i % len(PATTERNS)]}


def positive(values: np.ndarray) -> np.ndarray:
    """Return values for a logarithmic axis, with nan in place of values that are not positive."""
    return np.where(values > 0, values, np.nan)


def legend_right(ax: "Axes", **options: Any) -> None:
    """Add a legend to the right of the axes, at the top."""
    ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1.02), borderaxespad=0.0, **options)


@styled
def save(figure: "Figure", path: str | Path) -> None:
    """Write a figure as .png, .svg or .pdf, or as .pgf for LaTeX, with the fonts of the document.

    Raises:
        InputError: for another format or an unwritable path; for .pgf without LaTeX, or texts that it cannot set.
    """
    check_format(path)
    with atomic_write(path) as temporary:
        if temporary.suffix == ".pgf":
            _save_pgf(figure, temporary)
        else:
            figure.savefig(temporary, metadata=_undated(temporary.suffix))


def _save_pgf(figure: "Figure", path: Path) -> None:
    import matplotlib
    from matplotlib.backends.backend_pgf import LatexError

    program = find_latex()
    matplotlib.rcParams.update({"pgf.texsystem": program, "pgf.rcfonts": False})
    try:
        figure.savefig(path)
    except (LatexError, ValueError, RuntimeError) as e:
        raise InputError(f"{program} cannot measure the texts of a .pgf figure: {str(e).splitlines()[0]}") from None


def save_if_path(figure: "Figure", path: str | Path | None) -> "Figure":
    """Return a figure, saved if a path is given, see `save`."""
    if path is not None:
        save(figure, path)
    return figure


def svg(figure: "Figure") -> bytes:
    """Return a figure as SVG."""
    return _bytes(figure, ".svg")


def png(figure: "Figure") -> bytes:
    """Return a figure as PNG."""
    return _bytes(figure, ".png")


@styled
def _bytes(figure: "Figure", suffix: str) -> bytes:
    file = BytesIO()
    figure.savefig(file, format=suffix[1:], metadata=_undated(suffix))
    return file.getvalue()


def check_format(path: str | Path) -> None:
    """Reject a path that is not a figure format.

    Raises:
        InputError: naming the valid formats.
    """
    if Path(path).suffix not in PICTURE_SUFFIXES:
        raise InputError(f"a figure is saved as {', '.join(PICTURE_SUFFIXES)}, got {str(path)!r}")


def _undated(suffix: str) -> dict[str, None]:
    """Return metadata without a date, so that the same figure gives the same file."""
    return {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(suffix, {})
