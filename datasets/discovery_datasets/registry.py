"""Public measured data of other laboratories: where each file comes from, and where it lies here.

No measurement is part of this project. A file is looked for in the folders that the environment variable DISCOVERY_DATA
names, separated as in PATH, then in the user's cache; `fetch` downloads it, when asked. Its SHA-256 decides whether it
is the right one. Names of files repeat across sets: a file is known by its folder and name.
"""

from __future__ import annotations

import hashlib
import io
import os
import tomllib
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Literal
from urllib.parse import quote

from platformdirs import user_cache_dir

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer as Buffer

VARIABLE = "DISCOVERY_DATA"
#: Bytes that a download may have.
LARGEST = 500_000_000
#: Seconds in which a server must answer.
_PATIENCE = 30.0


class DataUnavailable(Exception):
    """A measured file is not here, or is not the registered one; the message says what to do."""


@dataclass(frozen=True)
class MeasuredFile:
    """One file of public measured data.

    Attributes
    ----------
    name : str
        Folder and file name, as ``folder/file``.
    repository, commit, path : str
        Origin on GitHub; `path` is that of the original where the file was derived from it. The commit is HEAD where
        nobody recorded it.
    sha256 : str
        Hash of the file, hexadecimal.
    measured : str
        What was measured, and the columns.
    citation, licence : str
        Whom to cite, and the licence as stated at the origin.
    derived : str
        How the file was made from the original; empty where it is the original.
    """

    name: str
    repository: str
    commit: str
    path: str
    sha256: str
    measured: str
    citation: str
    licence: str
    derived: str = ""

    @property
    def url(self) -> str:
        """Address of the original file."""
        return f"https://raw.githubusercontent.com/{self.repository}/{self.commit}/{quote(self.path)}"


@dataclass(frozen=True)
class FileState:
    """Whether a registered file is here: `state` is ``ok``, ``absent`` or ``altered``, `path` where it was found."""

    name: str
    state: Literal["ok", "absent", "altered"]
    path: Path | None


def _read_table() -> dict[str, MeasuredFile]:
    table = tomllib.loads(files(__package__).joinpath("measured.toml").read_text(encoding="utf-8"))
    return {name: MeasuredFile(name=name, **fields) for name, fields in table.items()}


FILES: dict[str, MeasuredFile] = _read_table()
"""Every registered file by name."""


def entry_of(name: str) -> MeasuredFile:
    """Entry of that name; the file name alone is enough where one set has it.

    Raises
    ------
    DataUnavailable
        If no file is registered under it, or several are.
    """
    found = [entry for entry in FILES.values() if name in (entry.name, Path(entry.name).name)]
    if not found:
        raise DataUnavailable(f"no measured file is registered as {name!r}; known are {', '.join(FILES)}")
    if len(found) > 1:
        names = " and ".join(entry.name for entry in found)
        raise DataUnavailable(f"several measured files are called {name!r}: {names}. Give the folder too")
    return found[0]


def registered(path: Path) -> str | None:
    """Name of the registered file that a path means, by its folder and file name; None where it means none."""
    name = "/".join(path.absolute().parts[-2:])
    return name if name in FILES else None


def card(name: str) -> str:
    """Card of a set, with origin and SHA-256 of its files; the name of the set or of one of its files.

    Raises
    ------
    DataUnavailable
        If nothing is registered under that name.
    """
    folder = name if any(key.startswith(f"{name}/") for key in FILES) else entry_of(name).name.partition("/")[0]
    words = Path(__file__).parents[1] / folder / "CARD.md"
    entries = [entry for entry in FILES.values() if entry.name.startswith(f"{folder}/")]
    # Where only the packages are installed, the registry has to do.
    parts = [words.read_text(encoding="utf-8")] if words.is_file() else []
    for entry in entries:
        parts.append(
            f"{entry.name}: {entry.measured}\n    cite     {entry.citation}\n    licence  {entry.licence}\n"
            f"    origin   {entry.url}{f' ({entry.derived})' if entry.derived else ''}\n    SHA-256  {entry.sha256}\n"
        )
    return "\n".join(parts)


def cache_folder() -> Path:
    """Folder that receives downloads."""
    return Path(user_cache_dir("discovery")) / "measured"


def data_folders() -> list[Path]:
    """Folders that the environment variable names, in its order."""
    return [Path(folder) for folder in os.environ.get(VARIABLE, "").split(os.pathsep) if folder]


def _folders() -> list[Path]:
    return [*data_folders(), cache_folder()]


def state_of(name: str) -> FileState:
    """Where a registered file lies and whether its hash is right; the first sound copy wins.

    Raises
    ------
    DataUnavailable
        If no file is registered under that name.
    """
    entry = entry_of(name)
    copies = [folder / entry.name for folder in _folders() if (folder / entry.name).is_file()]
    for path in copies:
        if hashlib.sha256(path.read_bytes()).hexdigest() == entry.sha256:
            return FileState(entry.name, "ok", path)
    return FileState(entry.name, "altered", copies[0]) if copies else FileState(entry.name, "absent", None)


def check() -> list[FileState]:
    """State of every registered file."""
    return [state_of(name) for name in FILES]


def locate(name: str) -> Path:
    """Path of a registered file.

    Raises
    ------
    DataUnavailable
        If it is not registered, not here, or not the registered one.
    """
    entry, state = entry_of(name), state_of(name)
    if state.state == "ok" and state.path is not None:
        return state.path
    found = f"the copy at {state.path} has another SHA-256" if state.path else "there is no copy"
    remedy = "" if entry.derived else f", or run `discovery data fetch {entry.name}`"
    raise DataUnavailable(
        f"measured file {entry.name} is unavailable: {found} (looked in {', '.join(map(str, _folders()))}). "
        f"Set {VARIABLE} to the folder that holds it{remedy}."
    )


class _Limited(io.FileIO):
    """A file that receives a download, and refuses to become larger than any registered one is."""

    def write(self, content: Buffer) -> int:
        if self.tell() + memoryview(content).nbytes > LARGEST:
            raise ValueError(f"it is larger than {LARGEST / 1e6:.0f} MB, as no registered file is")
        return super().write(content)


def _download(url: str, output_file: str, manager: object) -> None:
    """Download a file, up to the size that any registered one may have."""
    import pooch

    with _Limited(output_file, "w") as file:
        pooch.HTTPDownloader(timeout=_PATIENCE)(url, file, manager)


def fetch(name: str) -> Path:
    """Path of a registered file, downloaded to the cache where it is not here yet.

    Raises
    ------
    DataUnavailable
        If it is not registered, was derived from its original, cannot be downloaded, or arrives altered.
    """
    entry, state = entry_of(name), state_of(name)
    if state.state == "ok" and state.path is not None:
        return state.path
    if entry.derived:
        raise DataUnavailable(
            f"measured file {entry.name} cannot be fetched: it was derived ({entry.derived}) from {entry.path} of "
            f"https://github.com/{entry.repository} at {entry.commit}. Set {VARIABLE} to the folder that holds it."
        )
    import pooch

    target = cache_folder() / entry.name
    known = f"sha256:{entry.sha256}"
    try:
        pooch.retrieve(entry.url, known_hash=known, fname=target.name, path=target.parent, downloader=_download)
    except (OSError, ValueError) as error:
        raise DataUnavailable(
            f"measured file {entry.name} could not be fetched from {entry.url} ({error}). Check the network, or "
            f"download it elsewhere and set {VARIABLE} to the folder that holds {entry.name}."
        ) from error
    return target
