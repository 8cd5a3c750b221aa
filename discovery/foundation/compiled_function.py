"""Functions compiled once: kept on disk with their hash, whatever folder their source lies in."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import numba
from numba.core import caching, compiler, serialize

from discovery.foundation import disk_cache


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that compiles a function as ``numba.njit`` does, at its first call, and keeps it on disk."""

    def decorate(function: Callable[..., Any]) -> Any:
        return keep_compiled(numba.njit(**options)(function))

    return decorate


def keep_compiled(dispatcher: Any, stamp: str | None = None) -> Any:
    """Keep on disk what the compiler makes of a function from ``numba.njit``, and return the function.

    The stamp is a hash of everything that is compiled; that of the whole package by default.
    """
    dispatcher._cache = _Kept(dispatcher.py_func, stamp)
    return dispatcher


class _Kept(caching._Cache):
    """The compiler's view of what is kept of one function.

    The compiler's own cache lies beside the source, or fails where that folder is read-only; it unpickles whatever
    lies there, and damage to it is a traceback.
    """

    def __init__(self, function: Callable[..., Any], stamp: str | None) -> None:
        self._function, self._stamp = function, stamp
        self._enabled, self._turn = True, ExitStack()

    @property
    def cache_path(self) -> str | None:
        folder = disk_cache.cache_folder()
        return None if folder is None else str(folder)

    def enable(self) -> None:
        self._enabled = True

    def disable(self) -> None:
        self._enabled = False

    def flush(self) -> None:
        """Leave what is kept: its key says all that it depends on."""

    def _key(self, signature: Any, codegen: Any) -> str:
        """Return everything that the machine code depends on: source, types and processor."""
        name = f"{self._function.__module__}.{self._function.__qualname__}"
        return repr((name, self._stamp or disk_cache.source_hash(), str(signature), codegen.magic_tuple()))

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        # One that failed to compile has not given its turn back.
        self._turn.close()
        if not self._enabled:
            return None
        target_context.refresh()
        key = self._key(sig, target_context.codegen())
        found = self._rebuilt(key, target_context)
        if found is None:
            self._turn.enter_context(disk_cache.turn(key))
            # Another process may have compiled it meanwhile.
            found = self._rebuilt(key, target_context)
            if found is not None:
                self._turn.close()
        return found

    def _rebuilt(self, key: str, target_context: Any) -> Any:
        content = disk_cache.load(key)
        return None if content is None else compiler.CompileResult._rebuild(target_context, *pickle.loads(content))

    def save_overload(self, sig: Any, cres: Any) -> None:
        with self._turn:
            if self._enabled and not cres.lifted and not cres.library.has_dynamic_globals:
                disk_cache.save(self._key(sig, cres.codegen), serialize.dumps(cres._reduce()))
