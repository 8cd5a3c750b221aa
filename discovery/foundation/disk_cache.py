"""What is kept on disk between processes: each entry with its hash, in a folder that is the user's alone.

Entries are compiled code and pickles, which run where they are loaded. So the folder must belong to the user and be
writable by nobody else, and an entry is used only if the hash that begins it is that of its key and its content: one
that was cut short, altered or put under another's name counts as absent, and is made again.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import secrets
import shutil
import stat
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from functools import cache
from pathlib import Path
from typing import TypeVar

from discovery.foundation.errors import InputError
from discovery.foundation.locks import file_lock

T = TypeVar("T")
#: Seconds for which a process waits for another that makes the same entry.
_PATIENCE = 300.0
#: Bytes of the hash that begins an entry.
_DIGEST = 32


def cache_folder() -> Path | None:
    """Return the folder that DISCOVERY_CACHE names, or that of the user's cache; None where nothing can be kept.

    Raises InputError if the folder belongs to somebody else, or others may write into it.
    """
    chosen = os.environ.get("DISCOVERY_CACHE")
    folder = Path(chosen) if chosen else _users_folder()
    if folder is None:
        return None
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.stat()
    except (OSError, ValueError):
        return None
    _check_private(folder, found)
    return folder


def _users_folder() -> Path | None:
    from platformdirs import user_cache_path

    # Of a user without a home the path is relative.
    found = user_cache_path("discovery") / "compiled"
    return found if found.is_absolute() else None


def _check_private(folder: Path, found: os.stat_result) -> None:
    """Refuse a folder into which somebody else may have put code."""
    if not hasattr(os, "getuid"):
        return
    remedy = "name another folder in the environment variable DISCOVERY_CACHE."
    if found.st_uid != os.getuid():
        raise InputError(
            f"The folder of compiled simulators {folder} belongs to another user, whose code would run here. Remove "
            f"it, or {remedy}"
        )
    if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise InputError(
            f"The folder of compiled simulators {folder} can be written by others, whose code would run here. Empty it "
            f"and make it yours alone (chmod 700), or {remedy}"
        )


def _digest(key: str, content: bytes) -> bytes:
    return hashlib.sha256(len(key).to_bytes(8, "little") + key.encode() + content).digest()


def _path(folder: Path, key: str) -> Path:
    return folder / f"{hashlib.sha256(key.encode()).hexdigest()[:40]}.kept"


def load(key: str) -> bytes | None:
    """Return the content of an entry; None where there is none, or where it is damaged."""
    folder = cache_folder()
    if folder is None:
        return None
    path = _path(folder, key)
    try:
        stored = path.read_bytes()
    except OSError:
        return None
    content = stored[_DIGEST:]
    return content if stored[:_DIGEST] == _digest(key, content) else None


def save(key: str, content: bytes) -> None:
    """Keep an entry, whole or not at all; where that is not possible, nothing is kept."""
    folder = cache_folder()
    if folder is None:
        return
    path = _path(folder, key)
    beside = path.with_suffix(f".{secrets.token_hex(4)}.tmp")
    with suppress(OSError):
        # Those of processes that were ended while they wrote this entry.
        for draft in folder.glob(f"{path.stem}.*.tmp"):
            draft.unlink(missing_ok=True)
        try:
            beside.write_bytes(_digest(key, content) + content)
            if path.is_dir():
                shutil.rmtree(path)
            os.replace(beside, path)
        finally:
            beside.unlink(missing_ok=True)


def turn(key: str) -> AbstractContextManager[object]:
    """Return a context in which no other process makes the same entry, unless it takes too long."""
    folder = cache_folder()
    return nullcontext() if folder is None else file_lock(_path(folder, key).with_suffix(".lock"), _PATIENCE)


def kept(key: str, make: Callable[[], T]) -> T:
    """Return an object from disk where it was made before, else make it and keep it.

    The key says everything that the object depends on; the object must survive pickling.
    """
    found = _unpickled(load(key))
    if found is not None:
        return found  # type: ignore[return-value]
    with turn(key):
        found = _unpickled(load(key))
        if found is None:
            found = make()
            save(key, pickle.dumps(found))
    return found  # type: ignore[return-value]


def _unpickled(content: bytes | None) -> object | None:
    if content is None:
        return None
    try:
        return pickle.loads(content)
    except Exception:  # what it was made of is no longer there under its name
        return None


@cache
def compiler_versions() -> str:
    """Return the versions of all that writes and compiles code."""
    import sys
    from importlib.metadata import version

    return " ".join([sys.version, *(version(name) for name in ("sympy", "numba", "llvmlite", "numpy"))])


@cache
def source_hash(*rooms: str) -> str:
    """Return a hash of the source of some packages of this one, by name, and of `compiler_versions`."""
    found = hashlib.sha256(compiler_versions().encode())
    folder = Path(__file__).parents[1]
    for path in sorted(p for room in rooms for p in (folder / room).rglob("*") if p.suffix in {".py", ".txt"}):
        found.update(path.relative_to(folder).as_posix().encode() + path.read_bytes())
    return found.hexdigest()
