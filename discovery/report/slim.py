"""Figures as light as a page needs them: paths in tenths of a point, pictures in as many colours as they show."""

from __future__ import annotations

import io
import re

#: Colours of a picture of lines and text, their blends with the paper included.
_COLOURS = 40
_PATH = re.compile(r' d="([^"]+)"')
_STEP = re.compile(r"([MLQCz])([^MLQCz]*)")
#: Units of a path in a point: a tenth of a point is finer than a line is wide.
_GRAIN = 10
_PLACE = re.compile(r'( [xy]="-?\d+\.\d)\d+"')
#: Letters of a path that is a curve, not a marker or a frame.
_CURVE = 120


def slim_svg(text: str) -> str:
    """Return a drawing of matplotlib with its curves as steps in tenths of a point; small shapes, as markers, stay."""
    drawn = _PATH.sub(lambda m: f' d="{_steps(m[1])}"' if len(m[1]) > _CURVE else m[0], text)
    return _PLACE.sub(r'\1"', drawn)


def slim_png(content: bytes) -> bytes:
    """Return a picture of lines and text with a palette, which a plot needs no more than."""
    from PIL import Image

    picture = Image.open(io.BytesIO(content)).convert("RGB")
    small = picture.quantize(_COLOURS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    buffer = io.BytesIO()
    small.save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()


def _steps(path: str) -> str:
    """Return a path of lines with each point as its distance from the last one; other paths unchanged."""
    at = (0, 0)
    written = []
    for command, numbers in _STEP.findall(path):
        if command in "QC":
            return path
        if command == "z":
            written.append("z")
            continue
        x, y = (round(_GRAIN * float(v)) for v in numbers.split())
        if command == "M":
            written.append(f"M{_plain(x)} {_plain(y)}")
        elif (x, y) != at:
            written.append(f"l{_plain(x - at[0])} {_plain(y - at[1])}")
        at = (x, y)
    return "".join(written)


def _plain(tenths: int) -> str:
    return f"{tenths / _GRAIN:.1f}".removesuffix(".0")
