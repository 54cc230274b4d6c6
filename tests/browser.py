"""A headless Chromium for tests of pages; they are skipped where there is none."""

import contextlib
import json
import shutil
from pathlib import Path

import pytest

_FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
#: Texts whose contrast is below 4.5, the least of WCAG 2.1 (1.4.3) for text of this size.
_FAINT = """
const light = ([r, g, b]) => [r, g, b].map((c) => c / 255)
  .map((c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
  .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
const numbers = (colour) => colour.match(/[0-9.]+/g).map(Number);
const ground = (element) => {
  for (; element; element = element.parentElement) {
    const found = numbers(getComputedStyle(element).backgroundColor);
    if (found.length < 4 || found[3] > 0) return found;
  }
  return matchMedia("(prefers-color-scheme: dark)").matches ? [18, 18, 18] : [255, 255, 255];
};
const part = document.querySelector(arguments[0]), found = new Set();
const texts = document.createTreeWalker(part, NodeFilter.SHOW_TEXT);
while (texts.nextNode()) {
  const text = texts.currentNode.textContent.trim(), element = texts.currentNode.parentElement;
  if (!text || ["SCRIPT", "STYLE", "NOSCRIPT"].includes(element.tagName)) continue;
  const colour = getComputedStyle(element).color;
  const [low, high] = [colour, ground(element)]
    .map((c) => light(typeof c === "string" ? numbers(c) : c)).sort((a, b) => a - b);
  if ((high + 0.05) / (low + 0.05) < 4.5) found.add(`${text.slice(0, 30)}: ${colour}`);
}
return [...found];
"""


def start(width: int = 1280, height: int = 900):
    """A browser with a window of this size [px]; skips the test where it cannot be started."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    programs = [shutil.which(name) for name in ("chromium", "chromedriver")]
    if not all(programs):
        pytest.skip("Chromium is not installed: pages were not opened")
    options = webdriver.ChromeOptions()
    options.binary_location = programs[0]
    for flag in (*_FLAGS, f"--window-size={width},{height}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(options, webdriver.ChromeService(programs[1]))


def opened(browser, path: Path, *, ignored: str = "") -> None:
    """Open a page from a file; fails on any message of its console but those of a level."""
    browser.get(path.as_uri())
    told = [entry for entry in browser.get_log("browser") if entry["level"] != ignored]
    assert told == [], path


def foreign(browser) -> list[str]:
    """What the page has requested from elsewhere than files."""
    names = "return performance.getEntriesByType('resource').map((entry) => entry.name)"
    return [name for name in browser.execute_script(names) if not name.startswith("file:")]


def wait(browser, condition: str, seconds: float = 10.0) -> None:
    """Wait until an expression holds on the page; fails if it does not."""
    ui = pytest.importorskip("selenium.webdriver.support.ui")
    ui.WebDriverWait(browser, seconds).until(
        lambda window: window.execute_script(f"return Boolean({condition})"), condition
    )


def faint(browser, part: str = "body") -> list[str]:
    """The texts of a part of the page whose contrast is too low, with their colours."""
    return browser.execute_script(_FAINT, part)


def player(browser, call: str, nth: int = 0):
    """The value of an expression such as ``state()`` of a player on the page."""
    found = f"document.querySelectorAll('.player')[{nth}].player.{call}"
    return json.loads(browser.execute_script(f"return JSON.stringify({found} ?? null)"))


def picture(browser, nth: int = 0) -> str:
    """What a player's canvas shows, as text; equal for equal pictures."""
    canvas = f"document.querySelectorAll('.player .stage')[{nth}]"
    return browser.execute_script(f"return {canvas}.toDataURL()")


def drag(browser, element, across: int, down: int) -> None:
    """Drag from the middle of an element by some pixels."""
    chains = pytest.importorskip("selenium.webdriver.common.action_chains")
    chains.ActionChains(browser).drag_and_drop_by_offset(element, across, down).perform()


@contextlib.contextmanager
def as_phone(browser):
    """The browser as that of a phone with a touchscreen, whose processor has a quarter of ours."""
    screen = {"width": 390, "height": 844, "deviceScaleFactor": 3, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
    browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True})
    browser.execute_cdp_cmd("Emulation.setCPUThrottlingRate", {"rate": 4})
    yield
    browser.execute_cdp_cmd("Emulation.setCPUThrottlingRate", {"rate": 1})
    browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def swipe(browser, element, start, end, steps: int = 10) -> None:
    """Move a finger between two places (x, y) [px] from the corner of an element in sight."""
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", element)
    corner = browser.execute_script(
        "const box = arguments[0].getBoundingClientRect(); return [box.left, box.top]", element
    )
    for i in range(steps + 1):
        x, y = (c + a + (b - a) * i / steps for c, a, b in zip(corner, start, end, strict=True))
        touch = {"type": "touchMove" if i else "touchStart", "touchPoints": [{"x": x, "y": y}]}
        browser.execute_cdp_cmd("Input.dispatchTouchEvent", touch)
    browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
