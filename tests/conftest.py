"""Options of the test run."""

import pytest


def pytest_addoption(parser):
    """Add --soak N: the number of damaged inputs for each reader."""
    parser.addoption("--soak", type=int, default=300, help="damaged inputs for each reader")


@pytest.fixture
def soak_cases(request):
    """Return the number of damaged inputs for each reader."""
    return request.config.getoption("--soak")
