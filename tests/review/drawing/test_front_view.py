"""The viewer in a notebook: Python knows the selected points, and their motions are shown."""

from __future__ import annotations

import json
import os
import re
import sys
import urllib.request
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from paretoik.errors import Infeasible, InvalidInput
from paretoik.robot.kinematics import link_nodes
from paretoik.task.motion import Motion
from tests.review.reading import read, rows

needs_notebook = pytest.mark.skipif(find_spec("rerun_notebook") is None, reason="the extra notebook is not installed")
PANEL = "/choice/front/kinetic_energy\\ -\\ torque_norm"


@pytest.fixture(autouse=True, scope="module")
def address():
    """Set the address of the viewer: nobody requests it, and starting its server takes seconds."""
    os.environ.setdefault("RERUN_NOTEBOOK_ASSET", "http://127.0.0.1:9/widget.js")


def select(view, *items: tuple[str, int | None]) -> None:
    """Send the widget the message of a browser in which entities were selected."""
    entities = [{"type": "entity", "entity_path": path, "instance_id": number} for path, number in items]
    view.viewer._viewer._handle_custom_msg(selection(entities), [])


def selection(items: list[dict]) -> str:
    return json.dumps({"type": "selection_change", "application_id": "a", "recording_id": "r", "items": items})


def sent(view, folder: Path) -> dict[str, list]:
    """Return the record batches of each entity sent to the browser."""
    batches = dict[str, list]()
    for event, buffers in view.viewer._viewer._event_queue:
        if event["type"] != "rrd":
            continue
        part = folder / "part.rrd"
        part.write_bytes(buffers[0])
        try:
            entities = read(part)
        except ValueError:  # a layout, or only the recording's name
            continue
        for path, of_entity in entities.items():
            batches.setdefault(path, []).extend(of_entity)
    return batches


def present(batches: list, component: str) -> list:
    """Return what a static entity shows at present: the last values sent."""
    found = [
        (batch.column("rerun.controls.RowId").to_pylist()[-1], batch.column(name).to_pylist()[-1])
        for batch in batches
        for name in batch.schema.names
        if name.split(":")[-1] == component
    ]
    return max(found)[1]


@needs_notebook
def test_a_point_that_is_picked_is_known_by_its_id_and_its_motion_is_shown(make_front, tmp_path):
    front, heard = make_front(2), list[list[int]]()
    view = front.view(on_select=lambda ids: heard.append(ids.tolist()))
    assert view.selected.tolist() == []
    for instance in (0, 5, len(front) - 1):
        select(view, (f"{PANEL}/front", instance))
        number = int(front.ids[instance])
        assert view.selected.tolist() == heard[-1] == [number]
        assert view.choice.id == number
        entities = sent(view, tmp_path)
        assert present(entities["/choice/search/choice"], "ids") == [number]
        assert present(entities["/choice/text"], "text")[0].startswith(f"# Point {number}, ")
        drawn = rows(entities["/choice/joint_charts/position/curves"], "motion", "strips")[0]
        assert len(drawn) == front.motions.arm.dof
    assert f"shows {front.ids[-1]}, selected [{front.ids[-1]}]" in repr(view)


@needs_notebook
def test_every_picture_of_a_point_selects_it_and_frames_select_nothing(make_front):
    front = make_front(3, points=30)
    view = front.view()
    select(view, (f"{PANEL}/front", 7))
    assert view.selected.tolist() == [front.ids[7]]
    last = view.choice.id
    for path in (f"{PANEL}/choice", "/choice/arm/chosen/links", "/choice_arm_meshes/link"):
        select(view, (f"{PANEL}/grid", 2))
        assert view.selected.tolist() == []
        select(view, (path, 0))
        assert view.selected.tolist() == [last]
    select(view, (f"{PANEL}/front", 4), (f"{PANEL}/front", 1), (f"{PANEL}/front", 4))
    assert view.selected.tolist() == front.ids[[4, 1]].tolist()
    select(view, (f"{PANEL}/front", None))
    assert view.selected.tolist() == front.ids.tolist()
    view.viewer._viewer._handle_custom_msg(selection([{"type": "view", "view_id": "1", "view_name": "front"}]), [])
    assert view.selected.tolist() == []


