"""Folders for results: made, tried, and kept from other commands until one ends."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import click


def results_folder(out: Path, *files: str) -> Path:
    """Return the folder of ``--out``, made and held until the command ends; refuse one that cannot take these files."""
    from discovery.foundation.errors import InputError

    if os.path.exists(out) and not out.is_dir():
        raise InputError(f"{out} is a file; give a folder with --out.")
    for name in files:
        if os.path.isdir(out / name):
            raise InputError(f"{out / name} is a folder; move it away, or give another folder with --out.")
    return held(writable(out))


def writable(folder: Path) -> Path:
    """Return a folder, made if need be and removed if empty at the end; refuse one in which nothing can be written."""
    from tempfile import TemporaryFile

    from discovery.foundation.errors import InputError
    from discovery.foundation.io import reason, shown

    made = [place for place in (folder, *folder.parents) if not os.path.exists(place)]

    @click.get_current_context().call_on_close
    def _() -> None:
        with suppress(OSError):
            for place in made:
                place.rmdir()

    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InputError(
            f"Nothing can be written to {shown(folder)}: {reason(error)}. Give another folder with --out."
        ) from None
    return folder


def held(folder: Path) -> Path:
    """Return a folder that no other command writes to until this one ends; refuse one to which another does.

    Unfinished files of commands that were ended from outside, this one included, are removed.
    """
    from discovery.foundation.errors import InputError
    from discovery.foundation.locks import folder_lock
    from discovery.results.manifest import remove_unfinished

    context = click.get_current_context()
    if not context.with_resource(folder_lock(folder)):
        raise InputError(
            f"Another discovery command is writing to {folder}. Wait until it has ended, or give this one another "
            "folder."
        )
    remove_unfinished(folder)

    @context.call_on_close
    def _() -> None:
        with suppress(OSError):
            remove_unfinished(folder)

    return folder
