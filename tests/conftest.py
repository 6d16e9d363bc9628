"""Options of the test run."""

import pytest


def pytest_addoption(parser):
    """Add --soak N: the number of damaged inputs; --soak-from M: the first one's seed."""
    parser.addoption("--soak", type=int, default=1000, help="damaged inputs")
    parser.addoption("--soak-from", type=int, default=0, help="seed of the first damaged input")


@pytest.fixture
def soak_cases(request):
    """Return the number of damaged inputs."""
    return request.config.getoption("--soak")


@pytest.fixture
def soak_from(request):
    """Return the seed of the first damaged input."""
    return request.config.getoption("--soak-from")
