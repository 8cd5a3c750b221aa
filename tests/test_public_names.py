"""What the packages of the paper's physics offer by name: it is there, loads lazily, and hides no module."""

from __future__ import annotations

import ast
import pkgutil
from importlib import import_module
from types import ModuleType

import pytest
from test_import import HEAVY, loaded_after

PACKAGES = {
    "discovery.theory.elastica": {
        "elastica_series",
        "fit_static_law",
        "force_components",
        "load_at_tip",
        "perpendicular_law",
        "radius_law",
        "radius_limits",
        "shape_under_load",
        "small_deflection_shape",
        "small_deflection_tip",
        "tip_under_load",
    },
    "discovery.theory.massless_arm": {"GeneralModel", "simulate_general"},
    "discovery.theory.drivetrain": {
        "ASSUMED_MOTOR",
        "Arm",
        "Motor",
        "PositionController",
        "coupling_torque",
        "drive_arm",
        "effective_inertia",
        "encoder_as_input",
        "fitted_coupling",
        "move_arm",
        "trapezoid_command",
    },
}


@pytest.fixture(params=PACKAGES)
def package(request: pytest.FixtureRequest) -> ModuleType:
    return import_module(request.param)


def test_importing_the_packages_stays_light() -> None:
    assert loaded_after(f"import {', '.join(PACKAGES)}").isdisjoint({*HEAVY, "numpy"})


def test_every_name_is_there(package: ModuleType) -> None:
    assert set(package.__all__) == PACKAGES[package.__name__]
    for name in package.__all__:
        home, _, attribute = package._HOMES[name].partition(":")
        assert getattr(package, name) is getattr(import_module(home), attribute)
        assert name in dir(package)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = package.nothing


def test_type_checkers_see_what_is_loaded(package: ModuleType) -> None:
    tree = ast.parse(pkgutil.get_data(package.__name__, "__init__.py") or b"")
    seen = {
        alias.asname or alias.name: f"{node.module}:{alias.name}"
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("discovery.")
        for alias in node.names
        if alias.asname != "_lazy_names"
    }
    assert seen == package._HOMES


def test_no_name_hides_a_module(package: ModuleType) -> None:
    assert {m.name for m in pkgutil.iter_modules(package.__path__)}.isdisjoint(package.__all__)
