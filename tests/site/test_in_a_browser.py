"""The site builds strictly with both builders, and opens as files in a browser: no error, no network, search, equations, narrow.

`python -m pytest -m site`, with the extra `docs`; without Chromium and its driver the browser's part is left out, unless
`JAXVEH_BROWSER=required`. What pages print is taken from `JAXVEH_EXECUTED`.
"""

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from notebooks.site.executed import ROOT

pytestmark = pytest.mark.site
NARROW, WIDE = 400, 1280
FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage",
)  # fmt: skip


def build(builder):
    executed = os.environ.get("JAXVEH_EXECUTED", str(ROOT / "build" / "site" / "executed"))
    done = subprocess.run(
        [sys.executable, "-m", "notebooks.site", "--builder", builder, "--executed", executed],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    assert not done.returncode, done.stdout + done.stderr


@pytest.fixture(scope="module")
def site():
    build("mkdocs")  # The stricter link check.
    build("zensical")
    return ROOT / "build" / "site" / "html"


@pytest.fixture(scope="module")
def browser():
    if not (shutil.which("chromium") and shutil.which("chromedriver")):
        if os.environ.get("JAXVEH_BROWSER") == "required":
            pytest.fail("no chromium and chromedriver")
        pytest.skip("needs Chromium and its driver (Debian: chromium, chromium-driver)")
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for flag in FLAGS:
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    yield driver
    driver.quit()


def set_width(browser, width):
    metrics = {"width": width, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)


def wait_for(browser, script, seconds=20.0):
    """What a script returns, once that is something."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if found := browser.execute_script(script):
            return found
        time.sleep(0.1)
    raise AssertionError(f"nothing within {seconds} s: {script}")


def test_every_page_opens_without_an_error_or_the_network_and_is_readable_on_a_telephone(site, browser):
    pages = [path for path in sorted(site.rglob("*.html")) if path.name != "404.html"]
    assert len(pages) > 60
    wrong = []
    for page in pages:
        set_width(browser, WIDE)
        browser.get(page.as_uri())
        wait_for(browser, "return document.readyState == 'complete'")
        place = page.relative_to(site)
        wrong += [f"{place}: {entry['message']}" for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
        asked = re.findall(
            r'"url":"(https?://[^"]+)"', "".join(entry["message"] for entry in browser.get_log("performance"))
        )
        wrong += [f"{place}: asks for {address}" for address in asked]
        broken = "return [...document.images].filter(i => i.complete && !i.naturalWidth).map(i => i.src)"
        wrong += [f"{place}: no picture {source}" for source in browser.execute_script(broken)]
        set_width(browser, NARROW)
        overhang = browser.execute_script("return document.documentElement.scrollWidth - window.innerWidth")
        wrong += [f"{place}: {overhang} pixels too wide"] if overhang > 0 else []
    assert not wrong


def test_search_finds_a_filter(site, browser):
    set_width(browser, WIDE)
    browser.get((site / "index.html").as_uri())
    wait_for(browser, "return document.readyState == 'complete'")
    browser.find_element("tag name", "body").send_keys("\ue009k")  # Control and k.
    root = "[...document.querySelectorAll('*')].map(e => e.shadowRoot).find(Boolean)"
    box = wait_for(browser, f"const s = {root}; return s && s.querySelector('input')")
    for letter in "Unscented":
        box.send_keys(letter)
        time.sleep(0.05)
    found = wait_for(
        browser,
        f"return [...{root}.querySelectorAll('a')].map(a => a.href).filter(h => h.includes('filters.Unscented'))",
    )
    assert any("reference/filters.html" in one for one in found)


def test_equations_are_drawn(site, browser):
    set_width(browser, WIDE)
    browser.get((site / "explanations" / "cars.html").as_uri())
    # A busy machine has not read the page to its end when `get` returns.
    wait_for(browser, "return document.readyState == 'complete' && document.querySelectorAll('math').length > 1")
    sizes = browser.execute_script(
        "return [...document.querySelectorAll('math')].map(m => m.getBoundingClientRect()).map(r => [r.width, r.height])"
    )
    assert len(sizes) >= 2 and all(width > 5 and height > 5 for width, height in sizes)
    text = browser.execute_script("return document.querySelector('article').innerText")
    assert "$$" not in text and "\\frac" not in text


def test_the_site_has_no_address_of_another_site_to_load(site):
    """Links may lead elsewhere; scripts, styles, fonts and pictures may not."""
    for page in site.rglob("*.html"):
        text = page.read_text()
        loaded = re.findall(
            r'<(?:script|img|iframe)[^>]*\bsrc="(https?:[^"]+)"|<link[^>]*rel="(?:stylesheet|icon|preload)"[^>]*href="(https?:[^"]+)"',
            text,
        )
        assert not loaded, Path(page).relative_to(site)
