"""Every public function shows how it is used, and what it shows comes out."""

from __future__ import annotations

import doctest
import inspect
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

import discovery
from discovery.foundation.errors import DiscoveryError

ROOT = Path(__file__).parents[1]
PARSER = doctest.DocTestParser()
#: The same work is done once for all examples.
#: The loop on the same recordings has its answer in `test_search_part`, too.
WHOLE_RUNS = ("run", "build_report", "close_loop", "LoopResult")
DEAR = ("close_loop", "fit_model", "load_dataset", "run", "sample")


def examples(of: Any) -> list[doctest.Example]:
    """Return the lines of a docstring that run."""
    return [e for e in PARSER.get_examples(inspect.getdoc(of) or "") if not e.options.get(doctest.SKIP)]


def methods(of: type) -> Iterator[tuple[str, Any]]:
    """Yield the public methods of a class that this package defines."""
    known = {n for c in of.__mro__ if c.__module__.startswith("discovery") for n in vars(c) if not n.startswith("_")}
    for name in sorted(known):
        if callable(inspect.getattr_static(of, name)) or isinstance(
            inspect.getattr_static(of, name), classmethod | staticmethod
        ):
            yield name, getattr(of, name)


def without_examples(names: list[str]) -> list[str]:
    """Return public functions, classes and methods without an example; an error has none, an example may catch one."""
    lacking = []
    for name in names:
        value = getattr(discovery, name)
        own = examples(value)
        if isinstance(value, type) and issubclass(value, DiscoveryError):
            continue
        lacking += [] if own else [name]
        if not isinstance(value, type):
            continue
        shown = "".join(e.source for e in own)
        for method, found in methods(value):
            # The example of a class may show what its methods do.
            lacking += [] if f".{method}(" in shown or examples(found) else [f"{name}.{method}"]
    return lacking


def test_every_public_function_has_an_example() -> None:
    assert without_examples(discovery.__all__) == []


def test_one_without_an_example_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    class Shown:
        """Something.

        Examples
        --------
        >>> Shown().told()
        1
        """

        def told(self) -> int:
            """Tell."""
            return 1

        def untold(self) -> int:
            """Tell nobody."""
            return 2

    Shown.__module__ = "discovery.shown"
    monkeypatch.setattr(discovery, "Shown", Shown, raising=False)
    monkeypatch.setattr(discovery, "bare", lambda: None, raising=False)
    assert without_examples(["Shown", "bare"]) == ["Shown.untold", "bare"]


def once(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that does the same work once, told by what its arguments say of themselves."""
    made: dict[str, Any] = {}

    def kept(*given: Any, **named: Any) -> Any:
        key = f"{given!r} {named!r}"
        if key not in made:
            made[key] = function(*given, **named)
        return made[key]

    return kept


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Any]]:
    """Work in an empty folder that shows the committed recordings, with every public name at hand."""
    folder, before, backend = tmp_path_factory.mktemp("examples"), Path.cwd(), mpl.get_backend()
    (folder / "datasets").symlink_to(ROOT / "datasets")
    os.chdir(folder)
    mpl.use("Agg")
    names = {name: getattr(discovery, name) for name in discovery.__all__}
    yield names | {name: once(names[name]) for name in DEAR}
    mpl.use(backend)
    os.chdir(before)


def sessions() -> Iterator[Any]:
    """Yield every docstring with an example that runs."""
    for name in discovery.__all__:
        value = getattr(discovery, name)
        found = [(name, value)]
        found += [(f"{name}.{n}", m) for n, m in methods(value)] if isinstance(value, type) else []
        marks = [pytest.mark.slow] if name in WHOLE_RUNS else []
        yield from (pytest.param(inspect.getdoc(of), id=label, marks=marks) for label, of in found if examples(of))


@pytest.mark.usefixtures("sketched")
@pytest.mark.parametrize("session", list(sessions()))
def test_what_an_example_shows_comes_out(
    session: str, place: dict[str, Any], request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    name = request.node.callspec.id
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    with capsys.disabled():
        said: list[str] = []
        runner.run(PARSER.get_doctest(session, dict(place), name, None, 0), out=said.append)
    assert not runner.failures, "".join(said)
