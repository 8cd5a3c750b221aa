"""Works through a page of docs from first to last: what it quotes must be what comes out."""

from __future__ import annotations

import contextlib
import doctest
import io
import re
import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path

from discovery.cli import main

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\d)")
#: A minimum of what is not smooth differs by this share of its standard deviation from one processor to another.
OF_SD = 0.1


def agree(quoted: str, printed: str) -> bool:
    """Whether texts are equal, and numbers to a unit of the last digit quoted, 0.15 %, or a tenth of the sd.

    A model error is told to a hundredth of what counts as none: how far below it ends depends on the processor.
    """
    if NUMBER.sub("#", quoted).split() != NUMBER.sub("#", printed).split():
        return False
    for want, got in zip(NUMBER.finditer(quoted), NUMBER.findall(printed), strict=True):
        unit = 0.0 if want[0].lstrip("-").isdigit() else 10.0 ** -len(want[0].partition(".")[2])
        sd = re.match(r" \+- ([\d.]+)", quoted[want.end() :])
        none = re.match(rf"[^\n]* up to ({NUMBER.pattern}) \S+ counts as none", quoted[want.end() :])
        allowed = max(1.01 * unit, 1.5e-3 * abs(float(want[0])) if unit else 0.0, OF_SD * float(sd[1]) if sd else 0.0)
        allowed = max(allowed, 0.01 * float(none[1])) if none else allowed
        if abs(float(want[0]) - float(got)) > allowed:
            return False
    return True


class Checker(doctest.OutputChecker):
    def check_output(self, want: str, got: str, optionflags: int) -> bool:
        return agree(want, got)


def run(command: str) -> str:
    """Run a line of a console and return what it says: the result, or the error where that is all."""
    program, *arguments = shlex.split(command)
    if program != "discovery":
        return subprocess.run(command, shell=True, check=True, capture_output=True, text=True).stdout
    out, err, status = io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(arguments)
        except SystemExit as leaving:
            status = int(leaving.code or 0)
    assert status in (0, 2), err.getvalue()
    return err.getvalue() if status else out.getvalue()


def steps(block: str) -> Iterator[tuple[str, str]]:
    """Yield the commands of a console block with what is quoted after them."""
    for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        command, _, quoted = part.partition("\n")
        yield command, quoted


def work_through(text: str, page: str, place: Path) -> None:
    """Write the files of a page into a folder, run its scripts, commands and sessions there, and compare."""
    session: dict[str, object] = {}
    with contextlib.chdir(place):
        for language, block in re.findall(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
            name = re.match(r"# (\S+)\n", block)
            if name:
                Path(name[1]).write_text(block, encoding="utf-8")
            if language == "console":
                for command, quoted in steps(block):
                    printed = run(command)
                    assert agree(quoted, printed), f"$ {command}\n{printed}"
            elif language == "python" and name:
                exec(block, {})
            elif language == "python":
                test = doctest.DocTestParser().get_doctest(block, session, page, None, 0)
                shown = io.StringIO()
                runner = doctest.DocTestRunner(Checker(), verbose=False)
                assert not runner.run(test, out=shown.write, clear_globs=False).failed, shown.getvalue()
                session = test.globs
