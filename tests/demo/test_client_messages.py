"""What a client of the page can do to its elements, and what it cannot."""

from __future__ import annotations

import math
import time

import msgspec
import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed")

from demo.client_messages import MAX_TEXT, MessageCheck
from demo.guarded_server import FLOOD, MAX_MESSAGE, MESSAGES, PRESSES, open_guarded_server
from demo.page_gate import PageGate
from tools.browser import free_port
from tools.page_client import CAMERA, PageClient

NAN, INFINITY = math.nan, math.inf


class Elements:
    """A page with an element of each kind that play.py has. presses: what was pressed."""

    def __init__(self):
        port = int(free_port())
        self.gate, self.check = PageGate("127.0.0.1", port), MessageCheck()
        self.server = open_guarded_server("127.0.0.1", port, self.gate, self.check)
        gui, self.presses = self.server.gui, []
        self.message = gui.add_html("")
        with gui.add_form(None) as form:
            self.text = gui.add_text("Say", "before")
            self.button = gui.add_button("Do it")
        self.folder = gui.add_folder("Folder")
        self.slider = gui.add_slider("Speed", 0.1, 1.0, 0.1, 0.5)
        self.whole = gui.add_slider("Objects", 1, 6, 1, 2)
        self.checkbox = gui.add_checkbox("Pause", False)
        self.dropdown = gui.add_dropdown("Robot", ("kuka", "panda"), initial_value="kuka")
        self.group = gui.add_button_group("", ("Stop", "Shuffle"))
        self.hidden = gui.add_button("Hidden", visible=False)
        self.disabled = gui.add_button("Disabled", disabled=True)
        self.handles = self.server.scene.add_transform_controls("/finger", position=(0.1, 0.2, 0.3))
        form.on_submit(lambda _: self.presses.append("form"))
        for button in (self.button, self.hidden, self.disabled):
            button.on_click(lambda event: self.presses.append(event.target.label))
        self.group.on_click(lambda event: self.presses.append(event.target.value))
        self.form = form

    def state(self):
        """All that a client can change."""
        inputs = self.text, self.slider, self.whole, self.checkbox, self.dropdown, self.group, self.button
        handles = [*self.handles.position, *self.handles.wxyz]
        kept = [
            (vars(each._impl).copy(), vars(each._impl.props).copy()) for each in (*inputs, self.hidden, self.disabled)
        ]
        for impl, _ in kept:
            impl.pop("update_timestamp")
        return [each.value for each in inputs], kept, np.round(handles, 9).tolist(), list(self.presses)


@pytest.fixture(scope="module")
def elements():
    elements = Elements()
    yield elements
    elements.server.stop()


@pytest.fixture
def client(elements):
    with PageClient(elements.gate.address) as client:
        client.uuid("Disabled")
        elements.text.value = "before"
        yield client


def settle(client, elements):
    """Wait until all that was sent has been served: a sentence that is set last is there."""
    mark = f"mark {time.monotonic()}"
    client.set("Say", mark)
    wait_for(lambda: elements.text.value == mark)
    time.sleep(0.05)  # presses run in other threads
    elements.text.value = "before"
    client.listen(0.05)


def wait_for(condition):
    end = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def update(uuid, /, **updates):
    return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": updates}


BAD_VALUES = {
    "Say": [1, 1.5, True, None, [], {}, ["a"], b"bytes", "x" * (MAX_TEXT + 1)],
    "Speed": [NAN, INFINITY, -INFINITY, 0, -1, 0.0999, 1.0001, 1e308, 2**63, True, "0.5", "", None, [0.5], {}],
    "Objects": [NAN, INFINITY, 0, 7, 2.5, -3, 2**40, True, "2", None],
    "Pause": [0, 1, 0.0, NAN, "", "true", None, []],
    "Robot": ["", "jaco", "KUKA", "kuka ", 0, True, None, ["kuka"], {"kuka": 1}],
    "Stop": ["", "stop", "Quit", True, 0, None, ["Stop"]],
    "Do it": [False, 1, 0, "", "True", None, [True], NAN],
    "Hidden": [True, False],
    "Disabled": [True, False],
}
ATTRIBUTES = [
    "sync_cb", "update_cb", "update_timestamp", "removed", "is_button", "uuid", "gui_api", "props",
    "parent_container_id", "hold_cbs_from_freq", "label", "hint", "visible", "disabled", "options", "min", "max",
    "step", "order", "content", "color", "__class__", "__dict__", "_value",
]  # fmt: skip


@pytest.mark.parametrize("label", BAD_VALUES)
def test_an_element_takes_no_value_that_a_person_could_not_choose(elements, client, label):
    before, dropped = elements.state(), elements.check.dropped
    for value in BAD_VALUES[label]:
        client.set(label, value)
    settle(client, elements)
    assert elements.state() == before
    assert elements.check.dropped == dropped + len(BAD_VALUES[label])


