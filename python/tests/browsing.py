"""A browser without a window, for tests of pages."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

__all__ = ["headless_browser", "wait_for"]


@pytest.fixture(name="browser")
def headless_browser() -> Iterator[Any]:
    """A Chromium without a window."""
    webdriver = pytest.importorskip("selenium.webdriver")
    pytest.importorskip("bokeh")
    driver = shutil.which("chromedriver")
    if driver is None:
        pytest.skip("no Chromium with its driver (Debian: chromium-driver)")
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1400,1000"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"performance": "ALL"})
    browser = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    browser.set_script_timeout(60)
    yield browser
    browser.quit()


def wait_for(browser: Any, script: str, met: Callable[[Any], bool]) -> Any:
    for _ in range(300):
        found = browser.execute_script(f"try {{ {script} }} catch (e) {{ return null }}")
        if found is not None and met(found):
            return found
        time.sleep(0.1)
    raise AssertionError(f"the page did not come to what was waited for; last: {found}")
