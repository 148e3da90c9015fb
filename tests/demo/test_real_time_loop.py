"""The loop of a session: its threads, and that neither pause nor slow time nor single steps end the watch of an arm."""

import threading

import pytest
import torch

from demo.real_time_loop import RealTimeLoop
from demo.session import Session
from demo.session_config import make_config
from deployment.connecting import ArmChoice


@pytest.fixture
def session():
    session = Session(make_config(driver="expert"), seed=3, arm=ArmChoice("sim"))
    yield session
    session.close()


def run(session, *actions):
    """Run the loop, with an action after each of its rounds. Returns the messages."""
    messages, waiting = [], list(actions)

    def act(_):
        if waiting:
            waiting.pop(0)(loop)
        else:
            loop.stop()

    loop = RealTimeLoop(session, act, messages.append)
    loop.run()
    return messages


def pause(loop):
    loop.paused = True


def nothing(loop):
    """Let one round pass."""


def test_torch_uses_one_thread_so_that_no_step_is_late_beside_a_browser():
    counted, session = [], Session(make_config(driver="expert"), seed=3)
    loop = RealTimeLoop(session, lambda _: (counted.append(torch.get_num_threads()), loop.stop()), print)

    def run_with_two():
        torch.set_num_threads(2)
        loop.run()

    thread = threading.Thread(target=run_with_two)
    thread.start()
    thread.join()
    session.close()
    assert counted == [1]


@pytest.mark.slow
def test_a_paused_arm_holds_at_once_and_a_stop_is_heeded(session):
    arm, held = session.arm, []
    hold = arm.arm.hold
    arm.arm.hold = lambda: held.append(hold())
    session.say(session.example())
    moving, after = [], []

    def press_stop(loop):
        after.append((arm.holding, len(held), session.arm_note))
        arm.safety.request_stop("somebody pressed stop")

    def see(loop):
        after.append((arm.safety.stopped, session.view.status))

    assert run(session, nothing, lambda _: moving.append(arm.holding), pause, press_stop, see) == []
    assert moving == [False]
    assert after[0] == (True, 1, "paused: the arm holds")
    assert after[1] == ("somebody pressed stop", "Stopped: somebody pressed stop.")


@pytest.mark.slow
def test_a_stop_while_time_is_slow_holds_before_the_next_step(session):
    arm = session.arm
    session.say(session.example())
    looks, look = [], arm.look

    def counted():
        looks.append(len(held))
        look()

    held, hold = [], arm.arm.hold
    arm.look, arm.arm.hold = counted, lambda: held.append(hold())

    def slow_down_and_stop(loop):
        loop.speed = 0.1
        looks.clear()
        arm.safety.request_stop("somebody pressed stop")

    run(session, nothing, slow_down_and_stop, nothing)
    assert looks[:2] == [0, 1]
    assert looks.count(1) > 5


@pytest.mark.slow
def test_a_single_step_of_a_paused_arm_ends_in_a_hold(session):
    arm, commands = session.arm, []
    command = arm.arm.command
    arm.arm.command = lambda *wanted: commands.append(command(*wanted))
    holding = []

    def step(loop):
        commands.clear()
        loop.step_once()

    run(session, pause, nothing, step, nothing, lambda _: holding.append(arm.holding))
    assert len(commands) == 1
    assert holding == [True]
