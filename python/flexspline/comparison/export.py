"""`comparison.json`: the same numbers for scripts, by the contract of the command line."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from flexspline.about import __version__
from flexspline.comparison.bands import OrderPeak
from flexspline.comparison.says import floor_sentence
from flexspline.prepared import bandwidth_used, inputs_json
from flexspline.schema import checked_json

if TYPE_CHECKING:
    from flexspline.comparison.result import Comparison

__all__ = ["comparison_json"]

FORMAT = "flexspline-comparison"
VERSION = 1
ALWAYS = ("run", "speed", "direction", "position_order", "temperature", "load")
REVERSAL = ("reversal_time", "reversal_angle")


def comparison_json(made: Comparison) -> str:
    """Return the text of `comparison.json`, which fits its schema."""
    by = {name: [asdict(band) for band in bands] for name, bands in made.by.items()}
    content: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "made_by": f"flexspline {__version__}",
        "target": made.what,
        "unit": made.unit,
        "simulated": made.simulated,
        "lowpass": made.lowpass,
        "sentences": list(made.sentences),
        "noise_floor_method": floor_sentence(made),
        "runs": [_run(run.log) for run in made.runs],
        "overall": asdict(made.overall),
        **{name: by.get(name, []) for name in (*ALWAYS, *REVERSAL)},
        **{name: bands for name, bands in by.items() if name not in (*ALWAYS, *REVERSAL)},
        "position_order": [_peak(peak) for peak in made.orders],
        "units": dict(made.units),
        "load_source": made.load_source or None,
        "follows": [_follows(f) for f in made.follows],
        "makes_no_difference": list(made.makes_no_difference),
        "noise": asdict(made.memory),
        "simulation": made.foreign or None,
        "notes": list(made.notes),
        "inputs": inputs_json(made.inputs, made.preparations),
        "bandwidth_hz": bandwidth_used(made.preparations),
    }
    return checked_json(content, "comparison")


def _run(log: Any) -> dict[str, Any]:
    source = log.source
    return {
        "name": log.name,
        "rows": len(log),
        "path": source.path if source else None,
        "sha256": source.sha256 if source else None,
    }


def _peak(peak: OrderPeak) -> dict[str, Any]:
    """An order as a band: a sine of amplitude A has an RMS of A / √2, and its error likewise."""
    return {
        **asdict(peak),
        "also": list(peak.also),
        "rmse": peak.amplitude / 2**0.5,
        "variance": peak.amplitude**2 / 2,
        "bias": 0.0,
        "noise_floor": peak.error / 2**0.5,
    }


def _follows(found: Any) -> dict[str, Any]:
    made = asdict(found)
    made["also"] = list(found.also)
    return made
