"""A campaign whose workers are killed: what is counted, and what a small one leaves."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.scale.__main__ import table
from benchmarks.scale.study import study, values


def of_one_way(**numbers: float) -> dict:
    counts = dict.fromkeys(("lost", "kept_twice", "differing"), 0)
    memory = {"second_tenth": 250.2, "last_tenth": 251.7, "peak": 260.0}
    sizes = {"efficiency": 0.834, "own_cpu_s": 1.0, "work_cpu_s": 80.0, "memory_mib": memory, "worker_peak_mib": 300.4}
    return {"rigs": 100, "kills": 4, "begun": 104, "seconds": 61.2, **counts, **sizes, **numbers}


def test_the_table_has_a_row_for_each_way() -> None:
    content = {
        "processes": of_one_way(),
        "dask": of_one_way(lost=1),
        "workers": 2,
        "page_s": 3.2,
        "cores": 2,
    }
    text = table(content)
    row = "100 | 4 | 104 | {} | 0 | 0 | 61 | 83 % | 1.2 | 250 → 252 | 300 |"
    assert f"| processes of this machine | {row.format(0)}" in text
    assert f"| local Dask cluster | {row.format(1)}" in text
    assert "2 workers on 2 cores; the page over all takes 3 s." in text


def test_what_the_clock_says_is_no_difference() -> None:
    assert values({"verdict": "explained", "cpu": 1.0}) == {"verdict": "explained"}


@pytest.mark.slow
def test_nothing_is_lost_or_done_twice_where_workers_are_killed(tmp_path: Path) -> None:
    content = study(24, 2, 6.0, tmp_path)
    for way in ("processes", "dask"):
        found = content[way]
        assert found["kills"] > 0
        assert (found["lost"], found["kept_twice"], found["differing"]) == (0, 0, 0)
        assert 24 <= found["begun"] <= 24 + 2 * found["kills"]
