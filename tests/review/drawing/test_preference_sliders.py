"""Sliders of a front's objectives: grey while dragged, certified once released; grey points have no id."""

from __future__ import annotations

import os
import shutil
from importlib.util import find_spec

import numpy as np
import pytest

import paretoik as pk
from paretoik.front.front import Front
from tests.review.drawing.test_front_view import PANEL, present, select, sent

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = pytest.mark.skipif(find_spec("rerun_notebook") is None, reason="the extra notebook is not installed")
PICTURES = (f"{PANEL}/predicted", "/choice/arm/predicted/ghosts", "/choice/arm/predicted/path")


@pytest.fixture(autouse=True, scope="module")
def address():
    """Set the address of the viewer: nobody requests it, and starting its server takes seconds."""
    os.environ.setdefault("RERUN_NOTEBOOK_ASSET", "http://127.0.0.1:9/widget.js")


@pytest.fixture(scope="module")
def front() -> Front:
    path = pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=11)
    limits = pk.Limits(position=np.deg2rad([90, 120, 120]), velocity=3.8)
    problem = pk.Tracking(
        pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy, pk.torque_norm], limits=limits, bases=2
    )
    return pk.epsilon_front(problem, points=5, starts=4, observe=False)


@pytest.fixture
def view(front):
    view = front.view()
    view.show(int(front.ids[2]))
    return view


def say(view, kind: str, share: float, axis: int = 0, hold: tuple[int, ...] = ()) -> float:
    """Send the widget a slider's message at a ``share`` of the way to the best; return the value."""
    slider = view.sliders.state["objectives"][axis]
    to = slider["value"] + share * (slider["best"] - slider["value"])
    message = {"kind": kind, "axis": axis, "to": to, "hold": list(hold), "number": view.sliders.state["answered"] + 1}
    view.sliders._handle_custom_msg(message, [])
    return to


def drawn(view, folder) -> list[int]:
    """Return the present number of marks in each picture of a prediction."""
    entities = sent(view, folder)
    kinds = ("positions", "strips", "strips")
    return [len(present(entities[path], kind)) for path, kind in zip(PICTURES, kinds, strict=True)]


def test_what_is_dragged_is_predicted_in_grey_and_gone_once_a_certified_point_is_there(view, front, tmp_path):
    ids = front.ids.tolist()
    to = say(view, "drag", 0.1)
    state = view.sliders.state
    assert state["kind"] == "predicted"
    assert state["objectives"][0]["predicted"] == pytest.approx(to, rel=1e-6)
    point, postures, path = drawn(view, tmp_path)
    assert (point, path) == (1, 0)  # its tool follows the path that is already drawn
    assert postures > 1
    assert view.front.ids.tolist() == ids
    predicted = state["objectives"][1]["predicted"]
    say(view, "release", 0.1)
    assert drawn(view, tmp_path) == [0, 0, 0]
    assert view.sliders.state["kind"] == "certified"
    assert view.choice.id not in ids
    assert view.choice.objectives == pytest.approx([to, predicted], rel=1e-4)
    assert view.front.certificates.criticality[view.choice.index] <= 1e-6
    assert view.selected.tolist() == [view.choice.id]
    shown = sent(view, tmp_path)[f"{PANEL}/front"]
    assert present(shown, "labels") == [f"point {number}" for number in view.front.ids]


def test_a_click_on_what_is_predicted_selects_nothing(view, tmp_path):
    say(view, "drag", 0.1)
    number = view.choice.id
    for path in PICTURES:
        select(view, (path, 0))
        assert view.selected.tolist() == []
        assert view.choice.id == number


def test_a_slider_that_is_back_leaves_nothing_grey(view, tmp_path):
    say(view, "drag", 0.1)
    say(view, "cancel", 0.0)
    assert drawn(view, tmp_path) == [0, 0, 0]
    assert view.sliders.state["objectives"][0]["predicted"] is None


def test_a_refused_move_is_explained_and_leaves_nothing_grey(view, tmp_path):
    number = view.choice.id
    for kind in ("drag", "release"):
        say(view, "drag", 0.1)
        say(view, kind, 0.1, hold=(1,))
        assert view.sliders.state["kind"] == "refused"
        assert "not in hold" in view.sliders.state["words"]
        assert drawn(view, tmp_path) == [0, 0, 0]
    assert view.choice.id == number


