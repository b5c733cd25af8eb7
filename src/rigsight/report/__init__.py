"""Reports: self-contained HTML pages, and summaries for the terminal."""

from rigsight.report.comparison import ComparisonFigure as ComparisonFigure
from rigsight.report.comparison import comparison_figures as comparison_figures
from rigsight.report.comparison import comparison_summary as comparison_summary
from rigsight.report.comparison import render_comparison as render_comparison
from rigsight.report.identification import identification_summary as identification_summary
from rigsight.report.render import render_report as render_report
from rigsight.report.terminal import summary as summary
