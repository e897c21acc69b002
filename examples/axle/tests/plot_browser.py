#!/usr/bin/env python3
"""Opens the pages of `axle plot` in headless Chromium, and compares what they show beside the mouse
with what `axle decode --json` says. Wheel, keys, drag, double click and legend do what they should,
dark pages have dark paper, and no page asks for anything but itself.

Needs the Debian package chromium; without playwright it starts again through export.sh, which
installs it. AXLE is the program, by default that of target/debug. Exit code 1 at a difference.
"""
import json
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
try:
    from playwright.sync_api import sync_playwright
except ImportError:
    os.execvp("bash", ["bash", Path(__file__).with_name("export.sh"), "plot_browser.py"])

AXLE = os.environ.get("AXLE") or ROOT / "target/debug/axle"
PER_CURVE, LEAST_VALUES = 6, 250
HELD = (", set-point", "speed", "steering")
UNITS = {"Velocity": "1/s", "Position": "turns", "Command": "%", "Wheel speed": "1/min",
         "Acceleration": "g", "Angular velocity": "°/s", "Magnetic field": "counts",
         "Heading": "°", "Battery": "%", "Voltage": "V", "Current": "A", "Power": "W"}
WHEELS = ("front left", "front right", "back left", "back right")
# Panel, field, names of the curves, and what one of the unit is.
REPORT = [("Wheel speed", "rpm", WHEELS, 1), ("Acceleration", "acc", "xyz", 16384),
          ("Angular velocity", "gyro", "xyz", 16.4), ("Magnetic field", "mag", "xyz", 1),
          ("Heading", "heading", ["heading"], 1), ("Battery", "battery_pct", ["battery"], 1),
          ("Voltage", "voltage_dv", ["voltage"], 10), ("Current", "current_ca", ["current"], 100),
          ("Power", "power_w", ["power"], 1)]
# Capture, options of decode, and a curve that is hidden: its panel, name and colour.
PAGES = [("motors.pcapng", [], "Velocity", "node 1", (0x00, 0x72, 0xB2)),
         ("drive.pcapng", [], "Wheel speed", "back right", (0xE0, 0x8E, 0x00)),
         ("ucp.bin", ["--protocol", "ucp"], "Angular velocity", "y", (0xE0, 0x8E, 0x00))]


def check(condition, text):
    if not condition:
        sys.exit(f"plot_browser.py: {text}")


def curves(lines):
    """What has to be on the page: (panel, series) -> [(place, value)]."""
    found, first = {}, round(lines[0].get("t", 0) * 1e6)
    for line in lines:
        x = (round(line["t"] * 1e6) - first) / 1e6 if "t" in line else line["offset"]
        message, values = line.get("message", ""), []
        if message == "write" or message.endswith("_response"):
            series = f"node {line['node']}" + ", set-point" * (message == "write")
            mode = line.get("mode") if message == "write" else message.removesuffix("_response")
            if mode == "velocity":
                values = [("Velocity", series, line["rps"])]
            elif mode == "position":
                values = [("Position", series, line["rotation"] + line["count"] / 8192)]
        elif message == "motor_control":
            values = [("Command", "speed", line["speed"]), ("Command", "steering", line["angular"])]
        elif message == "report":
            for panel, field, names, one in REPORT:
                numbers = line[field] if isinstance(line[field], list) else [line[field]]
                values += [(panel, *pair) for pair in zip(names, (it / one for it in numbers))]
        for panel, series, y in values:
            if not isinstance(y, str):
                found.setdefault((panel, series), []).append((x, y))
    return found


