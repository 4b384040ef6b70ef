"""Energy and momentum of a conservative mechanism over a long time: which methods keep them, which come back?

With constant steps the energy error of the symplectic methods oscillates without a trend; that of half-explicit methods
and of Radau IIA grows in proportion to time, and that of generalized alpha faster, which damps high frequencies. Each
trend has a standard error. RATTLE keeps the angular momentum of the top to rounding. A run back from the end returns to
the start as far as rounding has not grown, if the method is symmetric; the error of others grows on both ways.

Run: python examples/long_time_energy.py
"""

from pathlib import Path

import mbdae
from mbdae.studies.drift.drift import Drift

METHODS = ("rattle4", "pherk6", "radau9", "alpha")
STEPS = {"four_bar": 0.025, "heavy_top": 0.002}  # s
SPANS = {"four_bar": 1000.0, "heavy_top": 100.0}  # s


def main(
    spans: dict[str, float] = SPANS, plot: str | Path | None = "long_time_energy.png"
) -> dict[tuple[str, str], Drift]:
    """Print trends of the energy, changes of momenta and errors of the way back."""
    out = {}
    print(
        f"{'model':10s} {'method':8s} {'max |E - E_0| / scale':>22s} {'trend (J/s)':>12s} {'standard error':>15s} "
        f"{'momentum':>9s} {'|dq| back':>10s}"
    )
    for model, step in STEPS.items():
        mech = mbdae.load(model)
        for method in METHODS:
            sol = mbdae.solve(mech, (0, spans[model]), method=method, step=step)
            d = out[model, method] = mbdae.drift(sol, long_time=True)
            changes = f"{max(d.momenta.values()):9.1e}" if d.momenta else f"{'-':>9s}"
            back = f"{d.reversal[0]:10.1e}" if d.reversal else f"{'-':>10s}"
            print(
                f"{model:10s} {method:8s} {d.energy_relative:22.1e} {d.energy_trend:12.1e} "
                f"{d.energy_trend_error:15.1e} {changes} {back}"
            )
    if plot:
        draw(out, plot)
    return out


def draw(found: dict[tuple[str, str], Drift], path: str | Path) -> None:
    """Draw the energy of the linkage over time; and changes of momentum and errors after the way back, by method."""
    from mbdae.studies.figures import WIDTH, empty_figure, line_style, logarithmic, positive, save, styled

    @styled
    def figure() -> None:
        out = empty_figure(WIDTH, 2.7)
        left, right = out.subplots(1, 2, width_ratios=(1.2, 1))
        for (model, method), d in found.items():
            if model == "four_bar":
                h = d.history
                left.plot(h.t, positive(h.energy), **line_style(method), markevery=max(1, len(h.t) // 8), label=method)
            rows = {f"momentum,\n{model}": max(d.momenta.values(), default=0.0) if d.momenta else 0.0,
                    f"$q$ after the way\nback, {model}": d.reversal[0] if d.reversal else 0.0}  # fmt: skip
            for name, x in rows.items():
                if x > 0:
                    right.plot([x], [name.replace("_", "-")], **line_style(method) | {"linestyle": "none"})
        left.set(xlabel="$t$ (s)", ylabel="$|E - E_0|$ / scale, four-bar")
        right.set(xlabel="relative change; error in rad, m")
        logarithmic(left.yaxis)
        logarithmic(right.xaxis, 5)
        right.margins(y=0.2)
        out.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=len(METHODS))
        save(out, path)

    figure()


if __name__ == "__main__":
    main()
