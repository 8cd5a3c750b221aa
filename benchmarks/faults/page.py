"""The page that holds the tables of these studies."""

from __future__ import annotations

import re
from pathlib import Path

from discovery.foundation.io import atomic_write


def put(page: Path, name: str, text: str) -> None:
    """Write a text between the marks ``<!-- name: ... -->`` and ``<!-- end of name -->`` of a page."""
    begin, end = re.compile(rf"<!-- {name}: [^>]*-->\n"), f"<!-- end of {name} -->"
    content = page.read_text(encoding="utf-8")
    found = begin.search(content)
    if found is None or end not in content[found.end() :]:
        raise ValueError(f"{page} has no place for {name}")
    after = content.index(end, found.end())
    with atomic_write(page) as draft:
        draft.write_text(f"{content[: found.end()]}{text.rstrip()}\n{content[after:]}", encoding="utf-8")
