"""The page on the command line says what there is."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import click
import pytest

from discovery.cli import cli

PAGE = (Path(__file__).parents[1] / "docs" / "COMMAND_LINE.md").read_text(encoding="utf-8")


def commands() -> dict[str, click.Command]:
    found = {}
    for name, command in cli.commands.items():
        inner = command.commands if isinstance(command, click.Group) else {}
        found.update({f"{name} {n}": c for n, c in inner.items()} or {name: command})
    return found


def test_every_command_is_named() -> None:
    for name in cli.commands:
        assert re.search(rf"`(discovery )?{name}\b", PAGE), name


def test_every_result_is_printed_as_json_where_asked() -> None:
    with_option = {name for name, c in commands().items() if any("--json" in p.opts for p in c.params)}
    assert with_option == set(commands())


@pytest.mark.parametrize("shell", re.findall(r"_DISCOVERY_COMPLETE=(\w+)_source", PAGE))
def test_the_shell_completes(shell: str) -> None:
    run = subprocess.run(
        [sys.executable, "-c", "from discovery.cli import main; main()"],
        env={**os.environ, "_DISCOVERY_COMPLETE": f"{shell}_source"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert "_DISCOVERY_COMPLETE" in run.stdout
    assert f"{shell}_complete" in run.stdout


@pytest.mark.parametrize("status", [0, 2, 3, 130])
def test_every_exit_status_is_explained(status: int) -> None:
    assert f"| {status} |" in PAGE
