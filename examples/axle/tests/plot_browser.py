#!/usr/bin/env python3
"""Opens the pages of `axle plot` in headless Chromium, and compares what they show with what
`axle decode --json` says.

    examples/axle/tests/plot_browser.py                 check the pages of three captures
    examples/axle/tests/plot_browser.py --planted       plant faults in the pages: each is found
    examples/axle/tests/plot_browser.py --keep FOLDER   keep screenshots there

The mouse is moved over the curves, and each value beside it is read back; the wheel, the keys, a
drag and a double click change the part of the axis that is shown; a click on the legend hides a
curve; dark and light pages have different paper; no page asks for anything but itself. Needs
Chromium (Debian package chromium). Talks to it through its pipe for developer tools.
"""

import argparse
import base64
import json
import math
import os
import pathlib
import random
import select
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import zlib

ROOT = pathlib.Path(__file__).resolve().parents[3]
CAPTURES = ROOT / "examples" / "captures"
AXLE = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug" / "axle"
PATIENCE = 30
SIZE = (1200, 1300)
MINUS = "\N{MINUS SIGN}"
COUNTS, G, DEGREES = 8192, 16384, 16.4


class Wrong(Exception):
    """A page that is not as it should be."""


def check(condition, text):
    if not condition:
        raise Wrong(text)


class Browser:
    """Chromium without a window, and a page in it."""

    def __init__(self):
        program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
        if program is None:
            sys.exit("plot_browser.py: no Chromium: install the Debian package chromium")
        self.home = tempfile.TemporaryDirectory(prefix="axle-plot-browser-", ignore_cleanup_errors=True)
        to_it, self.write = os.pipe()
        self.read, from_it = os.pipe()
        options = ["--headless", "--disable-gpu", "--hide-scrollbars", "--remote-debugging-pipe",
                   "--no-first-run", "--disable-extensions", "--disable-dev-shm-usage",
                   f"--user-data-dir={self.home.name}"]
        if os.geteuid() == 0:
            # Its sandbox needs another user. The pages are our own.
            options.append("--no-sandbox")
        self.process = subprocess.Popen(
            ["bash", "-c", f'exec "$@" 3<&{to_it} 4>&{from_it}', "bash", program, *options, "about:blank"],
            pass_fds=(to_it, from_it), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL)
        os.close(to_it)
        os.close(from_it)
        self.number, self.rest, self.events, self.session = 0, b"", [], None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network"):
            self.call(f"{domain}.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=SIZE[0], height=SIZE[1], deviceScaleFactor=1,
                  mobile=False)

    def message(self, end):
        """The next message."""
        while b"\0" not in self.rest:
            if not select.select([self.read], [], [], max(0, end - time.monotonic()))[0]:
                raise Wrong("Chromium does not answer")
            piece = os.read(self.read, 1 << 16)
            if not piece:
                raise Wrong("Chromium has ended")
            self.rest += piece
        one, self.rest = self.rest.split(b"\0", 1)
        return json.loads(one)

    def call(self, method, **params):
        self.number += 1
        request = {"id": self.number, "method": method, "params": params}
        if self.session is not None:
            request["sessionId"] = self.session
        os.write(self.write, json.dumps(request).encode() + b"\0")
        end = time.monotonic() + PATIENCE
        while True:
            message = self.message(end)
            if message.get("id") == self.number:
                if "error" in message:
                    raise Wrong(f"{method}: {message['error']['message']}")
                return message["result"]
            self.events.append(message)

    def value(self, script):
        """The value of an expression on the page."""
        result = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            raise Wrong(f"{script}: {result['exceptionDetails']['exception'].get('description', 'failed')}")
        return result["result"].get("value")

    def open(self, path):
        self.events.clear()
        self.call("Page.navigate", url=path.as_uri())
        end = time.monotonic() + PATIENCE
        while not any(event.get("method") == "Page.loadEventFired" for event in self.events):
            self.events.append(self.message(end))

    def mouse(self, kind, x, y, **more):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def key(self, text):
        self.call("Input.dispatchKeyEvent", type="keyDown", key=text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=text)

    def screenshot(self):
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def close(self):
        self.process.terminate()
        self.process.wait(PATIENCE)
        self.home.cleanup()


