"""The encoding of text files: told by their mark, or by their bytes."""

from __future__ import annotations

import codecs
import re

#: A mark at the begin says the encoding.
_MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
#: What no text holds: a file with it is of another kind.
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1a\x1c-\x1f\x7f\ufffe\uffff]")
#: Windows-1252 holds all signs of Latin-1, and has others where that has control characters.
_WESTERN = "cp1252"
#: A table holds letters and digits, each with a zero byte beside it in UTF-16: most characters at least.
_MOST = 0.9


def decoded(content: bytes) -> tuple[str, str] | None:
    """Return the text of a file, and the encoding where that is a guess; None for a file that is no text.

    A mark at its begin says its encoding. Without one it is UTF-8 where its bytes are that, UTF-16 where nearly every
    other byte is zero, and Windows-1252 otherwise, of which Latin-1 is a part.

    Examples
    --------
    >>> decoded("angle_°".encode("latin-1"))
    ('angle_°', 'Windows-1252')
    >>> decoded("angle_°".encode())
    ('angle_°', '')
    """
    known = next((encoding for mark, encoding in _MARKS.items() if content.startswith(mark)), "")
    wide = "" if known else _without_mark(content)
    for encoding, guess in ((known or wide or "utf-8", "UTF-16" if wide else ""), (_WESTERN, "Windows-1252")):
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        return None if _CONTROL.search(text) else (text, guess)
    return None


def _without_mark(content: bytes) -> str:
    """Return the order of bytes of UTF-16 without a mark; empty where it is none."""
    size = len(content) // 2
    for first, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        if size and content[first::2].count(0) >= _MOST * size and content[1 - first :: 2].count(0) == 0:
            return encoding
    return ""