@needs_notebook
def test_nothing_is_left_of_a_motion_that_took_longer(make_front, tmp_path):
    front = make_front(2, points=3, planar=False)
    times = np.array([1.0, 1.7, 0.6])[:, None] * front.motions.time
    front = replace(front, motions=Motion(arm=front.motions.arm, time=times, q=front.motions.q))
    view = front.view()
    for number in front.ids[[1, 2, 0]].tolist():
        view.show(number)
        motion = view.choice.motion
        time = np.round(np.asarray(motion.time) * 1e9).astype(int)
        drawn = rows(sent(view, tmp_path)["/choice/arm/chosen/joints"], "motion", "positions")
        at = np.array(sorted(drawn))
        assert set(time) <= set(drawn)
        q = np.stack([np.interp(at, time, each) for each in motion.q.T], axis=1)  # joints move evenly in between
        links = np.asarray(link_nodes(motion.arm, q))
        np.testing.assert_allclose(np.array([drawn[each] for each in at]), links, rtol=1e-5, atol=1e-6)
    assert max(drawn) == round(1.7e9)


@needs_notebook
def test_what_cannot_be_shown_is_refused_in_one_line(make_front):
    front = make_front(2)
    with pytest.raises(InvalidInput, match="width"):
        front.view(width=0)
    with pytest.raises(Infeasible, match="the front must have at least one point"):
        make_front(2, points=0).view()
    view = front.view()
    with pytest.raises(InvalidInput, match="id"):
        view.show(12345)
    assert view.choice.id in front.ids


def test_a_missing_extra_is_named_with_its_install_command(make_front, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun_notebook", None)  # as if it were not installed
    with pytest.raises(InvalidInput, match=re.escape('must be installed: pip install "paretoik[notebook]"')):
        make_front(2).view()


CELL = """
import urllib.request
import paretoik as pk
path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=21)
problem = pk.Tracking(pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy, pk.torque_norm])
front = pk.solve(problem, population=12, generations=4, seed=1, observe=False)
view = front.view()
view
"""


@needs_notebook
@pytest.mark.slow
def test_in_a_real_kernel_a_browsers_message_selects_and_the_viewer_is_served_to_this_machine(monkeypatch):
    from jupyter_client.manager import start_new_kernel

    monkeypatch.delenv("RERUN_NOTEBOOK_ASSET", raising=False)
    manager, client = start_new_kernel(kernel_name="python3")
    try:
        widgets = dict[str, dict]()

        def hear(message: dict) -> None:
            content = message["content"]
            if message["msg_type"] == "comm_open":
                widgets[content["comm_id"]] = content["data"]["state"]

        def run(code: str) -> str:
            outputs = list[str]()

            def listen(message: dict) -> None:
                hear(message)
                outputs.append(str(message["content"].get("text", "")) + str(message["content"].get("evalue", "")))

            reply = client.execute_interactive(code, output_hook=listen, timeout=300)
            assert reply["content"]["status"] == "ok", outputs
            return "".join(outputs)

        run(CELL)
        (viewer,) = [number for number, state in widgets.items() if str(state.get("_esm")).startswith("http")]
        source = widgets[viewer]["_esm"]
        assert source.startswith("http://localhost:")
        with urllib.request.urlopen(source, timeout=20) as page:
            assert b"export" in page.read()
        items = [{"type": "entity", "entity_path": f"{PANEL}/front", "instance_id": 1}]
        data = {"method": "custom", "content": selection(items)}
        client.shell_channel.send(client.session.msg("comm_msg", {"comm_id": viewer, "data": data}))
        assert (
            run("print(view.selected.tolist() == [int(front.ids[1])], view.choice.id == front.ids[1])") == "True True\n"
        )
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)
