"""Locks between processes: the system frees them when their process ends, however it ends, so none is ever stale."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

#: Seconds between two attempts.
_PAUSE = 0.05


def _acquire(descriptor: int) -> bool | None:
    """Lock an open file or folder; False where another process holds it, None where nothing can be locked here."""
    try:
        import fcntl
    except ImportError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return None
    return True


@contextmanager
def folder_lock(folder: Path) -> Iterator[bool]:
    """Hold a folder while the block runs; nothing is written into it.

    Yields False where another process, or another block of this one, holds it. Where the system knows no such locks,
    the folder counts as held by nobody.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:
        yield True
        return
    try:
        yield _acquire(descriptor) is not False
    finally:
        os.close(descriptor)


@contextmanager
def file_lock(path: Path, patience: float) -> Iterator[bool]:
    """Hold a lock file while the block runs; it is removed in the end. Whether it is there already does not matter.

    Yields False where another process did not finish in so many seconds, or nothing can be locked here: the block runs
    all the same.
    """
    descriptor, end = None, time.monotonic() + patience
    while descriptor is None:
        try:
            opened = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        except OSError:
            break
        taken = _acquire(opened)
        # Whoever held it before has removed the file, so that this one may be no longer the one of that name.
        if taken and _is_at(opened, path):
            descriptor = opened
            continue
        os.close(opened)
        if taken is None or time.monotonic() > end:
            break
        if not taken:
            time.sleep(_PAUSE)
    try:
        yield descriptor is not None
    finally:
        if descriptor is not None:
            with suppress(OSError):
                path.unlink()
            os.close(descriptor)


def _is_at(descriptor: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    except OSError:
        return False
