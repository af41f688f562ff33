"""Pictures of the documents, and what each of them showed when it was made.

    python tests/helpers/pictures.py          # make the pictures of reports and studies anew
    python tests/helpers/pictures.py check    # compare the small study with what stands there

tests/golden/pictures has what a reader sees on each picture: the text of a report, the texts of a
figure and where its lines are. Figures of a study are compared by those of the small study, which
CI runs anyway.
"""

import contextlib
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from example_helpers import FIGURES, run_example
from golden import GOLDEN, compare, kept_of
from PIL import Image, ImageChops
from places import ROOT
from playwright.sync_api import sync_playwright
from transcript import figure_text, page_text

import accelstudy as acs

PICTURES = ROOT / "docs" / "figures"
PAPER, SMALL = ROOT / "results" / "paper", ROOT / "results" / "smoke"
MADE_BY = "make pictures"

REPORTS = {
    "report-calibration": ("log", "calibrated/report.html", (1000, 1010)),
    "report-diagnosis": ("hidden", "diagnosed/report.html", (1000, 1250)),
}
"""Pictures of reports: the example that writes the report, its path, and the size."""
BATCH = ("report-batch", (1000, 680))
OF_STUDIES = {
    "report-claims": ("claims.html", (1000, 890)),
    "report-explorer": ("explorer.html", (1100, 1360)),
}
"""Pictures of the pages of a study."""


def same_picture(one, other):
    """Whether two pictures look the same: hardly a point differs by more than a shade."""
    pair = [Image.open(path).convert("L") for path in (one, other)]
    if pair[0].size != pair[1].size:
        return False
    return (np.asarray(ImageChops.difference(*pair)) > 60).mean() < 2e-4


def seen(path):
    """What a reader sees of a page (HTML) or of a figure (SVG)."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".html":
        return page_text(text)
    parts = re.split(r'<g id="axes_\d+">', re.sub(r"<defs>.*?</defs>", "", text, flags=re.DOTALL))
    return "\n".join([figure_text(text), *map(_drawn, parts[1:])])


def _drawn(axes):
    """How many paths and markers axes have, and where they are in the middle, points."""
    found = re.findall(r' d="([^"]*)"|<use [^>]*x="([\d.]+)" y="([\d.]+)"', axes)
    places = [re.findall(r"[\d.]+", d) if d else (x, y) for d, x, y in found]
    middle = [np.mean([float(p[i]) for p in places if len(p) > 1] or [0]) for i in (0, 1)]
    return f"{len(found)} drawn at {middle[0]:.2f} {middle[1]:.2f}"


def of_study(folder):
    """What is seen of a study, by the names of the pictures."""
    figures = {path.stem: path for path in sorted(folder.glob("figures/*.svg"))}
    pages = {name: folder / page for name, (page, _) in OF_STUDIES.items()}
    found = {name: path for name, path in (figures | pages).items() if path.exists()}
    return {name: seen(path) for name, path in found.items() if (PICTURES / f"{name}.png").exists()}


def overview(log, hidden, folder):
    """Calibrate the campaigns of two examples as a batch, in an empty folder; the page."""
    for path in (log / "box", hidden / "session"):
        shutil.copytree(path, folder / path.name)
    with contextlib.chdir(folder):  # as the page says where the campaigns are
        acs.batch(["box", "session"]).save("batch")
    return folder / "batch/report.html"


def keep(shown):
    """Take note of what pictures show that were made anew."""
    for name, text in shown.items():
        (GOLDEN / "pictures" / f"{name}.txt").write_text(f"{text}\n", encoding="utf-8")


def stale(now):
    """Pictures that show something else than now, each with the first line that differs."""
    before = kept_of("pictures")
    found = {name: compare(before.get(name, ""), text)[0] for name, text in now.items()}
    return [f"{name}, line {lines[0]}" for name, lines in found.items() if lines]


def photograph(browser, page, picture, size):
    """Take the top of a page as a picture of few colours."""
    tab = browser.new_page(viewport=dict(zip(("width", "height"), size, strict=True)))
    tab.goto(page.resolve().as_uri())
    if tab.locator("#charts").count():  # what a script of the page fills last
        tab.wait_for_selector("#charts svg")
        tab.wait_for_timeout(1000)
    tab.screenshot(path=picture)
    tab.close()
    Image.open(picture).convert("RGB").quantize(128).save(picture, optimize=True)


def shrink(drawn, picture):
    """Take a figure of a study in the size of the picture that it replaces."""
    width = Image.open(picture).width
    image = Image.open(drawn).convert("RGB")
    image = image.resize((width, round(image.height * width / image.width)), Image.LANCZOS)
    image.quantize(128, method=Image.Quantize.FASTOCTREE).save(picture, optimize=True)


def make_anew():
    """Make pictures of the reports of the examples and of the study of the paper."""
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        path = shutil.which("chromium") or shutil.which("chromium-browser")
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        reports, texts = {}, {}
        for name in FIGURES:
            run_example(name, Path(folder, name))
        for name, (example, report, size) in REPORTS.items():
            reports[name] = Path(folder, example, report), size
        batch = overview(Path(folder, "log"), Path(folder, "hidden"), Path(folder, "batch"))
        reports[BATCH[0]] = batch, BATCH[1]
        for name, (page, size) in reports.items():
            photograph(browser, page, PICTURES / f"{name}.png", size)
            texts[name] = seen(page)
        for name, (page, size) in OF_STUDIES.items():
            photograph(browser, PAPER / page, PICTURES / f"{name}.png", size)
    drawn = [
        f"results/paper/figures/{name}.png" for name in of_study(PAPER).keys() - OF_STUDIES.keys()
    ]
    subprocess.run(["snakemake", "--cores", "2", *drawn], cwd=ROOT, check=True)
    for path in drawn:
        shrink(ROOT / path, PICTURES / Path(path).name)
    keep(texts | of_study(SMALL))


def main(*arguments):
    """Make pictures anew, or compare them."""
    if not arguments:
        make_anew()
    elif old := stale(of_study(SMALL)):
        sys.exit(
            f"docs/figures: {', '.join(old)}: older than the code; `{MADE_BY}` makes them anew"
        )


if __name__ == "__main__":
    main(*sys.argv[1:])
