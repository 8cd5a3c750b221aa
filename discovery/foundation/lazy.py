"""Public names of a package that load what they need when they are first used."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

__all__ = ["lazy_names"]


def lazy_names(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a package (PEP 562).

    Parameters
    ----------
    package : str
        Its ``__name__``.
    homes : mapping of str to str
        ``"module:attribute"`` of every public name. A name never equals a module's of the package, which would hide it
        once that module is imported.
    """

    def get(name: str) -> Any:
        if name not in homes:
            from discovery.foundation.errors import suggestion

            raise AttributeError(f"module {package!r} has no attribute {name!r}.{suggestion(name, homes)}", name=name)
        home, _, attribute = homes[name].partition(":")
        value = getattr(import_module(home), attribute)
        setattr(sys.modules[package], name, value)
        return value

    def names() -> list[str]:
        return sorted({*(n for n in vars(sys.modules[package]) if n.startswith("__")), *homes})

    return get, names
