"""Cases of damaged, mistaken and odd recordings: cells, tables, times, values."""

from __future__ import annotations

import gzip
import io
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.faults.base import film
from benchmarks.faults.case import Case

FILE = "high.csv"
#: No numbers at all.
WORDS = (
    "abc", "--", "1e999", "0x10", "1_0", "12.3.4", "١٢", "-", "True", "inf", "-inf", "=A1+1", "6.07D+01", "−1.7",
    "\xa060.7", "60.7 deg", "1 2", "1;2", "0,5", "'7'", "$5", "1e", "e5", "00:00:01.5", "2026-01-01", "{}", "[1]", "%s",
    "../../etc", "\x1b[31m", "9" * 5000, "<b>1</b>",
)  # fmt: skip
#: A reading that is missing.
GAPS = ("", "  ", "NaN", "nan", "NULL", "n/a", "#N/A")
#: Places in the file, by row of data.
PLACES = {"first": 0, "middle": 299, "last": 599}


def _cell(row: int, column: int, text: str, folder: Path) -> None:
    lines = (folder / FILE).read_text(encoding="utf-8").splitlines()
    cells = lines[row + 1].split(",")
    cells[column] = text
    lines[row + 1] = ",".join(cells)
    (folder / FILE).write_text("\n".join(lines) + "\n", encoding="utf-8")


def _cells() -> Iterator[Case]:
    for where, row in PLACES.items():
        for column, name in enumerate(("t_s", "angle_deg")):
            for text in WORDS:
                yield Case("cell", f"{name} {where} {text[:20]!r}", partial(_cell, row, column, text), (FILE,))
        for text in GAPS:
            yield Case("empty time", f"{where} {text!r}", partial(_cell, row, 0, text), (FILE, "t_s"))
    for text in GAPS[:3]:
        yield Case("gap", repr(text), partial(_cell, 299, 1, text))
    for text in ("-9999", "999999", "1e9", "1e-300", "1e200"):
        yield Case("sentinel", text, partial(_cell, 299, 1, text))


def _bytes(change: Callable[[bytes], bytes], folder: Path) -> None:
    (folder / FILE).write_bytes(change((folder / FILE).read_bytes()))


def _lines(change: Callable[[list[str]], list[str]], folder: Path) -> None:
    lines = (folder / FILE).read_text(encoding="utf-8").splitlines()
    (folder / FILE).write_text("\n".join(change(lines)) + "\n", encoding="utf-8")


REFUSED_BYTES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda _: b"",
    "zeros": lambda b: bytes(len(b)),
    "a zero byte": lambda b: b[:500] + b"\0" + b[500:],
    "gzip": gzip.compress,
    "executable": lambda _: b"\x7fELF" + bytes(range(256)) * 20,
    "a page": lambda _: b"<!DOCTYPE html><html><body>404 not found</body></html>\n" * 60,
    "JSON": lambda _: b'{"t_s": [0, 1], "angle_deg": [1, 2]}\n',
    "a pointer of LFS": lambda _: b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n",
    "noise": lambda _: np.random.default_rng(0).bytes(5000),
    "cut off in the header": lambda b: b[:3],
    "a quote": lambda b: b.replace(b"\n", b'\n"', 50),
}
SOUND_BYTES: dict[str, Callable[[bytes], bytes]] = {
    "byte order mark": lambda b: b"\xef\xbb\xbf" + b,
    "CR LF": lambda b: b.replace(b"\n", b"\r\n"),
    "semicolons": lambda b: b.replace(b",", b";"),
    "tabs": lambda b: b.replace(b",", b"\t"),
    "commas in numbers": lambda b: b.replace(b",", b";").replace(b".", b","),
    "spaces in the header": lambda b: b.replace(b"t_s,angle_deg", b" t_s , angle_deg "),
    "a comment": lambda b: b"# the film of Monday\n" + b,
    "a comment in Latin-1": lambda b: b"# der Film, Winkel in \xb0\n" + b,
    "UTF-16": lambda b: b.decode().encode("utf-16"),
    "UTF-16 without mark": lambda b: b.decode().encode("utf-16-le"),
    "the header a comment": lambda b: b"# " + b,
}
REFUSED_LINES: dict[str, Callable[[list[str]], list[str]]] = {
    "no header": lambda x: x[1:],
    "two headers": lambda x: [x[0], "s,deg", *x[1:]],
    "the header again": lambda x: [*x[:300], x[0], *x[300:]],
    "a column twice": lambda x: ["t_s,t_s", *x[1:]],
    "another column": lambda x: ["t_s,angel_deg", *x[1:]],
    "capitals": lambda x: ["T_S,ANGLE_DEG", *x[1:]],
    "columns exchanged": lambda x: ["angle_deg,t_s", *x[1:]],
    "only the header": lambda x: x[:1],
    "one row": lambda x: x[:2],
    "forty rows": lambda x: x[:41],
    "a cell too many": lambda x: [*x[:100], x[100] + ",5", *x[101:]],
    "a footer": lambda x: [*x, "END OF FILE,"],
    "a mean": lambda x: [*x, "mean,12.0"],
    "backwards": lambda x: [x[0], *x[:0:-1]],
    "a row twice": lambda x: [*x[:100], x[100], *x[100:]],
    "two rows exchanged": lambda x: [*x[:100], x[101], x[100], *x[102:]],
    "twice over": lambda x: [*x, *x[1:]],
    "one column": lambda x: [line.split(",")[0] for line in x],
    "shuffled": lambda x: [x[0], *np.random.default_rng(0).permutation(x[1:]).tolist()],
}


