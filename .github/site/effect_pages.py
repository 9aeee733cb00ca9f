"""A page for each effect of the catalogue: formula, picture, signature, source, cost on a device.

Formula and edges are the comment on top of the effect's header in C++; the picture is drawn by the
core. Nothing of an effect is written here.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from citations import IN_MARKDOWN, cited
from effect_pictures import axis_of, draw

from flexspline.effects import CATALOGUE, EffectInfo

ROOT = Path(__file__).parents[2]
HEADERS = ROOT / "cpp/include/flexspline/effects"
COSTS = Path(__file__).parent / "device_costs.json"
TARGETS = {"S": "sensor torque", "M": "drive torque", "D": "torsion"}
DEMANDS = {
    "both_directions": "motion in both directions",
    "speed_ratio": "speeds that differ by a factor of {:g}",
    "low_speeds": "rows at less than a fifth of the top speed",
    "acceleration": "an acceleration well above its noise",
    "turn": "{:g} of a turn of the output",
    "resolved_order": "a rate that resolves {:g} periods per turn of the motor",
    "resolved_poles": "a rate that resolves a period per pole pair of the motor",
    "temperature": "a temperature that changes by {:g} K",
    "duration": "a run of {:g} s",
    "known_load": "a known load that changes",
    "any_load": "a load that changes: a known one, or the joint's own mass that moves",
    "both_torques": "a load of both signs",
    "there_and_back": "a load that rises and falls",
    "motor_torque": "a drive torque that changes",
}


def comment_of(name: str) -> list[str]:
    """Return the lines of the comment on top of an effect's struct, without the slashes."""
    struct = "".join(word.capitalize() for word in name.split("_"))
    lines = (HEADERS / f"{name}.hpp").read_text(encoding="utf-8").splitlines()
    at = next(k for k, line in enumerate(lines) if re.match(rf"struct {struct}\b", line)) - 1
    block: list[str] = []
    for line in reversed(lines[:at]):
        if not line.startswith("///"):
            break
        block.insert(0, line.removeprefix("///").removeprefix(" "))
    return block


def formula_and_words(block: list[str]) -> tuple[list[str], str, str]:
    """Return the indented lines, the sentences around them, and the source."""
    indented = [line.strip() for line in block if line.startswith("  ")]
    formula = [part for line in indented for part in re.split(r" {4,}", line)]
    words = "\n".join("" if line.startswith("  ") else line for line in block)
    text, _, source = words.partition("Source:")
    text = re.sub(r"\n{3,}", "\n\n", text).strip()
    return formula, _marked(text), _marked(" ".join(source.split()))


def _marked(text: str) -> str:
    """Make citations, and escape what Markdown would take for marks."""
    return cited(text, IN_MARKDOWN, lambda words: re.sub(r"([*_|<])", r"\\\1", words))


def _terms(info: EffectInfo) -> str:
    rows = ["| parameter | unit | what it is |", "|---|---|---|"]
    rows += [f"| `{term.name}` | {term.unit} | coefficient, fitted |" for term in info.terms]
    for shape in info.shapes:
        fitted = "searched by the fit" if shape.fitted else "given"
        rows.append(
            f"| `{shape.name}` | {shape.unit} | shape, {fitted} within {shape.lower:g} to "
            f"{shape.upper:g}; by default {shape.default:g} |"
        )
    return "\n".join(rows)


def _signature(info: EffectInfo) -> str:
    channels = [f"`{channel}`" for channel in info.reads if channel != "period"]
    depends = ", ".join(channels) or "nothing: it is constant"
    lines = [f"- {info.signature[0].upper()}{info.signature[1:]}.", f"- It depends on {depends}."]
    if info.pairs:
        pairs = ", ".join(pair.replace("_", " ") for pair in info.pairs)
        lines.append(f"- It turns with {pairs}: a peak at an order of that angle.")
    if info.remembers:
        lines.append("- It remembers: what it is depends on the rows before.")
    if info.reversal:
        lines.append(f"- At a reversal: {info.reversal}.")
    wanted = [DEMANDS[demand].format(amount) for demand, amount in info.demands]
    if wanted:
        lines.append(f"- A run shows it with {', and with '.join(wanted)}.")
    if info.combines:
        names = " and ".join(f"[{name}]({name}.md)" for name in info.combines)
        lines.append(f"- It has the columns of {names} together, and is not sought beside them.")
    return "\n".join(lines)


def _cost(name: str, costs: dict[str, Any]) -> str:
    counted = costs["instructions_per_step"]
    if name not in counted:
        return "Not counted yet: `python .github/site/device_costs.py`."
    orders = " (with three orders of each of its pairs)" if CATALOGUE[name].pairs else ""
    return (
        f"A model of this effect alone{orders} takes **{counted[name]} instructions** a step in "
        f"single precision on a {costs['device']}, counted by "
        "{doc}`flexspline certify <../commands/certify>`. The bits are those of this package."
    )


def _page(info: EffectInfo, costs: dict[str, Any]) -> str:
    formula, words, source = formula_and_words(comment_of(info.name))
    first, _, rest = words.partition("\n\n")
    targets = ", ".join(TARGETS[letter] for letter in info.targets)
    shown = "\n".join(formula)
    return f"""# {info.name}

{first}

*Acts on:* {targets}.

```{{code-block}} text
:class: formula

{shown}
```

{rest}

{_terms(info)}

```{{image}} {info.name}.svg
:alt: {info.name} over {axis_of(info).replace("_", " ")}
:class: dark-light
```

## In the residual

{_signature(info)}

## Source

{source[:1].upper()}{source[1:]}

## On the device

{_cost(info.name, costs)}
"""


def write_effects(folder: Path) -> None:
    """Write the pages, their pictures, and the list of all effects."""
    folder.mkdir()
    costs = json.loads(COSTS.read_text(encoding="utf-8"))
    rows = []
    for name, info in CATALOGUE.items():
        draw(info, folder / f"{name}.svg")
        (folder / f"{name}.md").write_text(_page(info, costs), encoding="utf-8")
        rows.append(f"| [{name}]({name}.md) | {' '.join(info.targets)} | {info.signature} |")
    names = "\n".join(CATALOGUE)
    table = "\n".join(rows)
    (folder / "index.md").write_text(
        "# Effects\n\nOne name, one physical cause. S: it acts on the sensor torque; M: on the "
        "drive's torque; D: on the torsion of the gear.\n\n"
        f"| effect | acts on | how it shows |\n|---|---|---|\n{table}\n\n"
        f"```{{toctree}}\n:hidden:\n\n{names}\n```\n",
        encoding="utf-8",
    )
