"""What a client of the scene, or of the page, can do to them, and what it cannot."""

from __future__ import annotations

import json
import math
import time
from typing import get_args

import msgspec
import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed")

from demo.guarded_server import FLOOD, MAX_MESSAGE, MESSAGES, PRESSES, PageParts, open_guarded_server
from demo.page_gate import PageGate
from demo.session_config import DRIVERS, MOST_OBJECTS
from demo.tab_messages import MAX_TEXT, Change, Nudge, Preview, Say, SetDriver, SetFlag, SetSpeed, SetViewpoint
from language import VIEWPOINTS
from tools.browser import free_port
from tools.page_client import CAMERA, PageClient, SceneClient

NAN, INFINITY = math.nan, math.inf


class Served:
    """A server with a scene and a page. messages: those of tabs that were taken."""

    def __init__(self):
        port = int(free_port())
        self.gate, self.parts = PageGate("127.0.0.1", port), PageParts()
        self.server = open_guarded_server("127.0.0.1", port, self.gate, self.parts)
        self.handles = self.server.scene.add_transform_controls("/finger", position=(0.1, 0.2, 0.3))
        self.messages = []
        self.parts.state.handle = lambda tab, message: self.messages.append(message)

    def state(self):
        """All that a client of the scene can change."""
        return np.round([*self.handles.position, *self.handles.wxyz], 9).tolist()


@pytest.fixture(scope="module")
def served():
    served = Served()
    yield served
    served.server.stop()


@pytest.fixture
def client(served):
    with SceneClient(served.gate.address) as client:
        yield client


@pytest.fixture
def tab(served):
    served.messages.clear()
    with PageClient(served.gate.address) as tab:
        yield tab


def wait_for(condition):
    end = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def settle(client, served):
    """Wait until all that was sent to the scene has been served: handles that are moved last are there."""
    before, mark = served.handles.position, (0.0, 0.0, round(time.monotonic() % 10, 3))
    client.send(handles(position=mark))
    wait_for(lambda: np.allclose(served.handles.position, mark))
    served.handles.position = before
    client.listen(0.02)


def settle_tab(tab, served):
    """Wait until all that was sent to the page has been served."""
    tab.send("preview", text="mark")
    wait_for(lambda: Preview("mark") in served.messages)
    served.messages.remove(Preview("mark"))


def camera(**changed):
    return CAMERA | changed


