"""What is wrong with how a figure or a page looks, measured and not seen.

`figure_faults` asks Matplotlib for the boxes of a figure at the size at which it is drawn;
`page_faults` asks a browser, which is Chromium, for those of a report: wide, on a screen of 400 px,
and dark. Neither needs an eye; both return sentences.
"""

from __future__ import annotations

import html
import itertools
import json
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from browser import OPTIONS, browser
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure, FigureBase
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from flexspline.plot.canvas import LEAST

TOUCH = 1.0  # px by which boxes of text may overlap: they have a margin of their own


def figure_faults(figure: Figure) -> list[str]:
    """Texts that lie on each other, leave the figure or are small, and legends over data."""
    figure.draw_without_rendering()
    texts = [(t.get_text(), t.get_window_extent()) for t in _texts(figure) if _shown(t)]
    faults = [
        f"'{one}' lies on '{other}'"
        for (one, a), (other, b) in itertools.combinations(texts, 2)
        if _overlap(a, b)
    ]
    whole = figure.bbox
    faults += [
        f"'{said}' is cut"
        for said, box in texts
        if box.x0 < whole.x0 - 1 or box.x1 > whole.x1 + 1 or box.y1 > whole.y1 + 1 or box.y0 < -1
    ]
    axes = [ax for ax in figure.axes if ax.get_visible()]
    legends = [ax.get_legend() for ax in axes]
    if any(_overlap(k.get_window_extent(), ax.bbox) for k in legends if k for ax in axes):
        faults.append("a legend is over data")
    written = [text for text in figure.findobj(Text) if _shown(text)]
    faults += [f"'{t.get_text()}' is small" for t in written if t.get_fontsize() < LEAST]
    return faults + [f"'{t.get_text()}' is black" for t in written if _black(t)]


def _parts(figure: FigureBase) -> Iterator[FigureBase]:
    yield figure
    for part in figure.subfigs:
        yield from _parts(part)


def _texts(figure: Figure) -> Iterator[Text]:
    for part in _parts(figure):
        yield from part.texts
        yield from (text for legend in part.legends for text in legend.get_texts())
    for ax in (ax for ax in figure.axes if ax.get_visible()):
        yield from (ax.title, ax._left_title, ax._right_title, *ax.texts)
        yield from (ax.xaxis.label, ax.yaxis.label, *_numbers(ax))
        made = ax.get_legend()
        yield from () if made is None else made.get_texts()


def _numbers(ax: Axes) -> Iterator[Text]:
    for axis in (ax.xaxis, ax.yaxis):
        low, high = sorted(axis.get_view_interval())
        for tick in [*axis.get_major_ticks(), *axis.get_minor_ticks()]:
            if low <= tick.get_loc() <= high:
                yield from (tick.label1, tick.label2)


def _shown(text: Text) -> bool:
    return bool(text.get_visible() and text.get_text().strip())


def _black(text: Text) -> bool:
    """Whether a text stays black in the dark: no colour of the page's text takes its place."""
    return bool(to_hex(text.get_color()) == "#000000")


def _overlap(one: Bbox, other: Bbox) -> bool:
    wide = min(one.x1, other.x1) - max(one.x0, other.x0)
    high = min(one.y1, other.y1) - max(one.y0, other.y0)
    return bool(min(wide, high) > TOUCH)


def page_faults(path: Path) -> list[str]:
    """What is wrong with a report at 1280 and 400 px and in the dark; skips without Chromium."""
    page = html.escape(path.read_text(encoding="utf-8"), quote=True)
    frames = "".join(
        f'<iframe name="{name}" style="border:0;width:{width}px;height:900px;color-scheme:{scheme}"'
        f' srcdoc="{page}"></iframe>'
        for name, width, scheme in (("wide", 1280, "light"), ("narrow", 400, "dark"))
    )
    measured = path.with_name("measured.html")
    measured.write_text(
        f'<!doctype html><meta charset="utf-8">{frames}<pre id="faults"></pre>'
        f"<script>{MEASURE}</script>",
        encoding="utf-8",
    )
    ran = subprocess.run(
        [browser(), *OPTIONS, "--dump-dom", measured.resolve().as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    told = re.search(r'<pre id="faults">(.+?)</pre>', ran.stdout, re.DOTALL)
    assert told is not None, "the browser measured nothing"
    found: dict[str, Any] = json.loads(html.unescape(told.group(1)))
    assert found.pop("texts") > 0 and found.pop("dark")
    return [f"{frame}: {fault}" for frame, faults in found.items() for fault in faults]


MEASURE = r"""
const light = c => { const v = c.match(/[\d.]+/g).map(Number).slice(0, 3).map(x => x / 255)
  .map(x => x <= .04 ? x / 12.92 : ((x + .055) / 1.055) ** 2.4);
  return .2126 * v[0] + .7152 * v[1] + .0722 * v[2] + .05 };
const contrast = (a, b) => { const r = light(a) / light(b); return Math.max(r, 1 / r) };
addEventListener("load", () => {
  const told = {texts: 0};
  for (const frame of document.querySelectorAll("iframe")) {
    const doc = frame.contentDocument, width = frame.clientWidth, bad = told[frame.name] = [];
    const style = e => frame.contentWindow.getComputedStyle(e);
    const paper = style(doc.body).backgroundColor;
    if (frame.name === "narrow") told.dark = light(paper) < .2;
    if (doc.documentElement.scrollWidth > width) bad.push("the page is wider than the screen");
    for (const table of doc.querySelectorAll("table, svg")) {
      const box = table.closest(".wide");
      if (!box || style(box).overflowX !== "auto") bad.push(`a ${table.tagName} does not scroll`);
      else if (box.getBoundingClientRect().right > width) bad.push("a box leaves the screen");
    }
    for (const e of doc.querySelectorAll("p, td, th, li, summary, figcaption, code, a"))
      if (parseFloat(style(e).fontSize) < 9) bad.push(`'${e.textContent}' is small`);
    for (const svg of doc.querySelectorAll("svg")) {
      const whole = svg.getBoundingClientRect(), scale = whole.width / svg.viewBox.baseVal.width;
      const texts = [...svg.querySelectorAll("text")].filter(t => t.textContent.trim());
      const boxes = texts.map(t => t.getBoundingClientRect());
      told.texts += texts.length;
      texts.forEach((t, i) => {
        const size = parseFloat(style(t).fontSize) * scale;
        const box = boxes[i];
        if (box.left < whole.left - 1 || box.right > whole.right + 1)
          bad.push(`'${t.textContent}' leaves its figure`);
        if (size < 8.95) bad.push(`'${t.textContent}' is ${size.toFixed(1)} px high`);
        if (contrast(style(t).fill, paper) < 3) bad.push(`'${t.textContent}' is hardly seen`);
        for (let k = 0; k < i; k++) {
          const a = boxes[i], b = boxes[k];
          if (Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1.5
              && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 3)
            bad.push(`'${t.textContent}' lies on '${texts[k].textContent}'`);
        }
      });
    }
  }
  document.getElementById("faults").textContent = JSON.stringify(told);
});
"""