@pytest.mark.parametrize("label", ["Say", "Speed", "Robot", "Stop", "Do it"])
def test_nothing_of_an_element_but_its_value_can_be_set(elements, client, label):
    before, uuid = elements.state(), client.uuid(label)
    for attribute in ATTRIBUTES:
        for value in ("x", 1, True, None, [1], {}):
            client.send(update(uuid, **{attribute: value}))
        client.send(update(uuid, value=client.elements[uuid].get("value", True), **{attribute: "x"}))
    client.send(update(uuid))
    settle(client, elements)
    assert elements.state() == before


def test_what_is_no_input_cannot_be_set(elements, client):
    before = elements.state()
    for uuid in (
        elements.message._impl.uuid,
        elements.folder._impl.uuid,
        elements.form._impl.uuid,
        "root",
        "",
        "x" * 999,
    ):
        client.send(update(uuid, value="x"))
        client.send(update(uuid, content="x"))
    settle(client, elements)
    assert elements.state() == before
    assert elements.message.content == ""


def test_values_that_a_person_can_choose_are_taken(elements, client):
    for label, value in (
        ("Speed", 0.1),
        ("Speed", 1),
        ("Objects", 6),
        ("Objects", 3.0),
        ("Pause", True),
        ("Robot", "panda"),
    ):
        client.set(label, value)
    client.set("Say", "x" * MAX_TEXT)
    wait_for(lambda: elements.text.value == "x" * MAX_TEXT)
    assert (elements.slider.value, elements.whole.value) == (1.0, 3)
    assert (elements.checkbox.value, elements.dropdown.value) == (True, "panda")
    elements.presses.clear()
    client.press("Do it")
    client.press("Shuffle")
    client.send({"type": "GuiFormSubmitMessage", "uuid": elements.form._impl.uuid})
    wait_for(lambda: sorted(elements.presses) == ["Do it", "Shuffle", "form"])


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


def test_messages_that_the_page_never_sends_change_nothing_and_are_counted(elements, client):
    before, dropped = elements.state(), elements.check.dropped
    assert len(BAD_MESSAGES) > 50
    for message in BAD_MESSAGES:
        client.send(message)
    settle(client, elements)
    assert client.closed is None
    assert elements.state() == before
    assert elements.check.dropped == dropped + len(BAD_MESSAGES)


def test_of_two_values_in_one_message_the_one_that_was_checked_is_set(elements, client):
    def text(word):
        return msgspec.msgpack.encode(word)

    uuid = client.uuid("Speed")
    both = b"".join((b"\x82", text("value"), text(0.2), text("value"), text(NAN)))
    for values in (both, b"".join((b"\x82", text("value"), text(NAN), text("value"), text(0.2)))):
        client.send(
            b"".join(
                (b"\x83", text("type"), text("GuiUpdateMessage"), text("uuid"), text(uuid), text("updates"), values)
            )
        )
    settle(client, elements)
    assert math.isfinite(elements.slider.value)


def test_handles_follow_a_client(elements, client):
    client.send(handles(position=[0.4, 0.5, 0.6]))
    wait_for(lambda: np.allclose(elements.handles.position, [0.4, 0.5, 0.6]))


def flood(elements, message, most):
    """Send a message again and again. Return how the page ends it; a second client is served meanwhile."""
    with PageClient(elements.gate.address) as bad, PageClient(elements.gate.address) as good:
        good.uuid("Speed")
        for _ in range(most):
            bad.send(message)
            if bad.closed is not None:
                break
        settle(good, elements)
        bad.listen(3)
        return bad.closed


@pytest.mark.parametrize("message", [CAMERA, {"type": "ShareUrlRequest"}, b"", "text"])
def test_a_flood_of_messages_is_ended(elements, message):
    assert flood(elements, message, int(2.5 * MESSAGES[0])) == FLOOD


def test_a_flood_of_bytes_is_ended(elements):
    assert flood(elements, b"x" * (MAX_MESSAGE // 2), 20) in (
        FLOOD,
        (1006, ""),
    )  # what is on its way may hide the reason


def test_of_many_presses_at_once_a_few_are_served(elements, client):
    elements.presses.clear()
    for _ in range(500):
        client.press("Do it")
    settle(client, elements)
    assert 0 < len(elements.presses) <= PRESSES[0] + 5 * PRESSES[1]
    assert client.closed is None


def test_the_page_has_all_that_the_check_reads_of_viser(elements):
    """Private names of viser: if they change, no message passes, which the other tests show too."""
    assert elements.slider._impl.uuid in elements.server.gui._gui_input_handle_from_uuid
    assert elements.form._impl.uuid in elements.server.gui._container_handle_from_uuid