def test_a_front_that_cannot_be_moved_along_says_what_is_missing(make_front):
    view = make_front(2).view()
    assert not view.sliders.state["movable"]
    assert "certified front" in view.sliders.state["words"]


PAGE = """
<!doctype html><meta charset="utf-8"><style>STYLE</style><div id="here"></div><script type="module">
const listeners = [];
window.sent = [];
window.state = STATE;
window.receive = (state) => { window.state = state; listeners.forEach((each) => each()); };
const model = {
  get: () => window.state,
  send: (message) => window.sent.push(message),
  on: (_, listener) => listeners.push(listener),
  off: () => {},
};
const widget = await import(URL.createObjectURL(new Blob([SOURCE], { type: "text/javascript" })));
widget.default.render({ model, el: document.getElementById("here") });
window.ready = true;
</script>
"""


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None or DRIVER is None, reason="no chromium with its driver")
def test_in_a_real_browser_dragging_predicts_and_release_moves(view, front, tmp_path):
    """Run the widget's own script; the test carries its messages to and from the widget in Python."""
    import json

    webdriver = pytest.importorskip("selenium.webdriver")
    from selenium.webdriver.common.action_chains import ActionChains

    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'browser'}"):
        options.add_argument(flag)
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(str(DRIVER)))
    try:
        parts = {"STYLE": str(view.sliders._css), "STATE": json.dumps(view.sliders.state)}
        page = PAGE.replace("SOURCE", json.dumps(str(view.sliders._esm)))
        for name, text in parts.items():
            page = page.replace(name, text, 1)
        (tmp_path / "page.html").write_text(page)
        driver.get(f"file://{tmp_path / 'page.html'}")

        def run(script: str):
            return driver.execute_script(script)

        def carry() -> list[str]:
            """Carry messages until there are none; return their kinds."""
            kinds = []
            while messages := run("return window.sent.splice(0)"):
                for message in messages:
                    kinds.append(message["kind"])
                    view.sliders._handle_custom_msg(message, [])
                    run(f"window.receive({json.dumps(view.sliders.state)})")
            return kinds

        assert run("return window.ready")
        sliders = run('return [...document.querySelectorAll("input[type=range]")]')
        assert len(sliders) == 2
        assert [float(each.get_property("value")) for each in sliders] == pytest.approx(
            [
                (item["value"] - item["worst"]) / (item["best"] - item["worst"])
                for item in view.sliders.state["objectives"]
            ],
            abs=1e-3,
        )
        box, at = sliders[0].rect, float(sliders[0].get_property("value"))
        thumb = int((at - 0.5) * (box["width"] - 16))
        number = view.choice.id
        actions = ActionChains(driver, duration=50).move_to_element_with_offset(sliders[0], thumb, 0).click_and_hold()
        actions.move_by_offset(8, 0).move_by_offset(8, 0).perform()
        kinds = carry()
        assert kinds
        assert set(kinds) == {"drag"}
        assert len(kinds) <= 2  # one at a time, then the newest
        assert run('return document.getElementById("here").dataset.kind') == "predicted"
        assert "→" in run('return document.querySelectorAll("output")[1].textContent')
        assert drawn(view, tmp_path)[0] == 1
        driver.save_screenshot(str(tmp_path / "dragged.png"))
        ActionChains(driver).release().perform()
        assert run('return document.querySelector("p").textContent').startswith("moving")
        assert sliders[0].get_property("disabled")
        assert carry()[-1] == "release"
        assert drawn(view, tmp_path) == [0, 0, 0]
        assert view.choice.id != number
        assert view.choice.id not in front.ids
        assert run('return document.querySelector("p").textContent') == view.sliders.state["words"]
        assert not sliders[0].get_property("disabled")
        assert run('return document.querySelector("output.predicted")') is None
        driver.save_screenshot(str(tmp_path / "released.png"))
        ActionChains(driver).click_and_hold(sliders[0]).move_by_offset(-int(box["width"] / 2), 0).release().perform()
        assert carry()[-1] == "cancel"  # nothing is moved towards the worse
    finally:
        driver.quit()