class Page:
    """A page that is open."""

    def __init__(self, browser, path, expected, has_times):
        self.page, self.expected, self.has_times = browser.new_page(), expected, has_times
        self.page.set_viewport_size({"width": 1200, "height": 1300})
        self.page.goto(path.as_uri())
        self.titles = self.page.evaluate("panels.map(it => it.panel.title)")
        of_values = set(self.titles) - {"Errors", "Response time"}
        check(of_values == {panel for panel, _ in expected}, f"panels: {self.titles}")

    def view(self):
        return self.page.eval_on_selector("html", "it => [+it.dataset.from, +it.dataset.to]")

    def box(self, panel):
        """Left, right and middle of the curves of a panel on the screen."""
        return self.page.evaluate("""number => {
            const s = panels[number]; s.canvas.scrollIntoView({block: "center"});
            const b = s.canvas.getBoundingClientRect();
            return [b.left + s.left, b.left + s.right, b.top + (s.top + s.bottom) / 2] }""",
            self.titles.index(panel))

    def hover(self, panel, x):
        """Moves the mouse to a place of the axis; the place that is told, and name -> text."""
        left, right, y = self.box(panel)
        begin, end = self.view()
        self.page.mouse.move(left + (x - begin) / (end - begin) * (right - left), y)
        tip = self.page.locator("#tip")
        check(tip.is_visible(), f"{panel}: no values beside the mouse")
        rows = "rows => rows.map(row => [...row.cells].map(it => it.textContent))"
        return tip.locator("b").inner_text(), dict(tip.locator("tr").evaluate_all(rows))

    def values(self, panel, series, at):
        """Checks what is told beside a value, with the axis zoomed to its neighbourhood."""
        points = self.expected[panel, series]
        x, _ = points[at]
        near = min((abs(other - x) for other, _ in points if other != x), default=1)
        self.page.evaluate(f"location.hash = '#{max(0, x - 4 * near):.6f},{x + 4 * near:.6f}';"
                           "new Promise(done => setTimeout(done, 0))")
        place, rows = self.hover(panel, x)
        told = f"{x:.6f} s" if self.has_times else f"byte {x}"
        check(place == told, f"{panel}, {series}: {place} is told, not {told}")
        check(series in rows, f"{panel} at {told}: no {series} in {rows}")
        for name, text in rows.items():
            most, points = 0 if name == series else 5 * near, self.expected[panel, name]
            same = [y for other, y in points if abs(other - x) <= most]
            if name.endswith(HELD):
                same = [y for other, y in points if other <= x][-1:]
            number, unit = text.replace("\N{MINUS SIGN}", "-").split(" ")
            is_there = any(math.isclose(float(number), y, abs_tol=1e-12) for y in same)
            check(is_there and unit == UNITS[panel], f"{panel}, {name}, {told}: {text}, not {same}")

    def zooming(self, panel):
        mouse = self.page.mouse
        self.page.click("#all")
        everything = self.view()
        left, right, y = self.box(panel)
        # A wheel is at a whole pixel.
        x = round(left + (right - left) * 0.75)
        part = (x - left) / (right - left)
        mouse.move(x, y)
        mouse.wheel(0, -1000)
        self.page.wait_for_function("location.hash !== ''")
        begin, end = self.view()
        check(end - begin < everything[1] / 3, f"the wheel does not zoom: {begin} to {end}")
        moves = (begin + (end - begin) * part) / everything[1] - part
        check(abs(moves) < 1e-6, f"the place at the mouse moves by {moves}")
        address = self.page.evaluate("location.hash.slice(1).split(',').map(Number)")
        check(math.isclose(address[0], begin, abs_tol=1e-6), f"in the address is {address}")
        mouse.down()
        mouse.move(x + (right - left) / 4, y)
        mouse.up()
        by = (begin - self.view()[0]) / (end - begin)
        check(abs(by - 1 / 4) < 1e-6, f"a drag moves by {by}")
        self.page.keyboard.press("+")
        zoomed = (self.view()[1] - self.view()[0]) / (end - begin)
        check(abs(zoomed - 1 / 2) < 1e-6, f"the key + zooms to {zoomed}")
        mouse.dblclick(x, y)
        check(self.view() == everything, f"a double click does not show all: {self.view()}")

    def hiding(self, panel, series, rgb):
        """A click on the legend hides a curve, and the dots of its colour are gone."""
        number, (x, _), dots = self.titles.index(panel), self.expected[panel, series][0], []
        for is_there in (True, False, True):
            check((series in self.hover(panel, x)[1]) == is_there, f"{series}, not {is_there}")
            # Those of a thin line are mixed with the paper.
            dots.append(self.page.evaluate("""([number, rgb]) => {
                const c = panels[number].canvas;
                const d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
                return d.filter((_, at) => at % 4 === 0 && rgb.every(
                    (it, k) => Math.abs(d[at + k] - it) < 64)).length }""", [number, rgb]))
            self.page.evaluate("([number, name]) => [...panels[number].legend.children]"
                               ".find(it => it.textContent === name).click()", [number, series])
        check(dots[0] > dots[1] + 300, f"{series}: {dots} dots in its colour")

    def paper(self):
        for scheme, paper in (("light", "rgb(255, 255, 255)"), ("dark", "rgb(21, 24, 28)")):
            self.page.emulate_media(color_scheme=scheme)
            found = self.page.evaluate("getComputedStyle(document.body).backgroundColor")
            check(found == paper, f"{scheme} paper is {found}")


def main():
    values, dice = 0, random.Random(7)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"))
        for name, options, panel, series, rgb in PAGES:
            capture, path = ROOT / "examples/captures" / name, Path(folder) / f"{name}.html"
            subprocess.run([AXLE, "plot", capture, "-o", path], check=True)
            out = subprocess.check_output([AXLE, "decode", "--json", *options, capture])
            lines = [json.loads(line) for line in out.splitlines()][:-1]
            page = Page(browser, path, curves(lines), "t" in lines[0])
            for of_curve, points in sorted(page.expected.items()):
                for at in dice.sample(range(len(points)), min(PER_CURVE, len(points))):
                    page.values(*of_curve, at)
                    values += 1
            page.zooming(panel)
            page.hiding(panel, series, rgb)
            page.paper()
            odd = [it.url for it in page.page.requests()][1:] + page.page.page_errors()
            check(not odd, f"{name} asks for, or fails with: {odd}")
    check(values >= LEAST_VALUES, f"only {values} values were compared")
    print(f"{values} values of {len(PAGES)} pages: 0 differences")


if __name__ == "__main__":
    main()
