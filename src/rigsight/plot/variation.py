"""Figure of a frequency response for several values of a parameter: one curve per value, magnitude above phase."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rigsight.plot.drawing import in_style, new_figure, plain_log_ticks

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LINES = ("-", (0, (6, 1.5)), (0, (3, 1.2)), (0, (5, 1.2, 1, 1.2)), (0, (1, 1.2)))
_LIGHTEST = 0.84
"""Share of the color map that is still seen on white."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One frequency response of the picture."""

    label: str  # for the legend
    values: NDArray[np.complex128]  # complex, shape (n_frequencies,)
    is_base: bool = False  # true for the model as it is; drawn black and wider


@in_style
def varied_responses(
    omega: NDArray[np.float64], curves: Sequence[Curve], pair: str, unit: str, title: str
) -> Figure:
    """Draw magnitude [dB] and phase [deg] over angular frequency, one color and line style per curve."""
    import matplotlib as mpl

    figure = new_figure(7.4, 5.0)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    colors = mpl.colormaps["cividis"](np.linspace(0.0, _LIGHTEST, max(len(curves), 2)))
    for i, curve in enumerate(curves):
        style = {
            "color": "black" if curve.is_base else colors[i],
            "linewidth": 2.2 if curve.is_base else 1.4,
            "linestyle": "-" if curve.is_base else _LINES[i % len(_LINES)],
            "zorder": 3 if curve.is_base else 2,
        }
        with np.errstate(divide="ignore"):
            top.plot(omega, 20.0 * np.log10(np.abs(curve.values)), label=curve.label, **style)
        bottom.plot(omega, np.degrees(np.unwrap(np.angle(curve.values))), **style)
    top.set_title(title)
    top.set_ylabel(f"magnitude {pair} [dB of 1 {unit}]")
    bottom.set_ylabel("phase [\u00b0]")
    bottom.set_xlabel("angular frequency [rad/s]")
    bottom.set_xscale("log")
    bottom.set_xlim(float(omega[0]), float(omega[-1]))
    plain_log_ticks(bottom, float(omega[0]), float(omega[-1]))
    low = float(np.floor(min(line.get_ydata().min() for line in bottom.lines) / 45.0)) * 45.0
    high = float(np.ceil(max(line.get_ydata().max() for line in bottom.lines) / 45.0)) * 45.0
    bottom.set_yticks(np.arange(low, high + 1.0, 45.0 if high - low <= 360.0 else 90.0))
    for ax in (top, bottom):
        ax.grid()
    figure.align_ylabels()
    figure.legend(loc="outside right upper", fontsize=8.5)
    return figure


def picture_files(figure: Figure) -> dict[str, bytes]:
    """Return the picture as ``svg`` and ``png``, by ending."""
    import io

    from rigsight.plot.drawing import style, svg_text

    png = io.BytesIO()
    with style():
        figure.savefig(png, format="png", dpi=150)
    return {"svg": svg_text(figure, "vary").encode("utf-8"), "png": png.getvalue()}
