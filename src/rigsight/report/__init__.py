"""Reports: self-contained HTML pages, and summaries for the terminal."""

from __future__ import annotations

from rigsight.report.comparison import comparison_summary as comparison_summary
from rigsight.report.comparison import render_comparison as render_comparison
from rigsight.report.drawing.comparison_figures import ComparisonFigure as ComparisonFigure
from rigsight.report.drawing.comparison_figures import comparison_figures as comparison_figures
from rigsight.report.identification import identification_summary as identification_summary
from rigsight.report.render import render_report as render_report
from rigsight.report.terminal import summary as summary

__all__ = [
    "ComparisonFigure",
    "comparison_figures",
    "comparison_summary",
    "identification_summary",
    "render_comparison",
    "render_report",
    "summary",
]
