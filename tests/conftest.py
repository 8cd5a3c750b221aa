"""Settings of all tests: random examples are the same in every run, so that a failure can be repeated."""

import os

import pytest
from hypothesis import settings

# Workers share the machine: threads of linear algebra, which wait by spinning, would only take each other's time.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

#: What takes longest begins first: no worker is left waiting for another at the end. Of two that begin together, each
#: compiles other simulators; what comes after them finds these.
LONGEST = ("loop", "effects", "reproduction_page", "export", "cli", "simulate", "pipeline", "posterior", "report")
LONG = [f"test_{name}.py" for name in LONGEST]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: LONG.index(item.path.name) if item.path.name in LONG else len(LONG))


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the pictures of a page empty, for tests of its words: drawing them takes three quarters of the time."""
    monkeypatch.setattr("discovery.report.page.render", lambda picture: (".svg", b"<svg/>"))
