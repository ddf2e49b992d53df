"""Figures: pure functions from arrays to plotly figures, a family a file."""

from rtcomp.report.figures.hysteresis import first_reversal, loop_figure, virgin_curve, virgin_figure
from rtcomp.report.figures.learning import Curve, learning_figure, overlay_figure
from rtcomp.report.figures.motion import force_figure, position_figure
from rtcomp.report.figures.timing import execution_figure, lateness_figure
from rtcomp.report.figures.tracking import Figures, error_bars_figure, rms_and_peak, tracking_figure

__all__ = [
    "Curve",
    "Figures",
    "error_bars_figure",
    "execution_figure",
    "first_reversal",
    "force_figure",
    "lateness_figure",
    "learning_figure",
    "loop_figure",
    "overlay_figure",
    "position_figure",
    "rms_and_peak",
    "tracking_figure",
    "virgin_curve",
    "virgin_figure",
]
