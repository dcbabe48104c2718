"""Makes the pictures that show what the package makes: a film, a report, a page in the browser.

    python docs/figures/showcase.py

writes `film.webp`, `report.png` and the pictures of the page, `view-*.webp`, beside this file, from
one simulated data set. Their bytes depend on the versions of Matplotlib, Pillow and Chromium, so
nothing compares them; make them anew when what they show looks different. The first two are cards
with a margin of their own, for a light and a dark page. The pages need Chromium.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from PIL import Image, ImageDraw

import overtaking
from overtaking.analysis.stats.diagrams import diagram
from overtaking.analysis.stats.distributions import typical
from overtaking.show.plots.style import to_png
from overtaking.show.report import gallery
from overtaking.show.video.jobs import jobs
from overtaking.show.video.produce import film_of
from overtaking.show.video.scene import RATE as FILM_RATE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Page, ViewportSize

    from overtaking.data.load import Dataset
    from overtaking.show.report.gallery import Picture
    from overtaking.show.video.canvas import Canvas
    from overtaking.show.video.film import Film

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1]))  # For the server of the tests.
SIMULATIONS, SEED = 276, 1
CLASS = "Success_I"
"""Class of the simulation that is filmed: there is something to tell."""

WIDTH, RATE, QUALITY = 720, 5, 30
FIRST_S, LAST_S = 0.0, 12.0
"""What of the film is shown."""

VIEWED, MOMENT = [0, 2, 3, 4, 7, 8, 10, 14, 20, 29, 40, 47], "#sim=20&t=3.5"
SERVED: dict[str, tuple[str, Literal["light", "dark"], int]] = {
    "list": ("", "dark", 0),
    "what-if": ("#sim=3&t=4&if=STAY@1,STAY@1~PULL_OUT@3.5", "light", 150),
    "fan": ("#sim=138&t=3&fan=belief", "dark", 185),
}
"""Of the served page: link, colours, and how far it is scrolled [px]."""

WINDOW: ViewportSize = {"width": 1280, "height": 960}
"""What is seen of the page."""

SETTLED_MS = 3000
"""Until thumbnails are drawn, and pages laid out."""

GAP, CARD, CORNER = 18, 760, 14  # Pixels.


def film(data: Dataset) -> bytes:
    """A film of one simulation as a small animated picture."""
    chosen = next(one for one in jobs(data, "one-per-class") if one.label.title == CLASS)
    return animated(film_of(chosen))


def animated(whole: Film) -> bytes:
    """Frames of a film, as animated WebP."""
    last = min(whole.num_frames, round(LAST_S * FILM_RATE))
    numbers = range(round(FIRST_S * FILM_RATE), last, FILM_RATE // RATE)
    pictures = [small(whole.draw(number)) for number in numbers]
    buffer = io.BytesIO()
    pictures[0].save(
        buffer,
        "WEBP",
        save_all=True,
        append_images=pictures[1:],
        duration=1000 // RATE,
        loop=0,
        quality=QUALITY,
    )
    return buffer.getvalue()


def small(frame: Canvas) -> Image.Image:
    """One frame at the width of the page."""
    picture = Image.fromarray(frame.to_rgb())
    return picture.resize((WIDTH, round(picture.height * WIDTH / picture.width)))


def figures(data: Dataset) -> list[Picture]:
    """Figures of the report that are shown, two to a row."""
    found = overtaking.dataset_statistics(data)
    number = typical(found.sample)[CLASS]
    run = data.trajectory(number)
    example = diagram(run, overtaking.label(run).events)
    return [
        gallery.class_picture(found),
        gallery.pair_pictures(found)[-1],
        gallery.overtake_picture(CLASS, number, example, policy=found.sample.policy),
        gallery.distribution_pictures(found)[-1],
    ]


def report(data: Dataset) -> bytes:
    """Figures of a report on white cards, as PNG with a transparent ground."""
    pictures = [fitted(Image.open(io.BytesIO(to_png(one.draw())))) for one in figures(data)]
    rows = [pictures[place : place + 2] for place in range(0, len(pictures), 2)]
    heights = [max(one.height for one in row) + 2 * GAP for row in rows]
    size = (2 * CARD + GAP, sum(heights) + GAP * (len(rows) - 1))
    sheet = Image.new("RGBA", size, (0, 0, 0, 0))
    pen, top = ImageDraw.Draw(sheet), 0
    for row, height in zip(rows, heights, strict=True):
        for place, one in enumerate(row):
            left = place * (CARD + GAP)
            pen.rounded_rectangle((left, top, left + CARD, top + height), CORNER, fill="white")
            sheet.paste(one, (left + GAP, top + (height - one.height) // 2))
        top += height + GAP
    buffer = io.BytesIO()
    sheet.quantize(128, Image.Quantize.FASTOCTREE).save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def fitted(picture: Image.Image) -> Image.Image:
    """A figure at the width of a card."""
    width = CARD - 2 * GAP
    return picture.convert("RGB").resize((width, round(picture.height * width / picture.width)))


def views(data: Dataset, folder: Path) -> Iterator[tuple[str, bytes]]:
    """The page of `overtaking view` in a browser, light and dark: names and pictures."""
    from playwright.sync_api import sync_playwright
    from tests.support.serving import serving

    page = overtaking.write_viewer_page(data, folder / "page.html", simulation_ids=VIEWED)
    with sync_playwright() as playwright, serving(data) as url:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        for scheme in ("light", "dark"):
            shown = browser.new_page(color_scheme=scheme, viewport=WINDOW)
            shown.goto(page.path.as_uri() + MOMENT)
            yield f"view-{scheme}.webp", shot(shown)
        shown = browser.new_page(viewport=WINDOW)
        shown.goto(url)
        for name, (link, scheme, scrolled) in SERVED.items():
            shown.wait_for_selector("main", state="attached")  # The token has been used then.
            shown.emulate_media(color_scheme=scheme)
            shown.goto("about:blank")
            shown.goto(url.partition("#")[0] + link)
            yield f"view-{name}.webp", shot(shown, scrolled)
        browser.close()


def shot(page: Page, scrolled: int = 0) -> bytes:
    """The window once nothing is awaited, as WebP."""
    page.wait_for_selector("main", state="attached")
    page.wait_for_timeout(SETTLED_MS)
    page.wait_for_selector("[aria-busy=true]", state="detached")
    page.evaluate("(y) => scrollTo(0, y)", scrolled)
    page.wait_for_timeout(SETTLED_MS)
    with Image.open(io.BytesIO(page.screenshot())) as picture:
        buffer = io.BytesIO()
        picture.convert("RGB").save(buffer, "WEBP", quality=82, method=6)
    return buffer.getvalue()


def main() -> None:
    """Write all pictures."""
    with tempfile.TemporaryDirectory() as folder:
        data = overtaking.generate_dataset(
            "pinto2023-physical", num_simulations=SIMULATIONS, seed=SEED, out=Path(folder) / "data"
        )
        made = [("film.webp", film(data)), ("report.png", report(data))]
        for name, content in [*made, *views(data, Path(folder))]:
            (HERE / name).write_bytes(content)
            print(f"docs/figures/{name}: {len(content) / 1000:.0f} kB")


if __name__ == "__main__":
    main()
