"""Settings of all tests: random examples are the same in every run, so that a failure can be repeated."""

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

# Workers share the machine: threads of linear algebra, which wait by spinning, would only take each other's time.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

#: What takes longest begins first, by the CPU time of each file: no worker is left waiting for another at the end. Of
#: two that begin together, each compiles other simulators; what comes after them finds these, and the browser the
#: pages that the report has drawn.
LONGEST = (
    *("effects", "report", "export", "cli", "pipeline", "search", "loop", "browser", "reproduction", "sindy"),
    *("posterior", "mechanics", "twin", "separation", "drafting", "examples", "latent_force", "contradiction"),
    *("blind", "input_choice", "campaign", "ensembles", "rough", "unequal_steps", "docs", "coupling", "rod_effects"),
    *("measured_rigs", "first_fit", "derivation", "faults", "general_model", "failed_fit", "predict"),
)
LONG = [f"test_{name}.py" for name in LONGEST]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: LONG.index(item.path.name) if item.path.name in LONG else len(LONG))


EMPTY = ".svg", b"<svg/>"


@pytest.fixture
def sketched(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the pictures of a page empty, for tests of which there are: to draw them takes three quarters of it."""
    monkeypatch.setattr("discovery.report.page.render", lambda picture: EMPTY)


@pytest.fixture
def undrawn(sketched: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make pages without pictures, for tests of their words and tables: pictures take nine tenths of the time."""
    from discovery.report.figures import SECTIONS

    monkeypatch.setattr("discovery.report.figures.SECTIONS", dict.fromkeys(SECTIONS, ()))


@pytest.fixture(scope="module")
def few_draws() -> Iterator[None]:
    """Weigh models by few draws, for tests of which an evidence is written and read: its number is proved elsewhere."""
    from discovery.estimation.importance import importance_sample

    def few(target: Any, dimension: int, rng: Any, draws: int, **more: Any) -> Any:
        return importance_sample(target, dimension, rng, min(draws, 500), pilot=256, **more)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("discovery.posterior.marginal_likelihood.importance_sample", few)
        yield


@pytest.fixture(scope="session")
def sketch() -> Callable[[Path], Path]:
    """Return what writes the page of a run with empty pictures, for fixtures that several tests share."""
    from discovery.report import build_report

    def written(folder: Path) -> Path:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("discovery.report.page.render", lambda picture: EMPTY)
            return build_report(folder)

    return written


@pytest.fixture(scope="session")
def drawn_run(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return where a synthetic run lies with its page, which is drawn once for all workers: it is read, not changed."""
    import synthetic_run

    from discovery.foundation.locks import file_lock
    from discovery.report import build_report

    own = tmp_path_factory.getbasetemp()
    place = own.parent if "PYTEST_XDIST_WORKER" in os.environ else own

    def folder(kind: str) -> Path:
        found = place / f"drawn_{kind}"
        with file_lock(place / f"{kind}.lock", patience=600):
            if not found.exists():
                made = own / f"made_{kind}"
                getattr(synthetic_run, f"write_{kind}_run")(made)
                build_report(made)
                shutil.move(made, found)
        return found

    return folder
