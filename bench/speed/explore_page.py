"""From a slider of `fretwear explore` to the new curve on the screen.

    python -m bench.speed.explore_page [--case CASE] [--turns N]

Starts the command on a case (121 points of the sector with 16 pairs), opens its page in a Chromium
without a window, and turns each slider by the arrow keys. The clock is that of the browser: from
the key that goes down to the second frame after the new curve has come, when it has been painted.
Once with few points, where the sweep is a long one; the whole curve is the last that comes.

Other programs on the machine lengthen this; the processor time of both sides is beside it.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]

#: Notes when a key goes down, and every curve that is on the screen after it.
WATCH = """
const models = [...Bokeh.documents[0]._all_models.values()]
const now = models.find(m => m.type == "LegendItem" && m.label.value == "now")
window.seen = {down: null, curves: []}
document.addEventListener("keydown", () => {
  window.seen = {down: performance.now(), curves: []} }, {capture: true})
now.renderers[0].data_source.properties.data.change.connect(() => {
  const seen = window.seen
  requestAnimationFrame(() => requestAnimationFrame(() => seen.curves.push(performance.now()))) })
return models.filter(m => m.type == "Slider").map(m => [m.id, m.title])
"""
WORDS = """return [...Bokeh.documents[0]._all_models.values()]
  .filter(m => m.type == "Div").map(m => m.text).join(" ")"""
HANDLE = """return Bokeh.index.find_one_by_id(arguments[0]).shadow_el
  .querySelector(".noUi-handle")"""


def processor_time(process: int) -> float:
    """Processor time of a process and of all below it [s]."""
    parents, times = {}, {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = entry.read_text().rpartition(")")[2].split()
        except OSError:  # it has just ended
            continue
        parents[int(entry.parent.name)] = int(fields[1])
        times[int(entry.parent.name)] = int(fields[11]) + int(fields[12])
    family = {process}
    while more := {one for one, parent in parents.items() if parent in family} - family:
        family |= more
    return sum(times.get(one, 0) for one in family) / os.sysconf("SC_CLK_TCK")


def wait(browser: Any, script: str, met: Any) -> Any:
    """What a script gives once it is what is waited for."""
    for _ in range(1200):
        found = browser.execute_script(f"try {{ {script} }} catch (e) {{ return null }}")
        if found is not None and met(found):
            return found
        time.sleep(0.05)
    raise SystemExit(f"the page does not answer; last: {found}")


def turn(browser: Any, slider: str, key: str) -> list[float]:
    """Milliseconds from a key to every curve that followed."""
    browser.execute_script(HANDLE, slider).send_keys(key)
    # `highest ...; 0.12 s` is what the page says once a sweep is done.
    wait(browser, WORDS, lambda words: "highest" in words and "more follow" not in words)
    seen = wait(browser, "return window.seen", lambda found: found["curves"])
    return [shown - seen["down"] for shown in seen["curves"]]


def main() -> None:
    """Command line."""
    from selenium import webdriver
    from selenium.webdriver.common.keys import Keys

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--case", type=Path, default=ROOT / "example" / "blade_sector" / "frf.nml")
    parser.add_argument("--turns", type=int, default=12, help="of each slider (default 12)")
    options = parser.parse_args()
    driver = shutil.which("chromedriver")
    if driver is None:
        raise SystemExit("no Chromium with its driver (Debian: chromium-driver)")
    chosen = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1400,1000"):
        chosen.add_argument(argument)
    with subprocess.Popen([sys.executable, "-m", "fretwear", "explore", options.case,
                           "--no-browser"], stdout=subprocess.PIPE, text=True) as server:
        browser = webdriver.Chrome(options=chosen, service=webdriver.ChromeService(driver))
        try:
            assert server.stdout is not None
            browser.get(server.stdout.readline().split()[0])
            wait(browser, WORDS, lambda words: "highest" in words)
            time.sleep(1.0)  # loops and flanks of the first curve
            driver_process = browser.service.process.pid
            print("| slider | to the first curve, median (largest) [ms] | to the whole curve | "
                  "processor time a turn: server, browser |\n|---|---|---|---|")
            for slider, title in browser.execute_script(WATCH):
                before = processor_time(server.pid), processor_time(driver_process)
                shown = [turn(browser, slider, (Keys.ARROW_LEFT, Keys.ARROW_RIGHT)[k % 2])
                         for k in range(options.turns)]
                spent = [(processor_time(process) - start) / options.turns for process, start
                         in zip((server.pid, driver_process), before)]
                first, whole = (np.array([times[k] for times in shown]) for k in (0, -1))
                print(f"| {title} | {np.median(first):.0f} ({first.max():.0f}) | "
                      f"{np.median(whole):.0f} ({whole.max():.0f}) | "
                      + ", ".join(f"{1e3 * seconds:.0f} ms" for seconds in spent) + " |")
        finally:
            browser.quit()
            server.terminate()


if __name__ == "__main__":
    main()
