"""Where the function is that shows a result, for each kind of result and each form.

`report` writes text and HTML, `plot` draws; both read results, so that results cannot import them.
They ask `lazy.render` instead, which knows this table from `flexspline/__init__.py` on.
"""

from __future__ import annotations

from flexspline.lazy import register

__all__ = ["RENDERERS", "register_renderers"]

RENDERERS = {
    ("log", "figure"): "flexspline.plot.channels:plot_log",
    ("fit", "text"): "flexspline.report.text:fit_text",
    ("fit", "html"): "flexspline.report.html:fit_html",
    ("fit", "report"): "flexspline.report.html:write_report",
    ("fit", "figure"): "flexspline.plot:plot_fit",
    ("fit", "summary"): "flexspline.report.text:fit_summary",
    ("profile", "figure"): "flexspline.plot:plot_profile",
    ("contour", "figure"): "flexspline.plot:plot_contour",
    ("parameters", "text"): "flexspline.report.text:parameters_text",
    ("parameters", "html"): "flexspline.report.text:parameters_html",
    ("calibration", "text"): "flexspline.report.calibration:calibration_text",
    ("calibration", "html"): "flexspline.report.calibration:calibration_html",
    ("calibration", "report"): "flexspline.report.calibration:write_calibration_report",
    ("calibration", "figure"): "flexspline.plot.sensor:plot_calibration",
    ("comparison", "text"): "flexspline.report.comparison:comparison_text",
    ("comparison", "html"): "flexspline.report.comparison:comparison_html",
    ("comparison", "report"): "flexspline.report.comparison:write_comparison_report",
    ("comparison", "figure"): "flexspline.plot.comparison:plot_comparison",
    ("models", "text"): "flexspline.report.comparison:models_text",
    ("models", "html"): "flexspline.report.comparison:models_html",
    ("models", "report"): "flexspline.report.comparison:write_models_report",
    ("models", "figure"): "flexspline.plot.comparison:plot_models",
    ("discovery", "text"): "flexspline.report.discovery:discovery_text",
    ("discovery", "html"): "flexspline.report.discovery:discovery_html",
    ("discovery", "report"): "flexspline.report.discovery:write_discovery_report",
    ("discovery", "figure"): "flexspline.plot.discovery:plot_discovery",
    ("fleet", "text"): "flexspline.report.fleet:fleet_text",
    ("fleet", "html"): "flexspline.report.fleet:fleet_html",
    ("fleet", "summary"): "flexspline.report.fleet:fleet_summary",
    ("fleet", "report"): "flexspline.report.fleet:write_fleet_report",
    ("fleet", "figure"): "flexspline.plot.fleet:plot_fleet",
    ("fleet_discovery", "text"): "flexspline.report.fleet:discovery_of_fleet_text",
    ("fleet_discovery", "html"): "flexspline.report.fleet:discovery_of_fleet_html",
    ("fleet_discovery", "report"): "flexspline.report.fleet:write_discovery_of_fleet",
    ("fleet_comparison", "text"): "flexspline.report.fleet:comparison_of_fleet_text",
    ("fleet_comparison", "html"): "flexspline.report.fleet:comparison_of_fleet_html",
    ("fleet_comparison", "report"): "flexspline.report.fleet:write_comparison_of_fleet",
    ("fleet_track", "text"): "flexspline.report.fleet:track_of_fleet_text",
    ("fleet_track", "html"): "flexspline.report.fleet:track_of_fleet_html",
    ("fleet_track", "report"): "flexspline.report.fleet:write_track_of_fleet",
    ("track", "text"): "flexspline.report.tracking:track_text",
    ("track", "html"): "flexspline.report.tracking:track_html",
    ("track", "report"): "flexspline.report.tracking:write_track_report",
    ("track", "figure"): "flexspline.plot.tracking:plot_track",
    ("estimate", "figure"): "flexspline.plot.estimate:plot_estimate",
    ("experiment", "figure"): "flexspline.plot.discovery:plot_plan",
    ("full range", "speed"): "flexspline.plot.estimate:error_over_speed",
    ("full range", "validation"): "flexspline.plot.estimate:validation",
    ("full range", "torque"): "flexspline.plot.estimate:torque_by_method",
    ("order analysis", "axes"): "flexspline.plot.orders:draw_found",
    ("order spectrum", "axes"): "flexspline.plot.orders:draw_orders",
    ("time spectrum", "axes"): "flexspline.plot.orders:draw_frequencies",
}


def register_renderers() -> None:
    """Let every result find what shows it."""
    for (kind, form), home in RENDERERS.items():
        register(kind, form, home)