def pixels(png):
    """Width and rows of the dots of a PNG with 8 bits per colour."""
    at, data = 8, b""
    while at < len(png):
        length, kind = struct.unpack(">I4s", png[at:at + 8])
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", png[at + 8:at + 18])
        elif kind == b"IDAT":
            data += png[at + 8:at + 8 + length]
        at += 12 + length
    assert depth == 8 and colour in (2, 6), "not the PNG that Chromium makes"
    step = 3 if colour == 2 else 4
    data, rows, before = zlib.decompress(data), [], bytearray(width * step)
    for row in range(height):
        line = bytearray(data[row * (width * step + 1) + 1:(row + 1) * (width * step + 1)])
        filter_type = data[row * (width * step + 1)]
        for at in range(len(line)):
            left = line[at - step] if at >= step else 0
            up, corner = before[at], before[at - step] if at >= step else 0
            if filter_type == 1:
                line[at] = line[at] + left & 255
            elif filter_type == 2:
                line[at] = line[at] + up & 255
            elif filter_type == 3:
                line[at] = line[at] + (left + up) // 2 & 255
            elif filter_type == 4:
                guess = left + up - corner
                best = min((left, up, corner), key=lambda it: abs(guess - it))
                line[at] = line[at] + best & 255
        rows.append(line)
        before = line
    return step, rows


def count(png, rgb):
    """Number of dots of about this colour: those of a thin line are mixed with the paper."""
    step, rows = pixels(png)
    is_near = [[abs(value - wanted) < 64 for value in range(256)] for wanted in rgb]
    red, green, blue = is_near
    return sum(1 for row in rows for at in range(0, len(row), step)
               if red[row[at]] and green[row[at + 1]] and blue[row[at + 2]])


def run(*arguments):
    done = subprocess.run([str(AXLE), *map(str, arguments)], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"axle {' '.join(map(str, arguments))}: {done.stderr.strip()}")
    return done.stdout


def listing(capture, more):
    lines = [json.loads(line) for line in run("decode", "--json", *more, capture).splitlines()]
    return [line for line in lines if line["event"] in ("frame", "skipped")]


def curves(lines):
    """What has to be on the page: (panel, series) -> [(place, value)]."""
    found = {}
    has_times = "t" in lines[0]
    first = round(lines[0]["t"] * 1e6) if has_times else 0

    def put(panel, series, x, y):
        if isinstance(y, (int, float)):
            found.setdefault((panel, series), []).append((x, y))

    for line in lines:
        x = (round(line["t"] * 1e6) - first) / 1e6 if has_times else line["offset"]
        message = line.get("message")
        if message in ("write", "velocity_response", "position_response"):
            node = f"node {line['node']}"
            series = node + (", set-point" if message == "write" else "")
            mode = line.get("mode") if message == "write" else message.removesuffix("_response")
            if mode == "velocity":
                put("Velocity", series, x, line["rps"])
            elif mode == "position":
                put("Position", series, x, line["rotation"] + line["count"] / COUNTS)
        elif message == "motor_control":
            put("Command", "speed", x, line["speed"])
            put("Command", "steering", x, line["angular"])
        elif message == "report":
            wheels = ("front left", "front right", "back left", "back right")
            several = (("Wheel speed", "rpm", wheels, 1), ("Acceleration", "acc", "xyz", G),
                       ("Angular velocity", "gyro", "xyz", DEGREES), ("Magnetic field", "mag", "xyz", 1))
            for panel, field, names, one in several:
                for name, value in zip(names, line[field]):
                    put(panel, name, x, value / one)
            put("Heading", "heading", x, line["heading"])
            put("Battery", "battery", x, line["battery_pct"])
            put("Voltage", "voltage", x, line["voltage_dv"] / 10)
            put("Current", "current", x, line["current_ca"] / 100)
            put("Power", "power", x, line["power_w"])
    return found


HELD = (", set-point", "speed", "steering")
UNITS = {"Velocity": "1/s", "Position": "turns", "Command": "%", "Wheel speed": "1/min", "Acceleration": "g",
         "Angular velocity": "°/s", "Magnetic field": "counts", "Heading": "°", "Battery": "%", "Voltage": "V",
         "Current": "A", "Power": "W"}


