"""Would the tests see it? A fixed draw of mutants of the package, and how many the tests kill.

    pip install coverage                                         once; nothing else needs it
    python tests/bench/mutants.py record                         the suite, watched (an hour)
    python tests/bench/mutants.py run --budget 20
    python tests/bench/mutants.py run --budget 120               survivors again, more tests
    python tests/bench/mutants.py report                         also what is equivalent
    python tests/bench/mutants.py record tests/python/test_new.py     after new tests
    python tests/bench/mutants.py slow                           what costs most in the suite

`mutation/draw.py` says what a mutant is, `mutation/record.py` what is watched. A mutant meets the
tests that execute its line, those first that are cheap and busy with its file, until one fails or
all of them have cost `--budget` seconds of processor time; a run that is cut off goes on where it
stopped, and survivors meet further tests in the next. Too long (see `mutation/judge.py`) counts as
killed; a mutant that no test executes survives. No file of this tree is changed: `judge` puts the
mutated code into a forked process, and what is evaluated at import is mutated in a copy of the
tree. Mutants that no test could kill are in `mutation/equivalent.toml`, with the reason.

Why no library: mutmut 3 maps tests to functions rather than lines, has no draw by a seed and
mutates all files that it watches; cosmic-ray gives every mutant one and the same test command, so
that each would meet the whole suite; its operators mutate annotations and try all of a dozen
operators in each place, most of which fail at once and so say nothing about the tests.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

from mutation.covering import Record
from mutation.draw import Mutant, drawn
from mutation.results import add, last_results

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
BENCH = ROOT / "tests" / "bench"
PACKAGE = ROOT / "python" / "flexspline"
PARTS = (
    "fitting.py",
    "least_squares",
    "regression",
    "output_error",
    "discovery",
    "estimators",
    "estimation",
    "logs/checks",
    "simulation",
    "simulator.py",
    "forward",
    "fleet",
    "tracking",
)
SEED, NUMBER = 16, 200
LONGER, LONGER_BY = 4.0, 30.0  # times, and s: the processor time that a mutant may take
FROZEN = "tests/python/test_frozen.py::test_every_dataclass_but_those_that_work_is_frozen"
FAILED, INTERRUPTED = 1, 2  # pytest's


def files() -> list[Path]:
    """The modules whose mutants are drawn."""
    parts = [PACKAGE / part for part in PARTS]
    return [f for p in parts for f in ([p] if p.suffix else sorted(p.glob("*.py")))]


def pytest(tree: Path, plugin: str, task: Any, *arguments: str) -> subprocess.Popen[bytes]:
    """Start pytest on the package of this tree, with a plugin that is given a task."""
    place = BENCH / "mutation" if plugin == "record" else BENCH  # where `coverage.py` is no library
    path = [str(tree / "python"), str(place), os.environ.get("PYTHONPATH", "")]
    given = {
        "PYTHONPATH": os.pathsep.join(path),
        "OPENBLAS_NUM_THREADS": "1",
        "MUTANTS_TASK": json.dumps(task),
    }
    command = [sys.executable, "-m", "pytest", "-q", "-p", plugin, *arguments]
    return subprocess.Popen(command, cwd=tree, env={**os.environ, **given})


def record(folder: Path, jobs: int, tests: list[str]) -> None:
    """Run the suite (or these tests) with the plugin that writes down lines and seconds."""
    into = folder / f"record{len(list(folder.glob('record*'))):02d}"
    into.mkdir(parents=True)
    task = {"folder": str(into), "files": [str(file) for file in files()]}
    pytest(ROOT, "record", task, f"-n{jobs}", *tests).wait()


def run(folder: Path, given: argparse.Namespace) -> None:
    """Judge all mutants that no test has killed yet."""
    task = {
        "folder": str(folder),
        "files": [str(file) for file in files()],
        "seed": given.seed,
        "number": given.number,
        "budget": given.budget,
        "only": given.only,
        "jobs": given.jobs,
    }
    options = ("-n0", "--tb=no", "-s", "-p", "no:cacheprovider", "tests/python")
    started = [
        pytest(
            ROOT, "mutation.judge", {**task, "share": k}, f"--basetemp={folder}/tmp{k}", *options
        )
        for k in range(given.jobs)
    ]
    for process in started:
        process.wait()
    at_import(folder, drawn(files(), given.seed, given.number), given.budget)


def at_import(folder: Path, mutants: list[Mutant], budget: float) -> None:
    """Judge mutants of what is evaluated at import, in a copy of the tree and by a new process."""
    results = last_results(folder)
    left = [m for m in mutants if m.key in results and results[m.key].state == "import"]
    if not left:
        return
    seen, tree = Record(folder), copied(folder / "tree")
    for mutant in left:
        result = results[mutant.key]
        tests, cost = seen.affordable(seen.covering(mutant), budget)
        tests = [*tests, FROZEN]
        chosen = tree / "chosen.json"
        chosen.write_text(json.dumps(tests))
        module = tree / mutant.file.relative_to(ROOT)
        module.write_text(mutant.mutated, encoding="utf-8")
        options = ("-n0", "-x", "--tb=no", "-p", "no:cacheprovider")
        where = sorted({test.split("::")[0] for test in tests})
        process = pytest(tree, "mutation.select_tests", str(chosen), *options, *where)
        try:
            code = process.wait(LONGER * cost + 20.0 * LONGER_BY)
            result.state = "killed" if code in (FAILED, INTERRUPTED) else "survived"
        except subprocess.TimeoutExpired:
            process.kill()
            result.state = "timeout"
        module.write_text(mutant.source, encoding="utf-8")
        result.met = tests
        add(folder, result)


def copied(tree: Path) -> Path:
    """Copy what git lists, the core and the link to the headers, for mutants to stand in."""
    shutil.rmtree(tree, ignore_errors=True)
    listed = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    built = [str(f.relative_to(ROOT)) for f in PACKAGE.glob("_core*.so")]
    for name in [*listed.stdout.splitlines(), *built]:
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, tree / name)
    (tree / "python/flexspline/include").symlink_to("../../cpp/include")
    return tree


def report(folder: Path, mutants: list[Mutant]) -> None:
    """Print how many are killed, and every survivor: where, what, and how many tests it met."""
    found = last_results(folder)
    entries = tomllib.loads((BENCH / "mutation" / "equivalent.toml").read_text())["mutant"]
    reasons = {(entry["file"], entry["after"]): entry["reason"] for entry in entries}
    counts: Counter[str] = Counter()
    for mutant in mutants:
        file = str(mutant.file.relative_to(PACKAGE))
        result, reason = found.get(mutant.key), reasons.get((file, mutant.after))
        if result is not None and result.dead:
            counts[result.state] += 1
            if reason:
                print(f"{file}:{mutant.line} is no equivalent: {result.by} kills {mutant.after}")
            continue
        counts["equivalent" if reason else "survived" if result else "not run"] += 1
        met = f"{len(result.met)} of {result.covering} tests" if result else "not run"
        print(f"{file}:{mutant.line} ({mutant.kind}; {met})\n  - {mutant.before}")
        print(f"  + {mutant.after}" + (f"\n  = {reason}" if reason else ""))
    dead = counts["killed"] + counts["timeout"]
    print(dict(counts), f"killed: {dead} of {dead + counts['survived']} that are not equivalent")


def slow(folder: Path, number: int = 60) -> None:
    """Print what costs most processor time in the suite: tests, fixtures, files."""
    seconds = Record(folder).seconds
    by_file: dict[str, float] = {}
    for unit, spent in seconds.items():
        file = unit.split("::")[0].removeprefix("module:").removeprefix("fixture:")
        file = file.split("(")[0].rpartition(".")[0] if file.startswith("cache:") else file
        by_file[file] = by_file.get(file, 0.0) + spent
    for title, entries in (("units", seconds), ("files", by_file)):
        print(f"{title}: {sum(entries.values()):.0f} s in all")
        for name, spent in sorted(entries.items(), key=lambda one: -one[1])[:number]:
            print(f"{spent:8.1f} s  {name}")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("task", choices=("record", "run", "report", "slow"))
    parser.add_argument("tests", nargs="*", help="with record: these only")
    parser.add_argument("--folder", type=Path, default=Path("/tmp/mutants"))
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--number", type=int, default=NUMBER)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--budget", type=float, default=20.0, help="s of tests for a mutant")
    parser.add_argument("--only", default="", help="with run: mutants whose key holds this")
    given = parser.parse_intermixed_args()
    if given.task == "record":
        record(given.folder, given.jobs, given.tests)
    elif given.task == "run":
        run(given.folder, given)
    elif given.task == "slow":
        slow(given.folder)
    else:
        report(given.folder, drawn(files(), given.seed, given.number))


if __name__ == "__main__":
    main()
