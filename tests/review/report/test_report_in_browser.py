"""A report in a real browser: hovering, clicking, filtering, playing, copying and printing."""

from __future__ import annotations

import json
import shutil
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import paretoik as pk
from paretoik.front.front import Front
from paretoik.review.report import Report
from tests.review.pictures.test_certificates import certified

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None or DRIVER is None, reason="no chromium with its driver"),
]
FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --window-size=1280,1400"
)

CURVES = "return document.getElementById('curves').data.map((each) => Array.from(each.y))"
SHOWN = """
const lines = [...document.querySelectorAll("#points tbody tr")];
return lines.filter((line) => !line.hidden).map((line) => +line.dataset.id);
"""
CLIPBOARD = """
const done = arguments[arguments.length - 1];
navigator.clipboard.readText().then(done, (error) => done(String(error)));
"""
NODES = """
const nodes = [...document.querySelectorAll("#arm circle")];
return nodes.map((node) => ["cx", "cy"].map((name) => +node.getAttribute(name)));
"""


@dataclass
class Browser:
    """A browser with an open page."""

    driver: Any

    def __call__(self, script: str, *arguments: object) -> Any:
        return self.driver.execute_script(script, *arguments)

    def text(self, name: str) -> str:
        return self("return document.getElementById(arguments[0]).textContent", name)

    def wait(self, script: str) -> None:
        end = time.monotonic() + 60
        while not self(f"return {script}"):
            assert time.monotonic() < end, script
            time.sleep(0.05)

    def spot(self, figure: str, x: float, y: float) -> tuple[int, int]:
        """Return the position on the screen of a point of the first pair of axes."""
        script = """
          const figure = document.getElementById(arguments[0]);
          figure.scrollIntoView({ block: "center" });
          const layout = figure._fullLayout, box = figure.getBoundingClientRect();
          const [axis, other] = ["xaxis", "yaxis"].map((kind) =>
            layout[Object.keys(layout).filter((key) => key.startsWith(kind)).sort()[0]]);
          return [box.left + axis._offset + axis.d2p(arguments[1]), box.top + other._offset + other.d2p(arguments[2])];
        """
        left, top = self(script, figure, x, y)
        return round(left), round(top)

    def move(self, spot: tuple[int, int], *, click: bool = False) -> None:
        from selenium.webdriver.common.action_chains import ActionChains

        actions = ActionChains(self.driver)
        actions.w3c_actions.pointer_action.move_to_location(spot[0] - 3, spot[1])
        actions.w3c_actions.pointer_action.move_to_location(*spot)
        if click:
            actions.w3c_actions.pointer_action.click()
        actions.perform()

    def requests(self) -> set[str]:
        """Return the addresses that the page has requested since the last call."""
        messages = [json.loads(entry["message"])["message"] for entry in self.driver.get_log("performance")]
        sent = [each["params"] for each in messages if each["method"] == "Network.requestWillBeSent"]
        return {each["request"]["url"] for each in sent if each["documentURL"].startswith("file:")}


@pytest.fixture(scope="module")
def driver(tmp_path_factory):
    selenium = pytest.importorskip("selenium.webdriver")
    options = selenium.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    for flag in (*FLAGS.split(), f"--user-data-dir={tmp_path_factory.mktemp('browser')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = selenium.Chrome(options=options, service=selenium.ChromeService(str(DRIVER)))
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def front():
    path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=25)
    problem = pk.Tracking(
        pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy, pk.torque_norm], limits=pk.Limits(velocity=4.0),
        obstacles=[pk.obstacles.Circle([0.3, 0.3], 0.05)], bases=2,
    )  # fmt: skip
    motions = problem.decode(problem.sample_starts(9, np.random.default_rng(0)))
    values = np.array([np.linspace(1.0, 2.0, 9), 3.0 - np.linspace(0.0, 1.0, 9) ** 0.5]).T
    front = Front(
        ids=np.arange(9) * 7, objectives=values, names=problem.names, units=problem.units,
        maximised=[False, False], motions=motions, problem=problem,
    )  # fmt: skip
    return certified(front, ["minimum", "saddle"])


@pytest.fixture
def opened(driver, tmp_path):
    def open_report(shown: Front | Report) -> Browser:
        driver.get_log("performance")  # of earlier pages
        file = tmp_path / "report.html"
        if isinstance(shown, Report):
            shown.write(file)
        else:
            pk.report(shown, file)
        driver.get(f"file://{file}")
        browser = Browser(driver)
        browser.wait("document.body.dataset.ready || !document.getElementById('fault').hidden")
        assert browser.text("fault") == ""
        return browser

    yield open_report
    assert [entry["message"] for entry in driver.get_log("browser") if entry["level"] == "SEVERE"] == []


def test_hovering_shows_the_id_and_the_values(opened, front):
    browser = opened(front)
    browser.move(browser.spot("front", *front.objectives[3]))
    browser.wait("document.querySelector('#front .hoverlayer').textContent")
    shown = browser("return document.querySelector('#front .hoverlayer').textContent")
    assert f"point {front.ids[3]}" in shown
    assert f"{front.objectives[3, 0]:.4g} J s" in shown


