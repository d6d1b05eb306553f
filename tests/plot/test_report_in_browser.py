"""The report in Chromium, on a desk and on a phone: nothing cut off, no errors, a surface that turns."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_run import write_run
from test_plot import write_vibration

from asperity.plot import plot_run
from asperity.plot.report import write_report

webdriver = pytest.importorskip("selenium.webdriver", reason="needs python3-selenium, as .ci/run installs it")
DRIVER = shutil.which("chromedriver")
pytestmark = pytest.mark.skipif(DRIVER is None, reason="needs chromium-driver, as .ci/run installs it")

WIDTHS = {"phone": 390, "desk": 1280}
# Boxes that reach beyond the page, unless a box around them scrolls.
CUT_OFF = """
const scrolls = (e) => e && (["auto", "scroll"].includes(getComputedStyle(e).overflowX) || scrolls(e.parentElement));
return [...document.body.querySelectorAll("*")].filter((e) => {
  const box = e.getBoundingClientRect();
  return box.width > 0 && (box.right > innerWidth + 0.5 || box.left < -0.5) && !scrolls(e.parentElement);
}).map((e) => `${e.tagName} ${e.textContent.slice(0, 40)}`);
"""
BROKEN = """
const bad = (i) => !i.complete || i.naturalWidth === 0;
return [...document.querySelectorAll("img[src]")].filter(bad).map((i) => i.alt);
"""
# Boxes that scroll sideways, of those that may, and of these the ones that say so.
SCROLLS = """
const wide = [...document.querySelectorAll(".wide, .scroll")].filter((e) => e.scrollWidth > e.clientWidth + 1);
const said = wide.filter((e) => getComputedStyle(e, "::before").content.includes("scroll"));
return [wide.length, said.length];
"""
# Texts that a page writes on its surface, with their places.
RECORD = """
window.written = [];
const write = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
  written.push([text, x / this.canvas.width, y / this.canvas.height]);
  write.call(this, text, x, y);
};
"""
SMALLEST = """
const size = (e) => parseFloat(getComputedStyle(e).fontSize);
return Math.min(...[...document.querySelectorAll("p, td, th, li, small")].map(size));
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report with all sections: warnings, assumptions, figures of contact and vibration."""
    folder = write_run(tmp_path_factory.mktemp("run"))
    write_vibration(folder)
    path = folder / "summary.json"
    summary = json.loads(path.read_text(encoding="utf-8"))
    record = {"name": "small strain", "value": 0.12, "limit": 0.1, "bound": "most", "unit": "", "verdict": "doubtful",
              "source": "rms slope at which finite strain changes the force by 1 %", "detail": "rms slope",
              "advice": 'take material.kinematics = "finite", or press a smoother surface'}  # fmt: skip
    summary |= {"assumptions": [record, record | {"name": "adhesion", "verdict": "fine"}], "warnings": ["steep slopes"]}
    path.write_text(json.dumps(summary), encoding="utf-8")
    plot_run(folder)
    return write_report(folder)


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(executable_path=DRIVER))
    driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": RECORD})
    yield driver
    driver.quit()


def show(chromium: Any, page: Path, width: int) -> None:
    """Open a page in a window of a width, as a phone does below 500 pixels."""
    metrics = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": width < 500}
    chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    chromium.get(page.as_uri())


@pytest.mark.parametrize("width", WIDTHS.values(), ids=WIDTHS.keys())
def test_nothing_is_cut_off_and_all_pictures_are_there(chromium: Any, report: Path, width: int) -> None:
    show(chromium, report, width)
    assert chromium.execute_script("return innerWidth") == width
    assert chromium.execute_script("return document.documentElement.scrollWidth") <= width
    for opened in (False, True):
        chromium.execute_script(
            "document.querySelectorAll('details').forEach((d) => { d.open = arguments[0]; })", opened
        )
        assert chromium.execute_script(CUT_OFF) == []
    scrolling, said = chromium.execute_script(SCROLLS)
    assert scrolling == (said if width == WIDTHS["phone"] else 1) and (scrolling > 4) == (width == WIDTHS["phone"])
    assert chromium.execute_script(BROKEN) == []
    assert chromium.execute_script("return document.querySelectorAll('img[src]').length") == 8
    assert chromium.get_log("browser") == []


def test_the_page_opens_with_the_verdict(chromium: Any, report: Path) -> None:
    """On a phone too the result is on the first screen, and raw numbers are folded away."""
    show(chromium, report, WIDTHS["phone"])
    bottom = "return document.querySelector('.verdict').getBoundingClientRect().bottom"
    assert 0 < chromium.execute_script(bottom) < 400
    assert "403 µN ± 3 %" in chromium.find_element("css selector", ".verdict").text
    assert "yield_strength" not in chromium.find_element("css selector", "body").text
    # folded away where none is doubtful
    assert chromium.find_element("css selector", "table.assumptions").is_displayed()
    assert chromium.execute_script(SMALLEST) >= 11  # pixels


# Share of the pixels of the surface that are drawn, and of these the share that is coloured by pressure.
DRAWN = """
const c = document.querySelector("canvas.turn");
const { data } = c.getContext("2d").getImageData(0, 0, c.width, c.height);
let drawn = 0, loaded = 0, sum = 0;
for (let i = 0; i < data.length; i += 4) {
  drawn += data[i + 3] > 0;
  loaded += data[i + 3] > 0 && data[i] !== data[i + 2];
  sum = (sum + (i % 9973) * data[i]) % 1000003;
}
return [4 * drawn / data.length, loaded / drawn, sum];
"""


@pytest.mark.parametrize("width", WIDTHS.values(), ids=WIDTHS.keys())
def test_the_surface_turns(chromium: Any, report: Path, width: int) -> None:
    """Seen from above it is the map: the share of the patch in contact. Half a turn later it looks different."""
    from selenium.webdriver import ActionChains, Keys

    show(chromium, report, width)
    canvas = chromium.find_element("css selector", "canvas.turn")
    assert canvas.is_displayed() and canvas.size["width"] <= width
    after_drawing(chromium)
    written = chromium.execute_script("return written")
    assert {text for text, *_ in written} == {"x, 1 µm", "y, 1 µm", canvas.get_attribute("data-range")}
    assert all(0.0 < place < 1.0 for _, *places in written for place in places)
    for _ in range(10):
        canvas.send_keys(Keys.ARROW_DOWN)
    drawn, loaded, above = after_drawing(chromium)
    assert 0.2 < drawn < 0.7
    top = np.load(report.parent / "fields/top.npz")
    assert loaded == pytest.approx(np.mean(top["touched"][4]), rel=0.15)
    ActionChains(chromium).drag_and_drop_by_offset(canvas, 100, 0).perform()
    assert after_drawing(chromium)[2] != above
    # reading it back as this test does is slow, Chromium says
    assert [line for line in chromium.get_log("browser") if "readback" not in line["message"]] == []


def after_drawing(chromium: Any) -> list[float]:
    """What DRAWN returns once the next picture is there."""
    later = f"requestAnimationFrame(() => requestAnimationFrame(() => done((() => {{{DRAWN}}})())));"
    script = f"const done = arguments[0]; {later}"
    return list(chromium.execute_async_script(script))


def test_a_fault_of_the_page_is_seen(chromium: Any, report: Path, tmp_path: Path) -> None:
    """The checks of this file find what they look for."""
    text = report.read_text(encoding="utf-8")
    bad = tmp_path / "bad.html"
    faults = '<p style="width: 2000px">wide</p><img src="data:image/png;base64,AAAA" alt="broken"><script>x.y</script>'
    bad.write_text(text.replace("<h2>Figures</h2>", f"<h2>Figures</h2>{faults}"), encoding="utf-8")
    show(chromium, bad, WIDTHS["desk"])
    assert chromium.execute_script(CUT_OFF) == ["P wide"]
    assert chromium.execute_script(BROKEN) == ["broken"]
    assert chromium.get_log("browser") != []  # the policy of the page refuses the script
