"""Real-time simulation of a mechanism in a browser, with sliders for inputs, joints and lengths, and pulled points."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from ...errors import as_list
from ...integrate.options.options import require_positive
from ...solution.problem import mechanism_of
from .dimensions import Dimensions, require_within
from .live_view import LiveView, ViewSettings

if TYPE_CHECKING:
    from ...mechanism import Mechanism, ModelSource

__all__ = ["live"]

RTOL_DEFAULT = 1e-6


def live(
    model: "Mechanism | ModelSource",
    *,
    method: str | None = None,
    step: float | None = None,
    rtol: float | None = None,
    speed: float = 1.0,
    fps: float = 60.0,
    ranges: Mapping[str, Sequence[float]] | None = None,
    parameters: Mapping[str, Sequence[float]] | None = None,
    traces: str | Sequence[str] = (),
    port: int | None = None,
    paused: bool = False,
    shadows: bool = False,
    record: bool = True,
) -> LiveView:
    """Simulate a mechanism in real time, and show it in a browser with sliders for its inputs and joints.

    Sliders of parameters change lengths and other dimensions: the loops are closed again, with the same free
    coordinates, and the paths of traced frames are drawn again, while a slider is dragged.

    The page is meshcat's, served on this computer. The slider of an input sets it; that of a joint pulls the joint by
    a critically damped spring of frequency w = 20 rad/s; a drag that begins on a body pulls its point,

        f = m (w^2 (target - p) - 2 w p').

    Args:
        model: a mechanism, or the name or path of one.
        method: name of a method; that of the model if omitted.
        step: fixed step in s; controlled if omitted.
        rtol: relative tolerance of controlled steps; 1e-6 if omitted.
        speed: seconds of motion per second.
        fps: maximum number of frames per second.
        ranges: low and high ends of sliders of inputs and joints, motor=-5,5; by default limits of joints, or wide
            ranges.
        parameters: low and high ends of sliders of parameters, by dotted name, frame.rod_tip.xyz.0=0.2,0.4.
        traces: frames whose paths are drawn over the first free coordinate, with the remaining ones locked.
        port: port of the page; by default the first free port from 7000.
        paused: whether the simulation is paused until it is started in the page.
        shadows: whether bodies cast shadows, which slows drawing.
        record: whether all steps are stored for `LiveView.stop`; if not, memory does not grow.

    Returns:
        The running view, with its ``url``; `LiveView.stop` ends it.

    Raises:
        UnknownNameError: for an unknown method, parameter or frame, or a range with an unknown name.
        InputError: for wrong arguments, parameters of a mechanism that was not read from files, a start that cannot be
            simulated, or a port in use.

    Example:
        >>> view = mbdae.live("slider_crank")   # doctest: +SKIP
        >>> sol = view.stop()   # doctest: +SKIP
    """
    require_positive(speed=speed, fps=fps)
    mech = mechanism_of(model, "live")
    rtol = RTOL_DEFAULT if rtol is None and step is None else rtol
    dimensions = Dimensions(mech, parameters or {}, as_list(traces, "traces is a list of frames"))
    require_within(dimensions)
    solver = {"method": method, "step": step, "rtol": rtol}
    return LiveView(dimensions, ViewSettings(speed, fps, port, not paused, record, shadows, ranges or {}, solver))
