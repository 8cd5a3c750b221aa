from __future__ import annotations

import ast
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from pathlib import Path

import grimp
import pytest
from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports
from numba.core.dispatcher import Dispatcher

import discovery
from discovery.simulation.kernel.compile import ROOMS, compile_kernel

CONTRACTS = Path(__file__).parents[1] / ".importlinter"

#: Heavy libraries are known in one place each.
HOMES = {
    "numba": {
        "discovery.simulation.kernel.compile",  # hears of the compiler, once a kernel is loaded
        "discovery.foundation.compiled_function",
        "discovery.simulation.kernel.lanes",
        "discovery.simulation.kernel.straight_line",
        "discovery.simulation.kernel.vectormath",
        "discovery.posterior.noise.filters",
        "discovery.posterior.noise.quantised",
        "discovery.screening.bounded_gain",
        "discovery_datasets.compiled",
    },
    "pysindy": {
        "discovery.sindy.sindy",
        "discovery.sindy.evidence",
        "discovery.sindy.library",
        "discovery.diagnosis.missing_force",
    },
    "emcee": {
        "discovery.posterior.ensembles",
        "discovery.posterior.moves",
        "discovery.posterior.checkpoint",
        "discovery.posterior.diagnostics",
    },
    "matplotlib": {"discovery.report", "discovery.plots"},
    "corner": {"discovery.report"},
    "pint": {"discovery.declarations.units"},
    "click": {"discovery.cli"},
    "latex2mathml": {"discovery.report.mathml"},
}


@cache
def graph(externals: bool = False) -> grimp.ImportGraph:
    return grimp.build_graph(
        "discovery",
        "discovery_datasets",
        include_external_packages=externals,
        exclude_type_checking_imports=True,
        cache_dir=None,
    )


def test_contracts_are_kept(capsys: pytest.CaptureFixture[str]) -> None:
    status = lint_imports(config_filename=str(CONTRACTS), no_cache=True)
    assert status == EXIT_STATUS_SUCCESS, capsys.readouterr().out


def test_the_package_holds_rooms_only() -> None:
    folder = Path(discovery.__file__).parent
    assert {path.name for path in folder.glob("*.py")} == {"__init__.py", "__main__.py"}
    for face in folder.glob("*/__init__.py"):
        assert ast.get_docstring(ast.parse(face.read_text(encoding="utf-8"))), f"{face} does not say what belongs there"


def test_no_import_cycles() -> None:
    modules = graph()
    imports = {m: modules.find_modules_directly_imported_by(m) for m in modules.modules}
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        pytest.fail(f"modules import each other in a circle: {' -> '.join(error.args[1])}")


@pytest.mark.parametrize("library", HOMES)
def test_heavy_libraries_have_one_home(library: str) -> None:
    modules = graph(externals=True)
    users = modules.find_modules_that_directly_import(library) if library in modules.modules else set()
    strangers = {u for u in users if not any(u == h or u.startswith(f"{h}.") for h in HOMES[library])}
    assert not strangers, f"{library} is imported outside its home by {', '.join(sorted(strangers))}"


def test_compiled_code_calls_inlined_functions_only() -> None:
    # Else one copy is linked where the caller has just been compiled, and another where it comes from disk.
    late = compile_kernel("elastica_calm", ("linear_stiffness", "sensor_delay"))
    spaces = [late.run.py_func.__globals__]
    spaces += [vars(import_module(module)) for module in HOMES["numba"] if module.startswith("discovery.")]
    found = {}
    for caller in (f for space in spaces for f in space.values() if isinstance(f, Dispatcher)):
        named = (caller.py_func.__globals__.get(name) for name in caller.py_func.__code__.co_names)
        found |= {f.py_func.__name__: f.targetoptions.get("forceinline") for f in named if isinstance(f, Dispatcher)}
    assert {"_read_late", "_transition", "_log_cell", "_product"} < found.keys()
    assert [name for name, inlined in found.items() if not inlined] == []


def test_the_text_of_a_kernel_follows_from_the_rooms_of_its_key() -> None:
    # Effects are found by name, so no module imports them.
    found = {m.split(".")[1] for m in graph().find_upstream_modules("discovery.simulation.kernel.compile") if "." in m}
    assert found | {"effects"} == {*ROOMS}
