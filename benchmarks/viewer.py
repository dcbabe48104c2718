"""Whether the page of `overtaking view DATA` keeps its budgets, in a browser.

The first list is timed by the page's clock, from the navigation to the frame that shows rows, once
per start of server and browser; other answers where the page asks for them; the drawing where the
clock moves: a key is pressed, and the canvas is read so that nothing is put off. Drawing is also
told as a ratio to a fixed loop on a canvas of the same size, in processor time. That of lists is
the server's.

    overtaking generate --profile pinto2023-physical -n 1000000 --keep features --out data/million
    overtaking generate --profile motorway -n 3 --set traffic.vehicles=32..32 --out data/crowded
    python benchmarks/viewer.py data/million data/crowded
"""

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from measure import ROOT

sys.path.insert(0, str(ROOT))  # The browser of the tests.
from tests.support.browser import chromium, settle

if TYPE_CHECKING:
    from playwright.sync_api import Browser

ROWS = {"policy": "paper", "count": 50}
FILTER = ROWS | {"classes": ["Success_I"], "rules": ["L3"], "light": ["night"]}
BY_MARGIN = ROWS | {
    "margin": {"rule": "L3", "least": None, "most": None},
    "order": "margin",
}
BUDGETS = {
    "first list": 1000,
    "filter with all counts": 200,
    "sorted by margin": 200,
    "a simulation": 300,
    "a branch": 500,
    "a frame": 8,
}
"""[ms]"""

LISTED = """window.listed = new Promise((done) => new MutationObserver((_, watch) => {
  if (!document.querySelector(".simulations tbody tr")) return;
  watch.disconnect();
  requestAnimationFrame(() => setTimeout(() => done(performance.now())));
}).observe(document, { childList: true, subtree: true }));"""

ASK = """async ([path, body]) => {
  const headers = { "Content-Type": "application/json" };
  const sent = body && { method: "POST", headers, body: JSON.stringify(body) };
  const begun = performance.now();
  const answer = await fetch("/api/" + path, sent || {});
  await answer.text();
  if (!answer.ok) throw new Error(path + ": " + answer.status);
  return performance.now() - begun;
}"""

DRAW = """(many) => {
  const road = document.getElementById("road").getContext("2d");
  const found = [];
  document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "Home", bubbles: true }));
  for (let k = 0; k < many; k++) {
    const begun = performance.now();
    document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true }));
    road.getImageData(0, 0, 1, 1);
    document.body.offsetHeight;
    found.push(performance.now() - begun);
  }
  return found;
}"""

LOOP = """(many) => {
  const { width, height } = document.getElementById("road");
  const canvas = Object.assign(document.createElement("canvas"), { width, height });
  const c = canvas.getContext("2d");
  const found = [];
  for (let k = 0; k < many; k++) {
    const begun = performance.now();
    c.fillStyle = "#777";
    c.fillRect(0, 0, width, height);
    for (let box = 0; box < 64; box++) {
      c.fillStyle = box % 2 ? "#e69f00" : "#0072b2";
      c.beginPath();
      c.roundRect((box * 37 + k) % width, (box * 53) % height, 40, 16, 4);
      c.fill();
      c.stroke();
      c.fillText(`${box} 90 km/h`, (box * 37 + k) % width, (box * 53) % height);
    }
    c.getImageData(0, 0, 1, 1);
    found.push(performance.now() - begun);
  }
  return found;
}"""


@contextmanager
def served(data: Path) -> Generator[tuple[subprocess.Popen[str], str]]:
    """A server of its own, and its address."""
    command = [sys.executable, "-m", "overtaking", "view", str(data), "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        lines = iter(server.stdout.readline, "}\n")
        try:
            yield server, json.loads("".join(lines) + "}")["url"]
        finally:
            server.terminate()


