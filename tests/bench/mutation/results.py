"""What became of each mutant: a JSON line as soon as it is known; its last line counts."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path


@dataclass
class Result:
    """`state`: killed, timeout, survived, import (to be started anew), or "" (met no test)."""

    key: str
    state: str = ""
    by: str = ""
    covering: int = 0
    seconds: float = 0.0
    met: list[str] = field(default_factory=list)

    @property
    def dead(self) -> bool:
        return self.state in ("killed", "timeout")


def last_results(folder: Path) -> dict[str, Result]:
    """The last result of each mutant; what is dead stays so, whoever judges it again."""
    path, found = folder / "results.jsonl", dict[str, Result]()
    for line in path.read_text().splitlines() if path.exists() else []:
        result = Result(**json.loads(line))
        if not (result.key in found and found[result.key].dead):
            found[result.key] = result
    return found


def add(folder: Path, result: Result) -> None:
    with (folder / "results.jsonl").open("a") as file:
        file.write(json.dumps({**asdict(result), "met": [] if result.dead else result.met}) + "\n")
    print(result.state or "no test", f"{result.seconds:.0f} s", result.key, flush=True)
