"""Runs notebooks and keeps small outputs in them, so that they can be read without being run.

    python .github/site/execute_notebooks.py [NAME ...]

Without a name, every notebook of `notebooks/`: some ten minutes. What is kept: text, tables, and
pictures of at most 60 kB; what is not: paths and addresses of this machine, progress, warnings, and
the text of what is a table or a picture too. The notebook notes from which code its outputs are.
Measured logs are read from FLEXSPLINE_DATA. Needs `pip install '.[test]'`.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import io
import os
import re
import tempfile
from pathlib import Path
from typing import Any

import nbclient
import nbformat
from PIL import Image

NOTEBOOKS = Path(__file__).parents[2] / "notebooks"
DATA = Path(os.environ.get("FLEXSPLINE_DATA", NOTEBOOKS.parent / "../shared/data")).resolve()
MOST_PICTURE = 60_000  # bytes of a PNG: two or three in a screen of text, on a slow line
MOST_PICTURES = 320_000  # bytes of all of a notebook, which then stays below 500 kB
SMALLEST_SCALE = 0.4  # of a picture: below this its letters cannot be read
COLOURS = 32  # lines and letters of few colours with their soft edges need no more
SECONDS_PER_CELL = 900
RANDOM = re.compile(r"flexspline-[a-z0-9_]{8}\b")  # a folder of `tempfile`
STYLE_ID = re.compile(r"T_[0-9a-f]{5}")  # of a table of pandas
ADDRESS = re.compile(r" at 0x[0-9a-f]+")
KINDS = ("text/plain", "text/html", "image/png")


def executed(path: Path, folder: Path) -> Any:
    """Return a notebook run in a folder, its outputs as the kernel gave them."""
    notebook = nbformat.read(path, as_version=4)
    temporary = folder / "temporary"
    temporary.mkdir()
    surroundings = {
        **os.environ,
        "FLEXSPLINE_DATA": os.fspath(DATA),
        "TMPDIR": os.fspath(temporary),
        "PYTHONPATH": os.environ.get("PYTHONPATH", ""),
    }
    nbclient.NotebookClient(
        notebook,
        timeout=SECONDS_PER_CELL,
        kernel_name="python3",
        record_timing=False,
        resources={"metadata": {"path": os.fspath(folder)}},
    ).execute(env=surroundings)
    return notebook


def keep_small(notebook: Any, folder: Path) -> None:
    """Leave of a notebook's outputs what a reader needs, and nothing of this machine."""
    language = {"name": "python"}
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    made = {"kernelspec": kernel, "language_info": language, "outputs_of": code_digest(notebook)}
    notebook.metadata = nbformat.from_dict(made)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    outputs = [output for cell in cells for output in cell.outputs]
    pictures = sum("image/png" in output.get("data", {}) for output in outputs)
    most = min(MOST_PICTURE, MOST_PICTURES // max(1, pictures))
    for cell in cells:
        told = [output for output in cell.outputs if output.get("name") != "stderr"]
        cell.outputs = [_small(output, folder, most) for output in told]


def code_digest(notebook: Any) -> str:
    """Return what tells whether outputs are those of the code beside them."""
    code = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "code")
    return hashlib.sha256(code.encode()).hexdigest()[:16]


def _small(output: Any, folder: Path, most: int) -> Any:
    if output.output_type == "stream":
        output.text = without_machine(output.text, folder)
        return output
    output.metadata = {}
    output.data = {kind: output.data[kind] for kind in KINDS if kind in output.data}
    for kind, value in output.data.items():
        if kind == "image/png":
            output.data[kind] = small_picture(value, most)
        else:
            output.data[kind] = without_machine(value, folder)
    if len(output.data) > 1:  # `<PlainFigure size 1100x800 with 4 Axes>`
        output.data.pop("text/plain")
    return output


def without_machine(text: str, folder: Path) -> str:
    """Return a text without what differs from machine to machine, or from run to run."""
    temporary = f"{folder / 'temporary'}/"
    for place, word in ((temporary, ""), (f"{folder}/", ""), (str(DATA), "FLEXSPLINE_DATA")):
        text = text.replace(place, word)
    text = ADDRESS.sub("", RANDOM.sub("flexspline-folder", text))
    return STYLE_ID.sub("T_table", text)


def small_picture(encoded: str, most: int) -> str:
    """Return a PNG of few colours, made smaller until it has `most` bytes at most."""
    picture = Image.open(io.BytesIO(base64.b64decode(encoded))).convert("RGB")
    scale = 1.0
    while True:
        size = (round(picture.width * scale), round(picture.height * scale))
        made = io.BytesIO()
        resized = picture.resize(size, Image.Resampling.LANCZOS) if scale < 1.0 else picture
        few = resized.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
        few.save(made, format="png", optimize=True)
        if made.tell() <= most:
            return base64.b64encode(made.getvalue()).decode()
        scale *= 0.9
        if scale < SMALLEST_SCALE:
            raise SystemExit(
                f"a picture of {size[0]} by {size[1]} does not fit {most} B; draw less"
            )


def main() -> None:
    """Run the notebooks that are asked for, one behind the other."""
    asked = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    asked.add_argument("names", nargs="*", metavar="NAME")
    names = asked.parse_args().names or sorted(path.stem for path in NOTEBOOKS.glob("*.ipynb"))
    for name in names:
        path = NOTEBOOKS / f"{name.removesuffix('.ipynb')}.ipynb"
        if not path.is_file():
            raise SystemExit(f"{path}: no such notebook; give a name of those in notebooks/")
        print(f"{name}: ", end="", flush=True)
        with tempfile.TemporaryDirectory() as made:
            folder = Path(made).resolve()
            notebook = executed(path, folder)
            keep_small(notebook, folder)
        nbformat.validate(notebook)
        nbformat.write(notebook, path)
        print(f"{path.stat().st_size / 1000:.0f} kB", flush=True)


if __name__ == "__main__":
    main()
