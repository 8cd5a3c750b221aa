"""What is kept on disk between processes: damage is found and mended, strangers are refused, work is done once."""

from __future__ import annotations

import errno
import os
import shutil
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from numba import njit

from discovery.foundation import disk_cache
from discovery.foundation.compiled_function import compiled, text_hash
from discovery.foundation.errors import InputError
from discovery.foundation.locks import file_lock, folder_lock


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DISCOVERY_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def squared() -> Any:
    """Return a compiled function as a new process has it."""

    def square(x):
        return x * x

    return compiled(nogil=True)(square)


def called() -> tuple[float, int]:
    """Return what the function returns, and how often it was compiled for that."""
    function = squared()
    return function(3.0), sum(function.stats.cache_misses.values())


def made(key: str = "seven") -> tuple[list[int], bool]:
    """Return an object that is kept, and whether it was made again."""
    calls = []
    return disk_cache.kept(key, lambda: calls.append(1) or [7]), bool(calls)


def _flipped(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)


def _in_place(path: Path) -> None:
    path.unlink()
    path.mkdir()
    (path / "inside").touch()


#: What may have happened to an entry, by name.
DAMAGES: dict[str, Callable[[Path], object]] = {
    "truncated": lambda path: os.truncate(path, path.stat().st_size // 2),
    "cut within its hash": lambda path: os.truncate(path, 10),
    "empty": lambda path: os.truncate(path, 0),
    "garbage": lambda path: path.write_bytes(os.urandom(500)),
    "one bit": _flipped,
    "another's": lambda path: shutil.copy(path.with_name("other"), path),
    "unreadable": lambda path: path.chmod(0),
    "a folder": _in_place,
    "a link to nothing": lambda path: (path.unlink(), path.symlink_to("nowhere")),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_damaged_is_made_again(folder: Path, damage: str) -> None:
    made("another")
    (other,) = folder.glob("*.kept")
    other.rename(folder / "other")
    assert made() == ([7], True)
    assert called() == (9.0, 1)
    entries = [*folder.glob("*.kept")]
    assert len(entries) == 2
    for entry in entries:
        DAMAGES[damage](entry)
    # The superuser reads what nobody may.
    readable = damage == "unreadable" and os.access(entries[0], os.R_OK)
    assert made() == ([7], not readable)
    assert called() == (9.0, int(not readable))
    # Then it is whole again.
    assert made() == ([7], False)
    assert called() == (9.0, 0)


HALF = 0.5


@njit
def halved(x):
    return HALF * x


@njit(error_model="numpy")
def shifted(x):
    return halved(x) + 1.0


def test_what_is_compiled_depends_on_what_it_names_and_on_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    @njit(error_model="numpy")
    def another(x):
        return halved(x) + 1.0

    module, first = sys.modules[__name__], text_hash(shifted)
    assert text_hash(another) != first
    with monkeypatch.context() as patch:
        patch.setattr(module, "HALF", 0.25)
        assert text_hash(shifted) != first
    with monkeypatch.context() as patch:
        patch.setattr(module, "halved", another)
        assert text_hash(shifted) != first
    with monkeypatch.context() as patch:
        patch.setitem(shifted.targetoptions, "error_model", "python")
        assert text_hash(shifted) != first
    monkeypatch.setattr(module, "DAMAGES", {})
    assert text_hash(shifted) == first


def test_nothing_that_is_executed_lies_beside_the_source(folder: Path) -> None:
    assert called() == (9.0, 1)
    assert {path.suffix for path in folder.iterdir()} == {".kept"}
    found = [*Path(__file__).parent.glob("__pycache__/*.nb[ci]")]
    assert not [path for path in found if "square" in path.name]


def test_the_folder_is_the_users_alone(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    for mode in (0o720, 0o702, 0o777):
        folder.chmod(mode)
        with pytest.raises(InputError, match=r"can be written by others.*chmod 700.*DISCOVERY_CACHE"):
            made()
    folder.chmod(0o755)
    assert made() == ([7], False)
    monkeypatch.setattr(os, "getuid", lambda: folder.stat().st_uid + 1)
    with pytest.raises(InputError, match=r"belongs to another user.*DISCOVERY_CACHE"):
        called()


@pytest.mark.parametrize("place", ["/proc/no/such", "/dev/null", "a\0b", "x" * 5000])
def test_where_nothing_can_be_kept_all_works(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # The environment itself holds no NUL.
    monkeypatch.setattr(os, "environ", {**os.environ, "DISCOVERY_CACHE": place})
    assert made() == ([7], True)
    assert called() == (9.0, 1)


def test_a_full_disk_keeps_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, content: bytes) -> None:
        path.touch()
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    assert made() == ([7], True)
    assert called() == (9.0, 1)
    assert not [*folder.iterdir()]


def test_several_processes_compile_once(folder: Path, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text("from test_disk_cache import called\nprint(*called())\n")
    folder.mkdir(mode=0o700)
    # Locks of processes that died hold nobody up.
    key = disk_cache._path(folder, "any").with_suffix(".lock")
    key.touch()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    running = [
        subprocess.Popen([sys.executable, script], env=environment, stdout=subprocess.PIPE, text=True) for _ in range(2)
    ]
    said = [process.communicate()[0].split() for process in running]
    assert [value for value, _ in said] == ["9.0"] * 2
    assert sum(int(compiled) for _, compiled in said) == 1


def test_a_lock_waits_ends_and_is_never_stale(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    path.touch()
    with file_lock(path, 0.0) as mine:
        assert mine
        start = time.monotonic()
        with file_lock(path, 0.2) as other:
            assert not other
        assert 0.2 <= time.monotonic() - start < 5.0
    assert not path.exists()
    code = f"""
import time
from pathlib import Path
from discovery.foundation.locks import file_lock
with file_lock(Path({str(path)!r}), 1.0) as mine:
    print(mine, flush=True)
    time.sleep(600)
"""
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "True\n"
        with file_lock(path, 0.0) as other:
            assert not other
        holder.kill()
    assert path.exists()
    with file_lock(path, 0.0) as mine:
        assert mine
    # Where no lock can be, the work is done all the same.
    with file_lock(tmp_path, 0.0) as mine:
        assert not mine


def test_a_folder_is_held_by_one(tmp_path: Path) -> None:
    with folder_lock(tmp_path) as mine:
        assert mine
        with folder_lock(tmp_path) as other:
            assert not other
    with folder_lock(tmp_path) as mine:
        assert mine
    assert not [*tmp_path.iterdir()]
    with folder_lock(tmp_path / "absent") as mine:
        assert mine


@pytest.mark.slow
def test_a_read_only_installation_needs_no_home(folder: Path) -> None:
    # With this setting the compiler's own cache finds a place for nothing, as there.
    code = """
import discovery_datasets.beam, discovery_datasets.engine
import discovery.posterior.noise.filters, discovery.posterior.noise.quantised, discovery.runs.pipeline, discovery.report
from test_disk_cache import called
print(*called())
"""
    environment = {
        **os.environ, "NUMBA_CACHE_LOCATOR_CLASSES": "ZipCacheLocator", "HOME": "/no/such/place",
        "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path]),
    }  # fmt: skip
    for times in "10":
        run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
        assert run.stdout.split() == ["9.0", times], run.stderr
