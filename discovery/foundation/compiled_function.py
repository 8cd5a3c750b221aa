"""Functions compiled once: kept on disk with their hash, whatever folder their source lies in."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cached_property
from inspect import getclosurevars, getsource
from types import ModuleType
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

    The stamp is a hash of everything that is compiled; by default that of the function's text, and of what it names.
    """
    dispatcher._cache = _Kept(dispatcher, stamp)
    return dispatcher


def text_hash(dispatcher: Any) -> str:
    """Return a hash of the text of a function from ``numba.njit``, of what it names, and of what compiles it.

    An edit of anything else leaves what is kept of it.
    """
    return hashlib.sha256("\n".join([disk_cache.compiler_versions(), *_texts(dispatcher, set())]).encode()).hexdigest()


def _texts(dispatcher: Any, known: set[Any]) -> Iterator[str]:
    """Yield how a function is compiled, its text, and what its names stand for."""
    known.add(dispatcher)
    function, options = dispatcher.py_func, dispatcher.targetoptions
    yield repr([(k, sorted(v) if isinstance(v, set) else v) for k, v in sorted(options.items())])
    yield getsource(function)
    named = getclosurevars(function)
    for name, value in sorted({**named.globals, **named.nonlocals}.items()):
        if not hasattr(value, "py_func"):
            # A library is that of its version.
            yield f"{name} = {value.__name__ if isinstance(value, ModuleType) else value!r}"
        elif value not in known:
            yield from _texts(value, known)


class _Kept(caching._Cache):
    """The compiler's view of what is kept of one function.

    The compiler's own cache lies beside the source, or fails where that folder is read-only; it unpickles whatever
    lies there, and damage to it is a traceback.
    """

    def __init__(self, dispatcher: Any, stamp: str | None) -> None:
        self._dispatcher, self._given = dispatcher, stamp
        self._enabled, self._turn = True, ExitStack()

    @cached_property
    def _stamp(self) -> str:
        return self._given or text_hash(self._dispatcher)

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
        function = self._dispatcher.py_func
        name = f"{function.__module__}.{function.__qualname__}"
        return repr((name, self._stamp, str(signature), codegen.magic_tuple()))

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
