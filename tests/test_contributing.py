"""The page for contributors: its recipes work as they stand, and what its map names is there."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import synthetic_run
from noise_contract import check_noise
from scipy.stats import laplace

from discovery.posterior.noise import NOISE_MODELS
from discovery.report.results import read_run
from discovery.report.style import styled
from discovery.rigs.rig_file import read_rig

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
#: Files of the recipes by their place in the checkout.
FILES = dict(re.findall(r"^```(?:python|toml)\n# (\S+)\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL))


def module(name: str, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    made = ModuleType(Path(name).stem)
    # A dataclass looks its module up.
    monkeypatch.setitem(sys.modules, made.__name__, made)
    exec(FILES[name], vars(made))
    return made


def test_what_the_map_names_is_there() -> None:
    named = [n for row in re.findall(r"^\| .+ \|$", TEXT, re.MULTILINE) for n in re.findall(r"`([^`]+)`", row)]
    assert len(named) > 15
    assert not [n for n in named if not (ROOT / n).exists()]


def test_a_ready_made_system_is_read(tmp_path: Path) -> None:
    system = FILES["discovery/rigs/systems/torsion_pendulum.toml"]
    assert set(tomllib.loads(system)) == {"system"}
    columns = '[columns]\ntime = { name = "t", unit = "s" }\ninput = { name = "u", unit = "N m" }\n'
    columns += 'output = { name = "y", unit = "rad" }\n'
    (tmp_path / "rig.toml").write_text(f'name = "wire"\n{system}\n{columns}', encoding="utf-8")
    declared = read_rig(tmp_path / "rig.toml").system
    assert declared is not None
    assert set(declared.coordinates) == {"twist"}


def test_a_noise_model_keeps_its_contract(monkeypatch: pytest.MonkeyPatch) -> None:
    made = module("discovery/posterior/noise/laplace.py", monkeypatch).Laplace
    monkeypatch.setitem(NOISE_MODELS, "laplace", made)
    check_noise("laplace")
    residual = np.random.default_rng(1).laplace(0, 1.5, (400, 1, 1))
    found = made(None, (), {0: 400}).log_likelihood(0, residual, np.zeros((1, 1)), np.log([[1.5]]))
    assert found == pytest.approx(laplace.logpdf(residual, scale=1.5).sum(), rel=1e-12)


def test_a_figure_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synthetic_run.write_arm_run(tmp_path)
    with styled():
        picture = module("discovery/report/figures/spread.py", monkeypatch).draw(read_run(tmp_path))
    assert picture.name == "spread"
    assert len(picture.figure.axes[0].patches) == 2
