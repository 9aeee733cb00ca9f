"""Cases of exported models: texts without their sentences, parameter blocks, certificates.

Of a header, comments, version and the hash of the model are taken off; of a model's JSON what made
it. What a step does and holds is left.
"""

from __future__ import annotations

import json
import re
import shutil
import tempfile
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path

import chain_rig as rig
import device_chains
import measured
from every_effect import all_of, exported, rich

import flexspline as fx
from flexspline.effects import TARGETS
from flexspline.exporting import export
from golden.estimated_cases import iiwa_watched, kinova_watched, raw
from golden.measured_cases import ur10e_fit
from golden.numbers import Cases, NotRunError, Numbers, certificate_numbers, plain, sha

__all__ = ["exported_cases"]

Models = dict[str, Callable[[], fx.Model]]

HASH = re.compile(r"\b[0-9a-f]{64}\b")
COMMENT = re.compile(r"\s*//.*$", flags=re.MULTILINE)
VERSION = re.compile(r"flexspline \d+\.\d+\S*")
TOOLS = ("arm-none-eabi-g++", "qemu-system-arm")
ROWS = 3000


def exported_cases() -> Cases:
    """Return what computes the numbers of each case, by its name."""
    made: Cases = {f"export/{name}": partial(_texts, model) for name, model in _models().items()}
    for target in TARGETS:
        name = f"every effect of {target}"
        made[f"export/{name}"] = partial(_texts, partial(_every_effect, target))
        made[f"certify/{name}"] = partial(
            _certified, partial(_every_effect, target), lambda: rich(5, ROWS), "cortex-m4f"
        )
    chains = {
        "whole joint": (rig.whole_joint, "cortex-m4f"),
        "joint by its angles": (rig.angle_joint, "cortex-m4f"),
        "ten harmonics": (device_chains.ten_harmonics, "cortex-m4f"),
        "ten harmonics on a Cortex-M7": (device_chains.ten_harmonics, "cortex-m7"),
    }
    for name, (model, device) in chains.items():
        made[f"certify/{name}"] = partial(_certified, model, raw, device)
    made["certify/kinova"] = partial(
        _certified, kinova_watched, lambda: measured.kinova(0.3), "cortex-m4f"
    )
    return made


def _models() -> Models:
    return {
        "whole joint": rig.whole_joint,
        "checked joint": rig.checked_joint,
        "joint by its angles": rig.angle_joint,
        "joint without a sensor": lambda: rig.blind_joint(
            rig.BY_MOTOR, fx.Compliance(), rig.KALMAN
        ),
        "ten harmonics": device_chains.ten_harmonics,
        "ur10e joint 2": lambda: ur10e_fit(2).model,
        "kinova": kinova_watched,
        "iiwa joint 2": lambda: iiwa_watched(2),
    }


def _every_effect(target: str) -> fx.Model:
    return exported(all_of(target), target)


def _texts(model: Callable[[], fx.Model]) -> Numbers:
    """Hashes of header, model file, and the block of parameters in float and double."""
    made = model()
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        folder = Path(name)
        header = export(made, folder / "joint.hpp").read_text(encoding="utf-8")
        text = export(made, folder / "joint.json", "json").read_text(encoding="utf-8")
        blocks = {
            scalar: export(made, folder / f"joint.{scalar}", "binary", scalar=scalar).read_bytes()
            for scalar in ("float", "double")
        }
    code = VERSION.sub("", HASH.sub("", COMMENT.sub("", header)))
    content = {key: value for key, value in json.loads(text).items() if key != "made_by"}
    numbers: Numbers = {
        "header sha256": sha(code.encode()),
        "header lines of code": sum(bool(line.strip()) for line in code.splitlines()),
        "model sha256": sha(json.dumps(content, sort_keys=True).encode()),
    }
    for scalar, block in blocks.items():
        numbers |= {f"{scalar} block bytes": len(block), f"{scalar} block sha256": sha(block)}
    return numbers


def _certified(model: Callable[[], fx.Model], log: Callable[[], fx.Log], device: str) -> Numbers:
    missing = [tool for tool in TOOLS if shutil.which(tool) is None]
    if missing:
        raise NotRunError(f"{' and '.join(missing)} missing")
    made = model()
    target = None if made.estimators else next(iter(made.parts.values())).target
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        certificate = fx.certify(made, log(), device, target=target)
    return certificate_numbers(certificate) | {"rows": plain(certificate.samples)}