def handles(**changed):
    message = {"type": "TransformControlsUpdateMessage", "name": "/finger", "owner": ""}
    return message | {"wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0.0, 0.0, 0.0]} | changed


BAD_MESSAGES = [
    b"",
    b"\xc1",
    b"\xdf\xff\xff\xff\xff",
    b"\x91" * 100_000,
    b"\x81" * 100_000,
    b"\xdb\xff\xff\xff\xffx",
    b"\x81\xa4type\xa1\xff",
    b"x" * MAX_MESSAGE,
    "text",
    "",
    None,
    1,
    [],
    {},
    {"type": None},
    {"type": "Message"},
    {"type": "ViewerCameraMessage"},
    {"type": "RunJavascriptMessage", "source": "alert(1)"},
    {"type": "ResetGuiMessage"},
    {"type": "GuiRemoveMessage", "uuid": "root"},
    {"type": "RemoveSceneNodeMessage", "name": "/finger"},
    {"type": "SetPositionMessage", "name": "/finger", "position": [1, 2, 3]},
    {"type": "ShareUrlRequest"},
    {"type": "ShareUrlDisconnect"},
    {"type": "GetRenderResponseMessage", "payload": b"x", "render_uuid": "x"},
    {"type": "LocalStorageGetItemResponseMessage", "value": "x", "error": None, "request_uuid": "x"},
    {"type": "FileTransferStartUpload", "source_component_uuid": "x", "transfer_uuid": "x", "filename": "x"},
    {"type": "FileTransferPart", "source_component_uuid": "x", "transfer_uuid": "x", "part_index": 0, "content": b""},
    {"type": "GuiButtonHoldMessage", "uuid": "x", "frequency": NAN},
    {"type": "GuiFormDirtyMessage", "uuid": "made up"},
    {"type": "GuiFormSubmitMessage", "uuid": "made up"},
    {"type": "GuiFormSubmitMessage", "uuid": 1},
    {"type": "GuiUpdateMessage", "uuid": "x"},
    {"type": "GuiUpdateMessage", "uuid": [], "updates": {"value": 1}},
    {"type": "GuiUpdateMessage", "uuid": "x", "updates": [1]},
    {"type": "CommandTriggerMessage", "uuid": None},
    {"type": "ScenePointerMessage", "event_type": "click"},
    {"type": "SceneNodeClickMessage", "name": "/finger", "ray_origin": [0, 0, NAN]},
    camera(position=[NAN, 0, 0]),
    camera(position=[1e300, 0, 0]),
    camera(position=[0, 0]),
    camera(position="abc"),
    camera(wxyz=[INFINITY, 0, 0, 0]),
    camera(fov=NAN),
    camera(fov=-1.0),
    camera(image_height=-1),
    camera(image_width=10**9),
    camera(more=1),
    handles(position=[NAN, 0, 0]),
    handles(position=[0, 0, INFINITY]),
    handles(position=[1e6, 0, 0]),
    handles(wxyz=[0, 0, 0, 0]),
    handles(owner="x"),
    handles(name=None),
]


def test_messages_that_a_scene_never_sends_change_nothing_and_are_counted(served, client):
    before, dropped = served.state(), served.parts.check.dropped
    assert len(BAD_MESSAGES) > 50
    for message in BAD_MESSAGES:
        client.send(message)
    settle(client, served)
    assert client.closed is None
    assert served.state() == before
    assert served.parts.check.dropped == dropped + len(BAD_MESSAGES)


def test_of_two_values_in_one_message_the_one_that_was_checked_is_set(served, client):
    def packed(value):
        return msgspec.msgpack.encode(value)

    good, bad = packed([0.3, 0.3, 0.3]), packed([NAN, 0.0, 0.0])
    rest = {"type": "TransformControlsUpdateMessage", "name": "/finger", "wxyz": [1.0, 0.0, 0.0, 0.0]}
    for first, second in ((good, bad), (bad, good)):
        fields = b"".join(packed(name) + packed(value) for name, value in rest.items())
        client.send(b"\x85" + fields + packed("position") + first + packed("position") + second)
    settle(client, served)
    assert np.isfinite(served.handles.position).all()


def test_handles_follow_a_client(served, client):
    client.send(handles(position=[0.4, 0.5, 0.6]))
    wait_for(lambda: np.allclose(served.handles.position, [0.4, 0.5, 0.6]))


GOOD_TAB_MESSAGES = [
    ({"do": "say", "text": "x" * MAX_TEXT}, Say("x" * MAX_TEXT)),
    ({"do": "nudge", "to": "left"}, Nudge("left")),
    ({"do": "speed", "value": 0.1}, SetSpeed(0.1)),
    ({"do": "flag", "name": "paused", "value": True}, SetFlag("paused", True)),
    ({"do": "change", "robot": "panda", "control": "step", "task": "nl_reach"}, Change("panda", "step", "nl_reach")),
]
BAD_TAB_MESSAGES = [
    *(
        {"do": "speed", "value": value}
        for value in (NAN, INFINITY, 0, -1, 0.0999, 1.0001, 1e308, True, "0.5", None, [])
    ),
    *({"do": "say", "text": value} for value in (1, True, None, [], {}, ["a"], "x" * (MAX_TEXT + 1))),
    *({"do": "flag", "name": "paused", "value": value} for value in (0, 1, NAN, "", "true", None, [])),
    *({"do": "flag", "name": name, "value": True} for name in ("", "Paused", "__class__", None, 1)),
    *({"do": "click", "button": button} for button in ("", "Stop", "quit", True, None, ["stop"])),
    *({"do": "hand", "place": place} for place in ([NAN, 0, 0], [0, 0], [0, 0, 21], "abc", None)),
    *({"do": "hover", "at": at} for at in ([0.5], [2, 0], [NAN, 0], "x")),
    *({"do": "driver", "value": value} for value in ("", "Policy", "me", None)),
    {"do": "change", "robot": "x" * 101, "control": "step", "task": "nl_reach"},
    {"do": "change", "robot": "kuka", "control": "step", "task": "nl_reach", "objects": 7},
    {"do": "change", "robot": "kuka"},
    {"do": "say", "text": "x", "more": 1},
    {"do": "__init__"},
    {"do": None},
    {"text": "x"},
    {},
    [],
    1,
]


def test_what_a_tab_can_ask_for_is_taken(served, tab):
    for message, _ in GOOD_TAB_MESSAGES:
        tab.send_raw(json.dumps(message))
    settle_tab(tab, served)
    assert served.messages == [taken for _, taken in GOOD_TAB_MESSAGES]


def test_what_no_tab_asks_for_is_dropped_and_counted(served, tab):
    dropped = served.parts.state.check.dropped
    raw = [b"", b"\xff", b"{", b"[" * 100_000, b"x" * MAX_MESSAGE, *map(json.dumps, BAD_TAB_MESSAGES)]
    for message in raw:
        tab.send_raw(message)
    settle_tab(tab, served)
    assert served.messages == []
    assert served.parts.state.check.dropped == dropped + len(raw)
    assert tab.closed is None


def test_messages_know_the_drivers_viewpoints_and_objects_of_the_project():
    assert get_args(msgspec.structs.fields(SetDriver)[0].type) == DRIVERS
    assert set(get_args(msgspec.structs.fields(SetViewpoint)[0].type)) == set(VIEWPOINTS)
    check = msgspec.json.Decoder(Change).decode
    change = {"do": "change", "robot": "x", "control": "x", "task": "x"}
    assert check(json.dumps(change | {"objects": MOST_OBJECTS})).objects == MOST_OBJECTS
    with pytest.raises(msgspec.ValidationError):
        check(json.dumps(change | {"objects": MOST_OBJECTS + 1}))


def test_all_tabs_see_a_section_that_changes_and_a_new_one_sees_all(served):
    state = served.parts.state
    state.put("a", 1)
    with PageClient(served.gate.address) as first, PageClient(served.gate.address) as second:
        state.put("b", {"x": [1, 2]})
        for tab in (first, second):
            while "b" not in tab.sections:
                tab.listen(0.02)
            assert tab.sections["a"] == 1
            assert tab.sections["b"] == {"x": [1, 2]}
        state.drop("a")
        while "a" in first.sections:
            first.listen(0.02)


def flood(served, make, send, most):
    """Send again and again. Return how the page ends it; a tab is served meanwhile."""
    with make(served.gate.address) as bad, PageClient(served.gate.address) as good:
        for _ in range(most):
            send(bad)
            if bad.closed is not None:
                break
        settle_tab(good, served)
        bad.listen(3)
        return bad.closed


@pytest.mark.parametrize("message", [CAMERA, {"type": "ShareUrlRequest"}, b"", "text"])
def test_a_flood_of_messages_to_the_scene_is_ended(served, message):
    assert flood(served, SceneClient, lambda client: client.send(message), int(2.5 * MESSAGES[0])) == FLOOD


def test_a_flood_of_messages_to_the_page_is_ended(served):
    send = lambda tab: tab.send("hover", at=None)  # noqa: E731
    assert flood(served, PageClient, send, int(2.5 * MESSAGES[0])) == FLOOD


def test_a_flood_of_bytes_is_ended(served):
    send = lambda client: client.send(b"x" * (MAX_MESSAGE // 2))  # noqa: E731
    assert flood(served, SceneClient, send, 20) in (FLOOD, (1006, ""))  # what is on its way may hide the reason


def test_of_many_presses_at_once_a_few_are_served(served, tab):
    for _ in range(500):
        tab.press("stop")
    settle_tab(tab, served)
    assert 0 < len(served.messages) <= PRESSES[0] + 5 * PRESSES[1]
    assert tab.closed is None
