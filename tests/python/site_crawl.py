"""Opens a folder of pages in headless Chromium and follows every link within it.

One browser, one page that loads the others in a frame of 400 px, as on a telephone, and sends home
what it found; what a page asks for and does not get, the server itself notes. Not part of the
package.
"""

from __future__ import annotations

import functools
import json
import os
import re
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from browser import OPTIONS, browser

SECONDS = 400.0
UNCAUGHT = re.compile(r"CONSOLE.*?Uncaught[^\n]*")

CRAWL = r"""<!doctype html><meta charset="utf-8"><iframe width="400" height="800"></iframe><script>
const frame = document.querySelector("iframe"), home = location.origin;
const loaded = url => new Promise(done => { frame.onload = done; frame.src = url });
const pages = {}, queue = ["/index.html"], faults = [], asked = [];
async function crawl() {
  for (let path; path = queue.shift();) {
    await loaded(path);
    const page = frame.contentDocument;
    pages[path] = new Set([...page.querySelectorAll("[id], a[name]")].map(e => e.id || e.name));
    if (page.documentElement.scrollWidth > 400) faults.push(`${path} is wider than 400 px`);
    for (const e of page.querySelectorAll("h1, h2, h3, p, li, figcaption"))
      if (e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).display !== "inline")
        faults.push(`${path}: '${e.textContent.slice(0, 40)}' is cut at 400 px`);
    const size = e => e ? parseFloat(getComputedStyle(e).fontSize) : 0;
    const under = page.querySelector("h2");
    if (under && size(under) >= size(page.querySelector("h1")))
      faults.push(`${path}: '${under.textContent}' is as large as the title at 400 px`);
    for (const image of page.images) {
      image.loading = "eager";
      await image.decode().catch(() => faults.push(`${path}: ${image.src} is no image`));
    }
    for (const entry of frame.contentWindow.performance.getEntriesByType("resource"))
      if (!entry.name.startsWith(home)) faults.push(`${path} asks for ${entry.name}`);
    for (const link of page.querySelectorAll("a[href]")) {
      const to = new URL(link.href);
      if (to.origin !== home) continue;
      if (to.pathname.endsWith("/")) faults.push(`${path} links to a folder, ${to.pathname}`);
      asked.push([path, to.pathname, decodeURIComponent(to.hash.slice(1))]);
      if (to.pathname in pages || queue.includes(to.pathname)) continue;
      if (to.pathname.endsWith(".html")) queue.push(to.pathname);
      else if (!(await fetch(to.pathname)).ok) faults.push(`${path}: no ${to.pathname}`);
    }
  }
  for (const [from, to, place] of asked)
    if (place && pages[to] && !pages[to].has(place)) faults.push(`${from}: no ${place} in ${to}`);
}
crawl().catch(error => faults.push(String(error))).then(() => fetch("/found", {method: "POST",
  body: JSON.stringify({pages: Object.keys(pages), links: asked.length, faults})}));
</script>"""


@dataclass
class Crawled:
    """Pages that were opened, how many links they have, and what is wrong."""

    pages: list[str] = field(default_factory=list)
    links: int = 0
    faults: list[str] = field(default_factory=list)


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, folder: Path) -> None:
        handler = functools.partial(_Handler, directory=os.fspath(folder))
        super().__init__(("127.0.0.1", 0), handler)
        self.found: dict[str, Any] = {}
        self.missed: list[str] = []
        self.done = threading.Event()


class _Handler(SimpleHTTPRequestHandler):
    server: _Server

    def do_GET(self) -> None:
        if self.path != "/crawl":
            super().do_GET()
            return
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(CRAWL.encode())

    def do_POST(self) -> None:
        self.server.found = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        self.send_response(204)
        self.end_headers()
        self.server.done.set()

    def send_error(self, *arguments: Any, **more: Any) -> None:
        if self.path != "/favicon.ico":
            self.server.missed.append(f"{self.path} is asked for and not there")
        super().send_error(*arguments, **more)

    def log_message(self, format: str, *arguments: Any) -> None:
        """Say nothing on standard error."""


def crawl(folder: Path, scratch: Path) -> Crawled:
    """Open every page that can be reached from a folder's index.html."""
    log = scratch / "browser.log"
    with _served(folder) as server, log.open("wb") as errors:
        page = f"http://127.0.0.1:{server.server_port}/crawl"
        more = ("--enable-logging=stderr", "--remote-debugging-port=0")
        profile = f"--user-data-dir={scratch / 'profile'}"
        process = subprocess.Popen([browser(), *OPTIONS, *more, profile, page], stderr=errors)
        try:
            if not server.done.wait(SECONDS):
                return Crawled(faults=[f"not done within {SECONDS:g} s"])
        finally:
            process.terminate()
            process.wait()
        told = UNCAUGHT.findall(log.read_text(encoding="utf-8", errors="replace"))
        found = Crawled(**server.found)
        found.faults += sorted(set(server.missed)) + told
        return found


@contextmanager
def _served(folder: Path) -> Iterator[_Server]:
    with _Server(folder) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        server.shutdown()
