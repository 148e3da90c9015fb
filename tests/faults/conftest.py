"""The rows of the table of faults, which `pytest tests/faults` prints at its end."""

import pytest

from tests.helpers.fault_rows import FaultRow

PROPERTY = "fault row"


@pytest.fixture
def row(request, record_property):
    """Return the row of a test, named after it; it is printed whatever becomes of the test."""
    made = FaultRow(request.node.name.removeprefix("test_"), request.config.getoption("--tries"))
    yield made
    if made.tries:
        record_property(PROPERTY, made.line())


def pytest_terminal_summary(terminalreporter):
    """Print the rows of this run. The options of xdist's workers reach this process as properties of the reports."""
    reports = [each for kind in ("passed", "failed", "") for each in terminalreporter.stats.get(kind, [])]
    properties = [each for report in reports for each in getattr(report, "user_properties", [])]
    for line in dict.fromkeys(value for name, value in properties if name == PROPERTY):
        terminalreporter.write_line(line)
