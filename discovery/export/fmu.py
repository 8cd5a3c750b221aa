"""A model as a functional mock-up unit: co-simulation by FMI 2.0, of the exported C, with its sources."""

from __future__ import annotations

import hashlib
import io
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from discovery.declarations.units import in_coordinate
from discovery.equations.model import Model
from discovery.export.c_source import to_c
from discovery.export.fitted import FittedModel, fitted_model
from discovery.export.source import integration_step
from discovery.export.source_text import composition, filled, origin
from discovery.foundation.errors import InputError

if TYPE_CHECKING:
    from discovery.estimation.fit import Fit

_FILES = ("model.c", "fmi2.c")


def _platform() -> tuple[str, str] | None:
    """Return the folder of this platform's library in an archive, and its suffix; None where FMI 2.0 names none."""
    if platform.machine().lower() not in {"x86_64", "amd64"}:
        return None
    known = {"linux": ("linux64", ".so"), "darwin": ("darwin64", ".dylib"), "win32": ("win64", ".dll")}
    return known.get(sys.platform)


def _library(sources: Mapping[str, str]) -> tuple[str, bytes] | None:
    """Return the compiled library with its place in the archive; None without a compiler for this platform."""
    compiler, place = shutil.which("cc") or shutil.which("gcc"), _platform()
    if compiler is None or place is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        for name, text in sources.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        flags = ["-std=c99", "-O2", "-shared", "-fPIC", "-fvisibility=hidden", "-s"]
        command = [compiler, *flags, *_FILES, "-o", "library", "-lm"]
        made = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if made.returncode:
            raise InputError(f"{compiler} cannot compile the model ({made.stderr.strip()[:300]}). Export it as 'c'.")
        return f"binaries/{place[0]}/model{place[1]}", (Path(folder) / "library").read_bytes()


def _variables(found: FittedModel) -> Iterable[dict[str, str]]:
    """Return the attributes of every variable, in the order of their references."""
    base = found.model.mechanics
    arm = base.system.has_rod
    held = {"causality": "parameter", "variability": "fixed", "initial": "exact"}
    for name, parameter in found.model.parameters.items():
        unit = found.unit_of(name)
        yield {"name": name, "description": parameter.meaning, **held, "start": repr(found.values[name]), "unit": unit}
    q = found.coordinate
    yield {"name": "deflection_0", "description": "initial deflection", **held, "start": "0.0", "unit": q}
    yield {"name": "rate_0", "description": "its rate", **held, "start": "0.0", "unit": in_coordinate("q s^-1", q)}
    step = repr(integration_step(found))
    yield {"name": "step", "description": "longest integration step", **held, "start": step, "unit": "s"}
    # A model of no recording does not know the unit of its input.
    stem, given = ("theta_m", "rad") if arm else ("input", found.given)
    rates = {"": "u", "_dot": "u s^-1", "_ddot": "u s^-2"} if base.input_moves else {"": "u"}
    for end, unit in rates.items():
        driven = {"name": stem + end, "causality": "input", "variability": "continuous", "start": "0.0"}
        yield {**driven, "unit": in_coordinate(unit, q, given)} if given else driven
    for name in base.channels:
        read = {"name": name, "causality": "output", "variability": "continuous", "initial": "calculated"}
        yield {**read, "unit": "m" if arm else found.reading or q}


def _description(found: FittedModel, guid: str) -> bytes:
    """Return modelDescription.xml."""
    about = " ".join([f"Base {composition(found)}.", *origin(found)])
    root = ET.Element("fmiModelDescription", fmiVersion="2.0", modelName="model", guid=guid, description=about)
    able = {"canHandleVariableCommunicationStepSize": "true", "canInterpolateInputs": "true"}
    able |= {"canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true"}
    files = ET.SubElement(ET.SubElement(root, "CoSimulation", {"modelIdentifier": "model", **able}), "SourceFiles")
    for name in _FILES:
        ET.SubElement(files, "File", name=name)
    variables = list(_variables(found))
    units = ET.SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(v["unit"] for v in variables if "unit" in v):
        ET.SubElement(units, "Unit", name=unit)
    ET.SubElement(root, "DefaultExperiment", stepSize=repr(integration_step(found)))
    listed = ET.SubElement(root, "ModelVariables")
    real = ("start", "unit")
    for k, variable in enumerate(variables):
        scalar = {a: v for a, v in variable.items() if a not in real}
        element = ET.SubElement(listed, "ScalarVariable", {"valueReference": str(k), **scalar})
        ET.SubElement(element, "Real", {a: variable[a] for a in real if a in variable})
    structure = ET.SubElement(root, "ModelStructure")
    for words in ("Outputs", "InitialUnknowns"):
        unknown = ET.SubElement(structure, words)
        for k, variable in enumerate(variables, 1):
            if variable["causality"] == "output":
                ET.SubElement(unknown, "Unknown", index=str(k))
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True)


def to_fmu(source: FittedModel | Fit | Model, values: Mapping[str, float] | None = None) -> bytes:
    """Return a model as an FMU for co-simulation: the exported C with its interface of FMI 2.0, compiled if possible.

    It needs no Python. The library is that of the platform on which it is written, where that has a C compiler; the
    sources are in the archive for all others. The archive is the same for the same model and compiler. `values` replace
    those of `source` [SI, radians].

    InputError if a parameter has no value, or the compiler fails.
    """
    found = fitted_model(source, values)
    header, body = to_c(found)
    guid = hashlib.sha256((header + body).encode()).hexdigest()[:32]
    interface = filled("fmi2_source.txt", {"GUID": guid, "MOVES": found.model.mechanics.input_moves})
    sources = {"model.h": header, "model.c": body, "fmi2.c": interface}
    files: dict[str, str | bytes] = {"modelDescription.xml": _description(found, guid)}
    files |= {f"sources/{name}": text for name, text in sources.items()}
    library = _library(sources)
    if library is not None:
        files[library[0]] = library[1]
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in files.items():
            # A fixed date: the same model is the same file.
            packed.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return archive.getvalue()
