"""The rig files of measured sets: which there are, and which have their recordings at hand."""

from __future__ import annotations

from pathlib import Path

from discovery_datasets import registry

from discovery.rigs.rig_file import read_rig


def measured_rigs(datasets: Path) -> dict[str, Path]:
    """Return the rig files of all registered sets by name, such as ``emps/rig``, in the order of the registry."""
    folders = dict.fromkeys(name.partition("/")[0] for name in registry.FILES)
    found = [path for folder in folders for path in sorted((datasets / folder).glob("rig*.toml"))]
    return {str(path.relative_to(datasets).with_suffix("")): path for path in found}


def at_hand(datasets: Path) -> tuple[list[str], list[str]]:
    """Return the rigs whose recordings are here, those with the largest files first, and why the others are left out.

    Parameters
    ----------
    datasets : Path
        Folder with a folder for each set.
    """
    states = {s.name: s for s in registry.check()}
    sizes: dict[str, int] = {}
    missing: dict[str, None] = {}
    for name, path in measured_rigs(datasets).items():
        listed = (part.file for parts in read_rig(path).records.values() for part in parts)
        files = {known for file in listed if (known := registry.registered(file))}
        lacking = [states[f] for f in sorted(files) if states[f].state != "ok"]
        if lacking:
            why = ", ".join(f"{s.name} is {s.state}" for s in lacking)
            missing[f"{name.partition('/')[0]} is left out: {why}"] = None
        else:
            sizes[name] = sum(here.stat().st_size for f in files if (here := states[f].path) is not None)
    return sorted(sizes, key=lambda name: -sizes[name]), list(missing)
