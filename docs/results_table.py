"""Write the table of results into the README from the result files: ``python docs/results_table.py REPORTS README.md``.

The table stands between two marks and holds nothing that is typed by hand but what was hidden in each recording.
"""

from __future__ import annotations

import sys
from pathlib import Path

from discovery.report.numbers import uncertain
from discovery.results.judging import held_group
from discovery.results.provenance import read_json

BEGIN, END = "<!-- results: written by `make docs` -->", "<!-- end of results -->"
#: What the makers of each set of recordings hid in it; for a measurement, what is known of the system.
HIDDEN = {
    "arm": "nothing: the arm's own mechanics",
    "arm_coulomb": "dry friction of 0.6 mN, f_c = 0.01285 s⁻²",
    "arm_delay": "a camera 10 ms late",
    "arm_tilt": "a table tilted by -1.5 and 2.0 mrad",
    "silverbox": "measured circuit, declared linear",
}


def _effect(effect: dict) -> str:
    parameters = effect["parameters"].items()
    values = [f"{name} = {uncertain(p['value'], p['sd'])} {p['unit']}".rstrip() for name, p in parameters]
    rivals = "".join(f" or `{rival}`" for rival in effect.get("ambiguous_with", ()))
    return f"`{effect['id']}`" + (f" ({', '.join(values)})" if values else "") + rivals


def _errors(result: dict, which: str) -> str:
    errors = result["errors"]
    before, after = (errors[when].get(which) for when in ("before", "after"))
    if before is None:
        return ""
    unit = {"m": "mm", "V": "mV"}[errors["unit"]]
    measure = "mean" if unit == "mm" else "rms"
    return f"{1e3 * before[measure]:.2f} → {1e3 * after[measure]:.3f} {unit} {measure}"


def table(reports: Path, before: str = "") -> str:
    """Return the table in the order of `HIDDEN`; a run that is not there keeps its row of the table before, if any."""
    rows = {name: line for line in before.splitlines() for name in HIDDEN if line.startswith(f"| `{name}` |")}
    lines = [
        "| recordings | hidden in them | verdict | added | held out, before → after | beyond the trained deflection |",
        "|---|---|---|---|---|---|",
    ]
    for name, hidden in HIDDEN.items():
        path = reports / name / "loop.json"
        if not path.exists():
            lines += [rows[name]] if name in rows else []
            continue
        result = read_json(path)
        added = ", ".join(map(_effect, result["effects"])) or "nothing"
        cells = [f"`{name}`", hidden, result["verdict"], added, _errors(result, held_group(result["errors"]))]
        lines.append(f"| {' | '.join([*cells, _errors(result, 'holdout_outside')])} |")
    return "\n".join(lines)


def insert(readme: str, content: str) -> str:
    """Return the README with the table between its marks."""
    head, _, rest = readme.partition(BEGIN)
    _, _, tail = rest.partition(END)
    return f"{head}{BEGIN}\n{content}\n{END}{tail}"


def main() -> None:
    """Write the table."""
    readme = Path(sys.argv[2])
    text = readme.read_text(encoding="utf-8")
    before = text.partition(BEGIN)[2].partition(END)[0]
    readme.write_text(insert(text, table(Path(sys.argv[1]), before)), encoding="utf-8")


if __name__ == "__main__":
    main()
