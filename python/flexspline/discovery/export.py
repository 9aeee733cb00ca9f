"""`discovery.json`: the contract of the command line."""

from __future__ import annotations

import importlib.resources
import json
import math
from functools import cache
from typing import TYPE_CHECKING, Any

import jsonschema
import numpy as np

from flexspline import __version__

if TYPE_CHECKING:
    from flexspline.discovery.result import Discovery, Found
    from flexspline.fit.result import Parameter
    from flexspline.logs.channel_noise import ChannelNoise

__all__ = ["discovery_json"]

FORMAT = "flexspline-discovery"
VERSION = 1


def discovery_json(made: Discovery) -> str:
    """Return the text of `discovery.json`, which fits its schema."""
    left = made.unexplained
    content: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "made_by": f"flexspline {__version__}",
        "target": made.target,
        "unit": made.unit,
        "by": made.by,
        "base_effects": list(made.base_effects),
        "simulation": None if made.simulated is None else made.simulated.to_json(),
        "found": [_found(made, one) for one in made.found],
        "rmse": {
            "base": made.base_rmse,
            "final": made.final_rmse,
            "noise_floor": made.noise_floor,
        },
        "also_seen": [
            {
                "effect": one.effect,
                "rmse_before": one.rmse_before,
                "rmse_after": one.rmse_after,
                "rmse_unit": made.unit,
                "share_of_gap": one.share_of_gap,
                "t": one.t,
            }
            for one in made.also_seen
        ],
        "inputs": [_input(made, noise) for noise in made.inputs],
        "bandwidth_hz": _bandwidth(made),
        "rows": dict(made.rows),
        "validated_by": made.validated_by,
        "before_after": [
            {
                "group": part.group,
                "label": part.label,
                "rows": part.rows,
                "base": part.base,
                "final": part.final,
            }
            for part in made.slices
        ],
        "parameters": [_parameter(p) for p in made.fit.parameters],
        "simulated_rmse": None
        if made.motion is None
        else {
            "channel": made.motion.channel,
            "base": made.motion.base_rmse,
            "final": made.motion.final_rmse,
            "unit": made.motion.unit,
        },
        "data_faults": [
            {
                "name": fault.name,
                "channel": fault.channel,
                "size": _number(fault.size),
                "rows": list(fault.rows),
                "unit": fault.unit,
                "run": fault.run,
                "sentence": fault.sentence,
                "makes": None if fault.makes is None else _number(fault.makes),
                "grave": fault.grave,
                "left_out": fault.left_out,
            }
            for fault in made.data_faults
        ],
        "unexplained": None
        if left is None
        else {"share_of_variance": left.share_of_variance, "depends_on": list(left.depends_on)},
        "dependences": [
            {"channel": one.channel, "of": one.of, "left": one.left, "sentence": one.sentence}
            for one in made.dependences
        ],
        "next_experiment": made.next_experiment,
        "not_tried": dict(made.not_tried),
        "refused": dict(made.refused),
        "doubted": list(made.doubted),
        "searched": dict(made.searched),
    }
    jsonschema.Draft202012Validator(_schema()).validate(content)
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _found(made: Discovery, one: Found) -> dict[str, Any]:
    return {
        "effect": one.effect,
        "rmse_before": one.rmse_before,
        "rmse_after": one.rmse_after,
        "rmse_unit": made.unit,
        "share_of_gap": one.share_of_gap,
        "coefficients_p": one.coefficients_p,
        "confidence": one.confidence,
        "indistinguishable_from": list(one.indistinguishable_from),
        "where": one.where,
        "evidence": one.evidence,
        "runner_up": one.runner_up,
        "t": one.t,
        "parameters": [_parameter(p) for p in made.parameters(one.effect)],
    }


def _input(made: Discovery, noise: ChannelNoise) -> dict[str, Any]:
    """What a recorder added to a channel, and how it was prepared for the rows."""
    late = [f.size for f in made.data_faults if "delay" in f.name and f.channel == noise.channel]
    used = [p.bandwidth for p in made.fit.part.preparations if p.channel == noise.channel]
    return {
        "channel": noise.channel,
        "noise": noise.noise,
        "quantum": noise.quantum,
        "delay": _number(float(np.median(late))) if late else None,
        "bandwidth": noise.bandwidth,
        "bandwidth_used": used[0] if used else None,
    }


def _bandwidth(made: Discovery) -> float | None:
    """-3 dB of the output's motion as the rows read it, Hz; None where it is as recorded."""
    motion = (p for p in made.fit.part.preparations if p.channel == "output_velocity")
    return next((one.bandwidth for one in motion), None)


def _parameter(one: Parameter) -> dict[str, Any]:
    return {
        "name": one.name,
        "value": _number(one.value),
        "standard_error": _number(one.standard_error),
        "unit": one.unit,
        "state": one.state,
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


@cache
def _schema() -> dict[str, Any]:
    file = importlib.resources.files("flexspline") / "schemas" / "discovery.schema.json"
    content: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return content