def _table(change: Callable[[pd.DataFrame], pd.DataFrame | None], folder: Path) -> None:
    table = pd.read_csv(folder / FILE)
    changed = change(table)
    (table if changed is None else changed).to_csv(folder / FILE, index=False)


def _set(column: str, rows: slice, value: object) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def change(table: pd.DataFrame) -> pd.DataFrame:
        values = table[column].to_numpy().copy()
        values[rows] = value
        return table.assign(**{column: values})

    return change


def _scaled(column: str, factor: float, offset: float = 0.0) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{column: factor * table[column] + offset})


#: Must be refused.
TIMES: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    **{f"times {factor:g}": _scaled("t_s", factor) for factor in (1e-300, 1e-3, 1 / 60, 0.1, 60.0, 1e3, 1e70, 1e300)},
    "all zero": _scaled("t_s", 0.0),
    "negative": _scaled("t_s", -1.0),
    "numbered": lambda x: x.assign(t_s=np.arange(len(x))),
    "rounded to seconds": lambda x: x.assign(t_s=x["t_s"].round()),
    "a jump of a day": lambda x: x.assign(t_s=x["t_s"] + 86400.0 * (x.index >= 300)),
    "a jump of a year": lambda x: x.assign(t_s=x["t_s"] + 3.15e7 * (x.index >= 300)),
    "six digits since 1970": lambda x: x.assign(t_s=(1.7e9 + x["t_s"]).map("{:.5e}".format)),
}
#: Must be refused, or told.
VALUES: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    **{f"angle times {factor:g}": _scaled("angle_deg", factor) for factor in (1e-200, 1e-6, 1e6, 1e150, 1e307)},
    "angle in rad": _scaled("angle_deg", np.pi / 180),
    "all zero": _scaled("angle_deg", 0.0),
    "all five": _scaled("angle_deg", 0.0, 5.0),
    "white noise": lambda x: x.assign(angle_deg=20 * np.random.default_rng(0).standard_normal(len(x)).round(4)),
    "the time": lambda x: x.assign(angle_deg=x["t_s"]),
    "stuck": _set("angle_deg", slice(200, 260), 12.0),
    "zeros": _set("angle_deg", slice(200, 600, 37), 0.0),
    "saturated": lambda x: x.assign(angle_deg=x["angle_deg"].clip(-40.0, 40.0)),
    "a third missing": _set("angle_deg", slice(200, 400), np.nan),
    "all but forty missing": _set("angle_deg", slice(40, 600), np.nan),
    "all missing": _set("angle_deg", slice(0, 600), np.nan),
    "a spike": _set("angle_deg", slice(300, 301), 80.0),
    "-9999 for what was lost": _set("angle_deg", slice(100, 500, 50), -9999.0),
    "rows lost": lambda x: x.drop(index=range(200, 240)),
}


