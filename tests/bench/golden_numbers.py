"""Are all numbers what they were? Fits, discoveries, estimates, exports and certificates.

    python tests/bench/golden_numbers.py --write [FILE] [--only GLOB] [--jobs 2]
    python tests/bench/golden_numbers.py --check [FILE] [--only GLOB] [--jobs 2]

Written before code moves and checked after it: a table of cases, each with how many values have the
same bits, the largest relative difference of the rest, and what differs. FILE is by default
tests/golden/numbers.json. BLAS sums by the instructions of the processor, so that it is held to
those of Haswell, which others have too; NumPy's own loops may still differ on a processor without
AVX-512: there, write a FILE at the commit before and check that. Measured logs are read from
FLEXSPLINE_DATA; certificates need Arm's compiler and QEMU. --only takes cases by name, such as
"fit/*"; where it writes, other cases stay. The exit status is 1 where a number differs by more than
1e-12 of it, a name or hash differs, a cost rises or a case fails; 2 where nothing does but a case
could not be run. Sentences are not compared.
"""

from __future__ import annotations

import argparse
import fnmatch
import json
import multiprocessing
import os
import platform
import sys
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before NumPy: sums of more threads have other bits
os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")  # likewise: of wider registers
sys.path.insert(0, str(Path(__file__).parents[1] / "python"))
sys.path.insert(0, str(Path(__file__).parents[1] / "firmware"))

import measured
import numpy as np
import scipy
from golden.comparing import compared, merged, table
from golden.estimated_cases import estimated_cases
from golden.exported_cases import exported_cases
from golden.measured_cases import measured_cases, needs_logs
from golden.numbers import Cases, NotRunError, Numbers
from golden.simulated_cases import simulated_cases
from threadpoolctl import threadpool_info
from tqdm import tqdm

FILE = Path(__file__).resolve().parents[1] / "golden" / "numbers.json"
Outcome = tuple[str, Numbers, str, str]  # name, numbers, why it was not run, how it failed


def main() -> None:
    given = _arguments()
    old = json.loads(given.file.read_text(encoding="utf-8")) if given.file.exists() else {}
    names = sorted({*every_case(), *(old["cases"] if given.check else ())})
    chosen = [name for name in names if fnmatch.fnmatchcase(name, given.only)]
    if not chosen:
        raise SystemExit(f"no case is named like {given.only}")
    begun = time.perf_counter()
    outcomes = list(tqdm(_computed(chosen, given.jobs), total=len(chosen), desc="cases"))
    seconds = time.perf_counter() - begun
    for name, _, missing, failure in outcomes:
        if missing or failure:
            print(f"{name}: NOT RUN: {missing}" if missing else f"{name} FAILED\n{failure}")
    new = {name: numbers for name, numbers, missing, failure in outcomes if numbers}
    print(f"{len(new)} cases, {sum(map(len, new.values()))} values, {seconds:.0f} s")
    status = _status(outcomes)
    if given.write:
        _written(given.file, old if given.only != "*" else {}, new, status)
    else:
        status = max(status, _checked(old, new), key=(0, 2, 1).index)
        if len(new) < len(chosen):
            print(f"{len(chosen) - len(new)} of {len(chosen)} cases NOT RUN OR FAILED, see above")
    raise SystemExit(status)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--write", nargs="?", const=FILE, type=Path, metavar="FILE")
    what.add_argument("--check", nargs="?", const=FILE, type=Path, metavar="FILE")
    parser.add_argument("--only", default="*", metavar="GLOB", help="cases by their names")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    given = parser.parse_args()
    given.file = given.write or given.check
    if given.check and not given.file.exists():
        parser.error(f"{given.file} is not there; write it first, by the code as it was")
    return given


@cache
def every_case() -> Cases:
    """Return what computes each case, by its name."""
    return measured_cases() | simulated_cases() | estimated_cases() | exported_cases()


def _computed(names: Sequence[str], jobs: int) -> Iterator[Outcome]:
    if jobs == 1:
        yield from map(outcome, names)
        return
    with multiprocessing.get_context("spawn").Pool(jobs) as pool:
        yield from pool.imap(outcome, names)


def outcome(name: str) -> Outcome:
    """Compute one case; what is wrong with it is told and stops no other."""
    if name not in every_case():
        return name, {}, "", "the file has it and there is no such case"
    try:
        if needs_logs(name) and not measured.data_folder().is_dir():
            raise NotRunError(f"the measured logs are not at {measured.data_folder()}")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return name, every_case()[name](), "", ""
    except NotRunError as error:
        return name, {}, str(error), ""
    except Exception:
        return name, {}, "", traceback.format_exc()


def _status(outcomes: Sequence[Outcome]) -> int:
    if any(failure for *_, failure in outcomes):
        return 1
    return 2 if any(missing for _, _, missing, _ in outcomes) else 0


def _written(file: Path, old: dict[str, Any], new: dict[str, Numbers], status: int) -> None:
    """Write the file where every case that was asked for is there."""
    if status:
        print(f"{file} is not written: a case is missing")
        return
    kept = {name: own for name, own in old.get("cases", {}).items() if name in every_case()}
    content = {"made on": machine(), "cases": merged(kept, new)}
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
    file.write_text(text + "\n", encoding="utf-8")
    print(f"{file}: {len(text) / 1e3:.0f} kB")


def _checked(old: dict[str, Any], new: dict[str, Numbers]) -> int:
    """Print the table; return 1 where a value is not what it was."""
    was, here = old["made on"], machine()
    for name in sorted({*was, *here}):
        if was.get(name) != here.get(name):
            print(f"written with {name} {was.get(name)}, this is {here.get(name)}")
    cases = [compared(name, old["cases"].get(name, {}), own) for name, own in new.items()]
    if cases:
        print("\n".join(table(cases)))
    wrong = [case.name for case in cases if case.wrong]
    count, same = sum(c.count for c in cases), sum(c.same for c in cases)
    print(f"{same} of {count} values have the same bits; {len(wrong)} of {len(cases)} cases differ")
    return int(bool(wrong))


def machine() -> dict[str, str]:
    """Return what bits may depend on beside the code."""
    blas = {f"{own['internal_api']} {own.get('architecture', '')}".strip()
            for own in threadpool_info() if own["user_api"] == "blas"}  # fmt: skip
    return {
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "machine": platform.machine(),
        "blas": ", ".join(sorted(blas)),
        "isa": os.environ.get("FLEXSPLINE_ISA", "widest"),
    }


if __name__ == "__main__":
    main()
