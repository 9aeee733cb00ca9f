"""What people read of a fit: text, HTML, and tables of several fits."""

from flexspline.report.html import fit_html, write_report
from flexspline.report.tables import ScoreTable, compare_scores
from flexspline.report.text import fit_text

__all__ = ["ScoreTable", "compare_scores", "fit_html", "fit_text", "write_report"]
