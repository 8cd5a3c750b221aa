"""A bounded memory for each process."""

from __future__ import annotations

import resource

MEMORY = 8 << 30  # bytes a process may use: what needs more is one failed case


def limit_memory() -> None:
    """Let this process have so much memory and no more."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))
