"""Functions compiled on their first call, and kept on disk where that is possible."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that compiles a function; it is kept on disk unless every place for it is read-only.

    Parameters
    ----------
    **options
        Those of ``numba.njit``, without `cache`.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        try:
            return numba.njit(cache=True, **options)(function)
        except RuntimeError:  # neither the folder of the source nor that of the user can be written
            return numba.njit(**options)(function)

    return decorate
