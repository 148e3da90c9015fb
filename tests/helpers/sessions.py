"""Driving a session of the page without the page."""

MAX_STEPS = 200  # control steps of one instruction


def run_to_end(session, max_steps=MAX_STEPS):
    """Steps until the instruction has ended. Returns the status."""
    for _ in range(max_steps):
        if not session.busy:
            return session.view.status
        session.step()
    raise AssertionError(session.view.status)
