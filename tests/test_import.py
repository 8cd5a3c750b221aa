from __future__ import annotations

import json
import pkgutil
import subprocess
import sys
from importlib import import_module

import pytest

import discovery

HEAVY = ("numba", "scipy", "sympy", "pandas", "matplotlib", "pysindy", "pint", "pydantic", "emcee", "xarray", "sklearn")


def loaded_after(statement: str) -> set[str]:
    """Return the top-level packages that a fresh interpreter has loaded after a statement."""
    code = f"import json, sys\n{statement}\nprint(json.dumps(sorted({{m.partition('.')[0] for m in sys.modules}})))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(json.loads(result.stdout.splitlines()[-1]))


@pytest.mark.parametrize(
    "statement", ["import discovery", "import discovery.foundation.errors, discovery.declarations.parameters"]
)
def test_importing_the_package_stays_light(statement: str) -> None:
    assert loaded_after(statement).isdisjoint(HEAVY)


def test_the_probe_sees_what_is_loaded() -> None:
    assert "sympy" in loaded_after("import discovery.declarations.symbols")


def test_every_module_can_be_imported() -> None:
    names = [m.name for m in pkgutil.walk_packages(discovery.__path__, "discovery.") if not m.name.endswith("__main__")]
    assert len(names) > 30
    for name in names:
        import_module(name)