def test_clicking_shows_the_motion_of_that_point(opened, front):
    browser = opened(front)
    browser.move(browser.spot("front", *front.objectives[5]), click=True)
    browser.wait(f"document.getElementById('point-id').textContent === '{front.ids[5]}'")
    browser.wait(f"Math.abs(document.getElementById('curves').data[0].y[7] - {front.motions.q[5, 7, 0]}) < 1e-4")
    drawn = [curve for curve in browser(CURVES) if len(curve) == 25]
    motion = front.motions[5]
    curves = [curve for values in (motion.q, motion.dq, motion.ddq, motion.torque, motion.power) for curve in values.T]
    np.testing.assert_allclose(drawn, curves, atol=1e-4 * np.abs(curves).max())
    limits = [curve[0] for curve in browser(CURVES) if len(curve) == 2]
    assert sorted(set(limits)) == [-4.0, 4.0]


def test_a_point_without_certificate_says_so_and_the_others_show_their_rates(opened, front):
    browser = opened(front)
    for row, number in enumerate(front.ids):
        browser(f"document.querySelector('#points tr[data-id=\"{number}\"] td:nth-child(2)').click()")
        assert browser.text("point-id") == str(number)
        words = browser.text("rates")
        if row % 3 == 0:
            assert words == "Not certified at this point."
        else:
            assert words.count("0.5") == 2


def test_filtering_hides_points_in_picture_and_table(opened, front):
    browser = opened(front)
    inputs = browser("return [...document.querySelectorAll('#filters input')]")
    inputs[1].send_keys("1.6")
    kept = front.ids[front.objectives[:, 0] <= 1.6].tolist()
    browser.wait(f"document.getElementById('count').textContent.startsWith('{len(kept)} of')")
    assert browser(SHOWN) == kept
    assert browser(
        "return document.getElementById('front').data.find((each) => each.name === 'front').x.length"
    ) == len(kept)
    browser("document.getElementById('show-all').click()")
    assert browser.text("count").startswith("9 of 9")


def test_an_id_copies_on_click(opened, front):
    browser = opened(front)
    browser.driver.execute_cdp_cmd(
        "Browser.grantPermissions", {"permissions": ["clipboardReadWrite", "clipboardSanitizedWrite"]}
    )
    button = browser(f"return document.querySelector('button[data-copy=\"{front.ids[4]}\"]')")
    button.click()
    browser.wait("document.querySelector('button.copied')")
    assert browser.driver.execute_async_script(CLIPBOARD) == str(front.ids[4])


def test_the_arm_moves_along_its_motion(opened, front):
    browser = opened(front)
    first = np.array(browser(NODES))
    browser("const time = document.getElementById('time'); time.value = 20; time.dispatchEvent(new Event('input'))")
    moved = np.array(browser(NODES))
    row = int(np.flatnonzero(front.ids == int(browser.text("point-id")))[0])
    nodes = front.motions[row].links[[0, 20], :, :2]
    scale = np.linalg.norm(first[-1] - first[0]) / np.linalg.norm(nodes[0, -1] - nodes[0, 0])
    for drawn, true in zip((first, moved), nodes, strict=True):
        np.testing.assert_allclose(drawn - first[0], scale * (true - nodes[0, 0]) * [1, -1], atol=0.2)
    browser("document.getElementById('play').click()")
    browser.wait(
        "document.getElementById('time').value === '24' && document.getElementById('play').textContent === 'play'"
    )


def test_a_page_requests_nothing_and_scripts_in_names_do_not_run(opened, front):
    names = ["<img src=x onerror=document.title='run'>", "</script><script>document.title='run'</script>"]
    hostile = Front(
        ids=front.ids, objectives=front.objectives, names=names,
        units=["<b>", "'\""], maximised=[False, False],
    )  # fmt: skip
    browser = opened(hostile)
    browser.move(browser.spot("front", *hostile.objectives[3]))
    browser.wait("document.querySelector('#front .hoverlayer').textContent")
    assert "<img src=x" in browser("return document.querySelector('#front .hoverlayer').textContent")
    assert browser.driver.title.startswith("The front of <img")
    assert browser("return document.images.length") == 0
    asked = {address for address in browser.requests() if not address.startswith(("data:", "blob:"))}
    assert asked == {browser.driver.current_url}


def test_a_page_without_a_feasible_motion_shows_the_nearest_as_no_point_of_a_front(opened, front):
    nearest = Report(front=front[[14]], title="No feasible motion", notes=["Too fast."], nearest=True)
    browser = opened(nearest)
    shown = browser("return document.body.innerText")
    assert "The least-violating motion least-violating, not feasible" in " ".join(shown.split())
    assert not any(words in shown for words in ("from the best", "copy id", "Point 14", "Points"))
    browser.wait("document.getElementById('curves').data.length > 0")