def _others() -> Iterator[Case]:
    for name, change in REFUSED_BYTES.items():
        yield Case("file", name, partial(_bytes, change), (FILE,))
    for name, change in SOUND_BYTES.items():
        yield Case("way of writing", name, partial(_bytes, change))
    for name, lines in REFUSED_LINES.items():
        yield Case("table", name, partial(_lines, lines), (FILE,))
    for name, table in TIMES.items():
        yield Case("time", name, partial(_table, table), (FILE, "t_s"))
    for name, table in VALUES.items():
        yield Case("value", name, partial(_table, table), (FILE,))


def _held(change: Callable[[pd.DataFrame], pd.DataFrame], folder: Path) -> None:
    """Hold out a training recording with a change."""
    change(pd.read_csv(folder / FILE)).to_csv(folder / "middle.csv", index=False)


def _noisy(size: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda x: x.assign(angle_deg=x["angle_deg"] + size * np.random.default_rng(1).standard_normal(len(x)))


COPIES: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "itself": lambda x: x,
    "a part of it": lambda x: x.iloc[200:400],
    "shifted by a row": lambda x: x.assign(angle_deg=x["angle_deg"].shift(1)).dropna(),
    "shifted by a row, the other way": lambda x: x.assign(angle_deg=x["angle_deg"].shift(-1)).dropna(),
    "shifted by seven rows": lambda x: x.assign(angle_deg=x["angle_deg"].shift(7)).dropna(),
    "later": _scaled("t_s", 1.0, 100.0),
    "a thousandth of a degree of noise": _noisy(1e-3),
    "rounded": lambda x: x.round({"angle_deg": 2}),
}


def _unit(unit: str, factor: float, folder: Path) -> None:
    """Declare another unit than that of the readings, and no noise, which would give it away."""
    text = (folder / "rig.toml").read_text(encoding="utf-8")
    (folder / "rig.toml").write_text(text.replace('unit = "deg", noise = 0.2', f'unit = "{unit}"'), encoding="utf-8")
    for file in ("high.csv", "low.csv", "middle.csv"):
        _scaled("angle_deg", factor)(pd.read_csv(folder / file)).to_csv(folder / file, index=False)


#: Unit that is declared, and the factor from degrees to the readings. A factor that is no unit is not tried: readings
#: of half the scale are those of a pendulum with a softening spring.
UNITS = {
    "radians as degrees": ("deg", np.pi / 180),
    "degrees as mrad": ("mrad", 1.0),
    "degrees as radians": ("rad", 1.0),
    "mrad as degrees": ("deg", np.pi / 0.18),
    "turns as radians": ("rad", 1 / 360),
    "gon as degrees": ("deg", 10 / 9),
}


def _parquet(folder: Path) -> list[str]:
    table = film(60.0, 60)
    table["t_s"] = pd.to_timedelta(table["t_s"], unit="s")
    table.to_parquet(folder / "high.parquet")
    return ["loop", "rig.toml", "--train", "high.parquet", "--out", "out"]


def _named(name: str, folder: Path) -> list[str]:
    (folder / FILE).rename(folder / f"{name}.csv")
    return ["loop", "rig.toml", "--train", f"{name}.csv", "--holdout", "middle.csv", "--out", "out"]


def _format(suffix: str, folder: Path) -> list[str]:
    buffer = io.BytesIO(np.random.default_rng(2).bytes(2000))
    (folder / f"high{suffix}").write_bytes(buffer.getvalue())
    return ["loop", "rig.toml", "--train", f"high{suffix}", "--out", "out"]


def recordings() -> Iterator[Case]:
    """Return every case of this kind."""
    yield from _cells()
    yield from _others()
    for name, change in COPIES.items():
        yield Case("hold-out that is training", name, partial(_held, change), ("middle",))
    for name, (unit, factor) in UNITS.items():
        yield Case("unit", name, partial(_unit, unit, factor))
    yield Case("unit", "another but right", partial(_unit, "rad", np.pi / 180))
    yield Case("format", "durations in Parquet", _parquet, ("high.parquet",))
    for name in ("Infinity", "NaN", "null", "a b", "%s{0}"):
        yield Case("name", name, partial(_named, name))
    for suffix in (".parquet", ".mat", ".h5", ".hdf5", ".xlsx", ".gz", ""):
        yield Case("format", f"noise as '{suffix}'", partial(_format, suffix), (f"high{suffix}",))
