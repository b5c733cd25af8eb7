"""A diagnosis for people: one self-contained HTML page, and a summary for the terminal."""

from __future__ import annotations

from rigsight.report.identification import identification_summary as identification_summary
from rigsight.report.render import render_report as render_report
from rigsight.report.terminal import summary as summary

__all__ = ["identification_summary", "render_report", "summary"]
