"""How much of what an effect moves its law leaves: ``python -m benchmarks.blind.laws OUT...``.

Of cases without planted model errors whose effects were all named, and nothing else: the model error after, beyond what
counts as none, over how far the effects moved it. It is what `LoopSettings.law` and `law_arm` state. OUT holds the
runs of `benchmarks.blind.run`, or those of `benchmarks.systems`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from discovery.results.provenance import read_json
from discovery.selection.settings import LoopSettings


def share_left(found: dict[str, Any], channels: int) -> float | None:
    """Return the model error after, beyond what counts as none, over its movement; None where nothing moved."""
    before, after = found["model_error"]["before"], found["model_error"]["after"]
    if not all(isinstance(v, float) and np.isfinite(v) for v in (before, after)) or not before > after:
        return None
    floor = 2 * LoopSettings().error_scale * found["errors"]["noise_floor"] / np.sqrt(channels)
    return float(np.sqrt(max(after**2 - floor**2, 0.0) / (before**2 - after**2)))


def blind(out: Path) -> Iterator[float | None]:
    """Yield the shares of blind cases."""
    for path in sorted(out.glob("results/*/loop.json")):
        truth = read_json(out / "truth" / f"{path.parent.name}.json")
        named = [e["id"] for e in read_json(path)["effects"] if e["evidence"]]
        sought = [set(e["accepted"]) for e in truth["effects"]]
        right = len(named) == len(sought) and all(s.intersection(named) for s in sought)
        if sought and right and not truth.get("model_errors"):
            yield share_left(read_json(path), 2 if truth.get("system", "arm") == "arm" else 1)


def systems(out: Path) -> Iterator[float | None]:
    """Yield the shares of machines that were explained."""
    for path in sorted(out.glob("cases/*/loop/loop.json")):
        found = read_json(path)
        if found["verdict"] == "explained" and found["effects"]:
            yield share_left(found, 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, nargs="+")
    for out in parser.parse_args().out:
        shares = [s for s in (*blind(out), *systems(out)) if s is not None]
        if shares:
            middle, ninety, more, most = np.quantile(shares, [0.5, 0.9, 0.95, 1.0])
            print(
                f"{out}: {len(shares)} cases, median {middle:.4f}, 90 % {ninety:.4f}, 95 % {more:.4f}, most {most:.4f}"
            )


if __name__ == "__main__":
    main()