def processor_s(pid: int) -> float:
    """Processor time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100.0


def drawers_s(browser: "Browser") -> float:
    """Processor time of the processes of a browser that draw [s]."""
    session = browser.new_browser_cdp_session()
    found = session.send("SystemInfo.getProcessInfo")["processInfo"]
    session.detach()
    return sum(one["cpuTime"] for one in found if one["type"] in ("renderer", "GPU"))


def first_list_ms(data: Path) -> float:
    """Time until a browser that has just been started shows the first rows [ms]."""
    with chromium() as browser, served(data) as (_, url):
        page = browser.new_page()
        page.set_default_timeout(120_000)
        page.add_init_script(LISTED)
        page.goto(url)
        return page.evaluate("window.listed")


def lists(data: Path, repeats: int, told: Callable[..., None]) -> None:
    """The list and single simulations of a large data set."""
    told("first list", [first_list_ms(data) for _ in range(repeats)])
    with chromium() as browser, served(data) as (server, url):
        page = browser.new_page()
        page.set_default_timeout(120_000)
        begun = time.perf_counter()
        page.goto(url)
        page.wait_for_selector(".simulations tbody tr")
        while "so far" in page.inner_text(".found"):
            time.sleep(0.2)
        told("all read", [1e3 * (time.perf_counter() - begun)], processor_s(server.pid))
        settle(page)
        page.goto("about:blank")
        page.goto(url.partition("#")[0])
        page.wait_for_selector(".simulations tbody tr")
        page.goto(url.partition("#")[0] + "#sim=0")
        page.wait_for_selector(".board")
        settle(page)

        def many(name: str, *asked: tuple[str, Any]) -> None:
            before = processor_s(server.pid)
            found = [page.evaluate(ASK, list(one)) for one in asked]
            told(name, found, (processor_s(server.pid) - before) / len(asked))

        many("filter with all counts", *[("rows", FILTER)] * repeats)
        many("sorted by margin, first", ("rows", BY_MARGIN))
        many("sorted by margin", *[("rows", BY_MARGIN | {"first": 50 * k}) for k in range(repeats)])
        many("sorted and filtered", *[("rows", BY_MARGIN | FILTER | {"order": "margin"})] * repeats)
        numbers = [9973 * (k + 1) for k in range(repeats)]
        many("a simulation", *[(f"runs/{one}", None) for one in numbers])
        many("its beliefs", *[(f"runs/{one}/beliefs", None) for one in numbers])
        stay = {"changes": [{"frame": 20, "decision": "STAY"}]}
        many("a branch", *[(f"runs/{one}/branches", stay) for one in numbers])
        many("a fan", *[(f"runs/{one}/fan", {"given": "truth"}) for one in numbers[:3]])
        many("a fan by belief", *[(f"runs/{one}/fan", {"given": "belief"}) for one in numbers[:3]])


def drawing(data: Path, frames: int, told: Callable[..., None]) -> None:
    """Frames of two crowded roads on one clock, 64 boxes, with charts and branches."""
    shown = {
        "a frame, 32 boxes": "#sim=0&t=0",
        "a frame": "#sim=0&t=0&vs=1",
        "a frame, all in view": "#sim=0&t=0&vs=1&cam=all",
        "a frame, with two branches": "#sim=0&t=0&vs=1&if=STAY@1,HardRainNight@2",
    }
    with chromium() as browser, served(data) as (_, url):
        page = browser.new_page(viewport={"width": 1360, "height": 900})
        page.set_default_timeout(120_000)
        page.goto(url)
        page.wait_for_selector(".simulations tbody tr")
        for name, link in shown.items():
            page.goto("about:blank")
            page.goto(url.partition("#")[0] + link)
            page.wait_for_selector(".board")
            settle(page)
            page.evaluate(DRAW, 30)
            found: dict[str, list[float]] = {DRAW: [], LOOP: []}
            spent = dict.fromkeys(found, 0.0)
            for script in [DRAW, LOOP] * 3:  # In turns, as machines are busy.
                before = drawers_s(browser)
                found[script] += page.evaluate(script, frames)
                spent[script] += drawers_s(browser) - before
            each = spent[DRAW] / len(found[DRAW])
            told(name, found[DRAW], each, spent[DRAW] / spent[LOOP])


def main(arguments: list[str]) -> int:
    """Print a table; 1 if a budget is missed."""
    parser = argparse.ArgumentParser(description="Time the page of overtaking view.")
    parser.add_argument("million", type=Path, help="a large data set")
    parser.add_argument("crowded", type=Path, help="a data set of simulations with 32 vehicles")
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--frames", type=int, default=150)
    given = parser.parse_args(arguments)
    missed = []
    print("| | median ms | largest ms | processor ms | of the fixed loop | budget ms |")
    print("|---|---|---|---|---|---|")

    def told(
        name: str, found: list[float], processor: float | None = None, ratio: float | None = None
    ) -> None:
        middle, budget = statistics.median(found), BUDGETS.get(name)
        cells = [
            f"{middle:.1f}",
            f"{max(found):.1f}",
            "" if processor is None else f"{1e3 * processor:.1f}",
            "" if ratio is None else f"{ratio:.1f}",
            "" if budget is None else f"{budget}",
        ]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)
        if budget is not None and middle > budget:
            missed.append(name)

    lists(given.million, given.repeats, told)
    drawing(given.crowded, given.frames, told)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