class Page:
    """A page that is open."""

    def __init__(self, browser, expected, has_times):
        self.browser, self.expected, self.has_times = browser, expected, has_times
        self.titles = browser.value("[...document.querySelectorAll('h2')].map(it => it.firstChild.data)")
        check(set(self.titles) - {"Errors", "Response time"} == {panel for panel, _ in expected},
              f"panels: {self.titles}")

    def view(self):
        return self.browser.value("[document.documentElement.dataset.from, document.documentElement.dataset.to].map(Number)")

    def box(self, panel):
        """Left, right and middle of the curves of a panel on the screen."""
        number = self.titles.index(panel)
        self.browser.value(f"panels[{number}].canvas.scrollIntoView({{block: 'center'}})")
        left, right, top, bottom = self.browser.value(
            f"(s => {{ const b = s.canvas.getBoundingClientRect();"
            f" return [b.left + s.left, b.left + s.right, b.top + s.top, b.top + s.bottom] }})(panels[{number}])")
        return left, right, (top + bottom) / 2

    def hover(self, panel, x):
        """Moves the mouse to a place of the axis; the place that is told, and name -> text."""
        left, right, y = self.box(panel)
        begin, end = self.view()
        self.browser.mouse("mouseMoved", left + (x - begin) / (end - begin) * (right - left), y)
        check(self.browser.value("!document.getElementById('tip').hidden"), f"{panel}: no values beside the mouse")
        place = self.browser.value("document.querySelector('#tip b').textContent")
        rows = self.browser.value(
            "[...document.querySelectorAll('#tip tr')].map(it => [...it.cells].map(it => it.textContent))")
        return place, dict(rows)

    def values(self, panel, series, at):
        """Checks what is told beside a value, with the axis zoomed to its neighbourhood."""
        points = self.expected[panel, series]
        x, _ = points[at]
        neighbours = [other for other, _ in points if other != x]
        near = min((abs(other - x) for other in neighbours), default=1)
        self.browser.value(f"location.hash = '#{max(0, x - 4 * near):.6f},{x + 4 * near:.6f}'")
        self.browser.value("new Promise(done => setTimeout(done, 0))")
        place, rows = self.hover(panel, x)
        told = f"{x:.6f} s" if self.has_times else f"byte {x}"
        check(place == told, f"{panel}, {series}: {place} is told, not {told}")
        check(series in rows, f"{panel} at {told}: no {series} in {rows}")
        for name, text in rows.items():
            points = self.expected[panel, name]
            is_held = name.endswith(HELD)
            same = [y for other, y in points if (other <= x if is_held else abs(other - x) < 5 * near)]
            same = same[-1:] if is_held else same
            number, unit = text.replace(MINUS, "-").split(" ")
            check(unit == UNITS[panel], f"{panel}: the unit {unit}")
            check(any(math.isclose(float(number), y, rel_tol=1e-9, abs_tol=1e-12) for y in same),
                  f"{panel}, {name} at {told}: {text} is told, not {same}")
        exact = [y for other, y in self.expected[panel, series] if other == x]
        number = float(rows[series].replace(MINUS, "-").split(" ")[0])
        check(any(math.isclose(number, y, rel_tol=1e-9, abs_tol=1e-12) for y in exact),
              f"{panel}, {series} at {told}: {number} is told, not {exact}")

    def zooming(self, panel):
        """Wheel, keys, drag and double click."""
        browser = self.browser
        browser.value("document.getElementById('all').click()")
        everything = self.view()
        left, right, y = self.box(panel)
        # A wheel is at a whole pixel.
        x = round(left + (right - left) * 0.75)
        part = (x - left) / (right - left)
        place = everything[1] * part
        browser.mouse("mouseMoved", x, y)
        browser.mouse("mouseWheel", x, y, deltaX=0, deltaY=-1000)
        begin, end = self.view()
        check(end - begin < everything[1] / 3, f"the wheel does not zoom: {begin} to {end}")
        check(abs(begin + (end - begin) * part - place) < 1e-6 * everything[1], "the place at the mouse moves")
        address = browser.value("location.hash.slice(1).split(',').map(Number)")
        check(len(address) == 2 and math.isclose(address[0], begin, abs_tol=1e-6), f"in the address is {address}")
        browser.mouse("mousePressed", x, y, button="left", buttons=1, clickCount=1)
        browser.mouse("mouseMoved", x + (right - left) / 4, y, button="left", buttons=1)
        browser.mouse("mouseReleased", x + (right - left) / 4, y, button="left", clickCount=1)
        moved = self.view()
        check(math.isclose(begin - moved[0], (end - begin) / 4, rel_tol=1e-6), f"a drag does not move: {moved}")
        browser.key("+")
        check(math.isclose(self.view()[1] - self.view()[0], (end - begin) / 2, rel_tol=1e-6), "the key + does not zoom")
        for clicks in (1, 2):
            browser.mouse("mousePressed", x, y, button="left", buttons=1, clickCount=clicks)
            browser.mouse("mouseReleased", x, y, button="left", clickCount=clicks)
        check(self.view() == everything, f"a double click does not show all: {self.view()}")

    def hiding(self, panel, series):
        points = self.expected[panel, series]
        x = points[len(points) // 2][0]
        click = f"[...panels[{self.titles.index(panel)}].legend.children].find(it => it.textContent === {json.dumps(series)}).click()"
        check(series in self.hover(panel, x)[1], f"{series} is not there to be hidden")
        self.browser.value(click)
        check(series not in self.hover(panel, x)[1], f"{series} is not hidden")
        self.browser.value(click)
        check(series in self.hover(panel, x)[1], f"{series} does not come back")

    def colours(self, panel, rgb, keep):
        """The curves are on the page, and dark paper is dark."""
        browser = self.browser
        browser.value("scrollTo(0, 0)")
        browser.mouse("mouseMoved", 1, 1)
        papers = []
        for scheme in ("light", "dark"):
            browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
            browser.value("new Promise(done => setTimeout(done, 50))")
            papers.append(browser.value("getComputedStyle(document.body).backgroundColor"))
            png = browser.screenshot()
            if keep:
                keep.parent.mkdir(parents=True, exist_ok=True)
                keep.with_name(f"{keep.stem}-{scheme}.png").write_bytes(png)
            if scheme == "light":
                dots = count(png, rgb)
                # Those of the legend are 300.
                check(dots > 600, f"{panel}: {dots} dots in the colour of a curve")
        check(papers == ["rgb(255, 255, 255)", "rgb(21, 24, 28)"], f"paper: {papers}")
        browser.call("Emulation.setEmulatedMedia", features=[])

    def axes(self):
        """The numbers beside each axis are right, differ, and fit; of values of any size too."""
        self.browser.value("document.getElementById('all').click()")
        number = self.browser.value("panels.findIndex(it => it.panel.least === null && it.panel.size !== 'rows')")
        for factor, offset in ((1, 0), (1e-9, 0), (1.7e34, 0), (1e-3, 3e8), (1, 0)):
            self.browser.value(
                f"panels[{number}].panel.series.forEach(it => {{ it.was ??= it.y;"
                f" it.y = it.was.map(y => y === null ? y : y * {factor} + {offset}) }}); draw()")
            axes = self.browser.value(
                "panels.filter(it => it.up).map(it => [it.panel.title, it.up.ticks, it.up.texts, it.left - 7,"
                " it.up.texts.map(text => it.canvas.getContext('2d').measureText(text).width)])")
            axes.append(["time", *self.browser.value("(it => [it.ticks, it.texts])(ticksOf(0, 3e-6 * %r, 8))" % factor),
                         1, [0]])
            for title, ticks, texts, room, widths in axes:
                step = min((b - a for a, b in zip(ticks, ticks[1:])), default=1)
                for tick, text in zip(ticks, texts, strict=True):
                    check(abs(float(text.replace(MINUS, "-")) - tick) < step / 100,
                          f"{title}: the label {text} is beside {tick}")
                check(max(widths) <= room, f"{title}: the labels {texts} are wider than {room}")
            shown = self.browser.value(f"panels[{number}].up.texts")
            is_far = factor in (1e-9, 1.7e34)
            check(any("e" in text for text in shown) == is_far, f"a factor of {factor}: {shown}")

    def alone(self):
        """It has asked for nothing else, and its script has not failed."""
        for event in self.browser.events:
            params = event.get("params", {})
            if event.get("method") == "Network.requestWillBeSent":
                url = params["request"]["url"]
                check(url.startswith(("file:", "data:")), f"the page asks for {url}")
            check(event.get("method") != "Runtime.exceptionThrown",
                  f"the script fails: {params.get('exceptionDetails', {}).get('text')}")


# Capture, options of decode, panel and series in the legend, its colour.
PAGES = [
    ("motors.pcapng", [], "Velocity", "node 1", (0x00, 0x72, 0xB2)),
    ("drive.pcapng", [], "Wheel speed", "back right", (0xE0, 0x8E, 0x00)),
    ("ucp.bin", ["--protocol", "ucp"], "Angular velocity", "y", (0xE0, 0x8E, 0x00)),
]


def check_page(browser, page_path, lines, panel, series, rgb, keep=None, per_curve=4):
    """Number of values that were read back."""
    browser.open(page_path)
    expected = curves(lines)
    page = Page(browser, expected, "t" in lines[0])
    page.alone()
    chance, values = random.Random(7), 0
    for of_panel, of_series in sorted(expected):
        points = expected[of_panel, of_series]
        for at in chance.sample(range(len(points)), min(per_curve, len(points))):
            page.values(of_panel, of_series, at)
            values += 1
    page.axes()
    page.zooming(panel)
    page.hiding(panel, series)
    page.colours(panel, rgb, keep)
    page.alone()
    return values


def pages(browser, keep):
    with tempfile.TemporaryDirectory() as folder:
        for capture, more, panel, series, rgb in PAGES:
            path = pathlib.Path(folder, f"{capture}.html")
            run("plot", CAPTURES / capture, "-o", path)
            lines = listing(CAPTURES / capture, more)
            shot = keep / f"{capture}.png" if keep else None
            values = check_page(browser, path, lines, panel, series, rgb, shot)
            print(f"{capture}: {values} values are those of axle decode --json; zoom, legend and colours")


# Text of the page, its replacement, what is then found. A digit of the data is changed besides.
FAULTS = [
    ('tip.hidden = false;', 'tip.hidden = true;', "no values beside the mouse"),
    ('String(one.y[at])', 'String(one.y[at] + 1e-6)', "is told, not"),
    ('place.toFixed(6)', '(place + 2e-6).toFixed(6)', "is told, not"),
    ('heldAt(one, place)', 'heldAt(one, 0)', "no speed in"),
    ('"unit":"1/min"', '"unit":"1/s"', "the unit"),
    ('"title":"Heading"', '"title":"Course"', "panels"),
    ('zoom(1.0015 ** event.deltaY, at(event))', 'zoom(1)', "the wheel does not zoom"),
    ('zoom(1.0015 ** event.deltaY, at(event))', 'zoom(1.0015 ** event.deltaY)', "the place at the mouse moves"),
    ('show(dragged.from - by, dragged.to - by)', 'show(dragged.from, dragged.to)', "a drag does not move"),
    ('"+": () => zoom(.5)', '"+": () => zoom(1)', "the key + does not zoom"),
    ('addEventListener("dblclick", () => show(0, end))', 'addEventListener("dblclick", () => {})', "a double click"),
    ('hidden.delete(other) : hidden.add(other)', 'hidden.delete(other) : hidden.delete(other)', "is not hidden"),
    ('  pen.stroke();\n  pen.globalAlpha = 1;\n}', '  pen.globalAlpha = 1;\n}', "in the colour of a curve"),
    ('--paper: #15181c', '--paper: #ffffff', "paper"),
    ('Math.max(0, -least)', 'Math.max(0, -least - 1)', "is beside"),
    ('powerOf(Math.abs(tick)) - least)', '0)', "is beside"),
    ('Math.max(left[of], Math.ceil(width))', 'left[of]', "are wider than"),
    ('<footer>', '<img src="http://127.0.0.1:9/x.png"><footer>', "the page asks for"),
    ('fromAddress();\n', 'fromAddress();\nnothing();\n', "the script fails"),
    ('history.replaceState', 'void', "in the address is"),
]


def planted(browser):
    capture, more, panel, series, rgb = PAGES[1]
    lines = listing(CAPTURES / capture, more)
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "page.html")
        run("plot", CAPTURES / capture, "-o", path)
        good = path.read_text()
        check_page(browser, path, lines, panel, series, rgb, per_curve=1)
        for text, replacement, expected in FAULTS:
            begin = good.rindex(text)
            path.write_text(good[:begin] + replacement + good[begin + len(text):])
            try:
                check_page(browser, path, lines, panel, series, rgb, per_curve=2)
            except Wrong as wrong:
                if expected not in str(wrong):
                    sys.exit(f"plot_browser.py: {replacement!r}: found is {wrong}, not {expected!r}")
            else:
                sys.exit(f"plot_browser.py: not found: {replacement!r} instead of {text!r}")
    print(f"{len(FAULTS)} planted faults, {len(FAULTS)} found")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--planted", action="store_true")
    parser.add_argument("--keep", type=pathlib.Path)
    options = parser.parse_args()
    subprocess.run(["cargo", "build", "--quiet", "-p", "axle", "--features", "plot"], cwd=ROOT, check=True)
    browser = Browser()
    try:
        planted(browser) if options.planted else pages(browser, options.keep)
    except Wrong as wrong:
        sys.exit(f"plot_browser.py: {wrong}")
    finally:
        browser.close()


if __name__ == "__main__":
    main()
