"""From the folder of a finished run to the files that a user takes along."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from discovery.equations.model import Model
from discovery.export.c_source import to_c
from discovery.export.feed_forward import FeedForward, feed_forward_c, feed_forward_csv
from discovery.export.fitted import FittedModel
from discovery.export.fmu import to_fmu
from discovery.export.json_file import to_json
from discovery.export.latex import to_latex
from discovery.export.linear import LinearModel
from discovery.export.linear_file import linear_to_json, linear_to_python
from discovery.export.source import to_numpy
from discovery.export.sympy_file import to_sympy_file
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.io import atomic_write
from discovery.results.manifest import check_whole
from discovery.results.provenance import read_json


@dataclass(frozen=True)
class Format:
    """Names of the files of a format, and what returns the content of each for a model."""

    files: tuple[str, ...]
    write: Callable[[FittedModel], tuple[str | bytes, ...]]

    @classmethod
    def of(cls, file: str, write: Callable[[FittedModel], str | bytes]) -> Format:
        """Return a format of one file."""
        return cls((file,), lambda found: (write(found),))


#: Calls the C from Python; the same for every model.
_PYTHON = Path(__file__).with_name("c_python.txt")
#: Every format by its name.
FORMATS: dict[str, Format] = {
    "sympy": Format.of("model_sympy.py", to_sympy_file),
    "latex": Format.of("model.tex", to_latex),
    "numpy": Format.of("model.py", to_numpy),
    "json": Format.of("model.json", to_json),
    "c": Format(
        ("model.h", "model.c", "model_c.py"), lambda found: (*to_c(found), _PYTHON.read_text(encoding="utf-8"))
    ),
    "fmu": Format.of("model.fmu", to_fmu),
}


def read_fitted(folder: Path, what: str = "after") -> FittedModel:
    """Return a model of a finished run or loop, declared and refitted ("before") or final ("after").

    InputError if the folder is none, or holds no such model.
    """
    if not folder.is_dir():
        raise InputError(
            f"There is no folder {folder}; name the one that `discovery run` or `discovery loop` wrote with --out."
        )
    path = next((folder / n for n in ("results.json", "loop.json") if (folder / n).exists()), None)
    if path is None:
        raise InputError(
            f"{folder} holds no results.json and no loop.json; make one with `discovery run` or `discovery loop`."
        )
    content = read_json(path)
    if path.name == "results.json" and isinstance(content, dict):
        check_whole(folder, content)
    try:
        failed, described = (content.get("loop") or content).get("failure"), content.get("models")
        found = None if failed or described is None else FittedModel.from_dict(described[what])
    except (InputError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path} cannot be read ({error!r}). Run it again.") from None
    if failed:
        raise InputError(f"{path} holds no model: the declared one has no fit. The page says what would help.")
    if found is None:
        raise InputError(f"{path} does not hold its models: it was written by an earlier version. Make it again.")
    revision = content.get("provenance", {}).get("git_revision")
    return replace(found, provenance={**found.provenance, "git_revision": revision}) if revision else found


def export_model(found: FittedModel, out: Path, formats: Sequence[str] = tuple(FORMATS)) -> list[Path]:
    """Write a model in some `FORMATS` to a folder, and return the files; InputError for none, or an unknown one."""
    if not formats:
        raise InputError(f"No format is named; name some of {', '.join(FORMATS)}.")
    unknown = [f for f in formats if f not in FORMATS]
    if unknown:
        raise InputError(f"There is no format {', '.join(unknown)}; there are {', '.join(FORMATS)}.")
    # All texts before the first file: a model that one format refuses leaves nothing behind.
    chosen = [FORMATS[f] for f in dict.fromkeys(formats)]
    contents = [(out / name, c) for f in chosen for name, c in zip(f.files, f.write(found), strict=True)]
    return _written(contents, out)


def _written(contents: Sequence[tuple[Path, str | bytes]], out: Path) -> list[Path]:
    out.mkdir(parents=True, exist_ok=True)
    for path, content in contents:
        with atomic_write(path) as temporary:
            Path(temporary).write_bytes(content.encode() if isinstance(content, str) else content)
    return [path for path, _ in contents]


def read_draws(folder: Path, model: Model) -> dict[str, FloatArray] | None:
    """Return the draws of the posterior in a folder by parameter; None where there is none of this very model."""
    path = folder / "posterior.nc"
    if not path.is_file():
        return None
    from discovery.posterior.draws import Posterior

    found = Posterior.from_netcdf(path)
    if (found.model.base, found.model.effects) != (model.base, model.effects):
        return None
    return {n: found.draws[..., k].ravel() for k, n in enumerate(found.names)}


def export_linear(linear: LinearModel, source: FittedModel, out: Path) -> list[Path]:
    """Write a linear model and where it comes from as Python and JSON to a folder, and return the files."""
    texts = [(out / "linear.py", linear_to_python(linear, source)), (out / "linear.json", linear_to_json(linear))]
    return _written(texts, out)


def export_feed_forward(found: FeedForward, source: FittedModel, out: Path) -> list[Path]:
    """Write the tables of a feed-forward as CSV and as a C header to a folder, and return the files."""
    texts = [
        (out / "feed_forward.csv", feed_forward_csv(found)),
        (out / "feed_forward.h", feed_forward_c(found, source)),
    ]
    return _written(texts, out)
