"""Write a model as an FMU, or as a C library with examples."""

from __future__ import annotations

import io
import re
import struct
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..dynamics.dynamics import Dynamics, model_of
from ..errors import FileError, InputError, Problem, choices, explained, shown
from ..fields import is_number
from ..formats.conversion import Report, named
from ..integrators import METHODS
from ..model import Model
from ..model.files import write_atomic
from .description import CO_SIMULATION, MODEL_EXCHANGE, Fmu, fmi2, fmi3
from .image import INPUT, OUTPUT, PARAMETER, STATE, Exported, Wanted
from .library import HERE, PLATFORMS, SOURCES, here, library, stale

KINDS = (CO_SIMULATION, MODEL_EXCHANGE)
EXAMPLES = HERE / "examples"
STAMP = (
    1980,
    1,
    1,
    0,
    0,
    0,
)  # time of all files in an FMU, so that a model always makes the same bytes


@explained
def write_fmu(
    model: Model | Dynamics,
    path: str | Path,
    *,
    version: int = 3,
    kinds: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    parameters: Sequence[str] = (),
    scenario: str | None = None,
    method: str = "auto",
    step: float | None = None,
    rtol: float | None = None,
    platforms: Sequence[str] | None = None,
) -> Report:
    """Write a model as an FMU, which other simulators import without Python and a compiler.

    A co-simulation steps as `simulate` does with the same method and step, and has the same bits on
    x86-64 Linux if the communication step is a multiple of the step. Model exchange gives the
    derivatives to a solver of the importer. It needs a model without contacts and limits.

    Parameters
    ----------
    model : Model or Mechanism
        The model.
    path : str or path
        The file, with the suffix .fmu.
    version : int
        3 for FMI 3.0, or 2 for FMI 2.0.
    kinds : sequence of str, optional
        "cs" for co-simulation and "me" for model exchange. The default is each that is possible.
    inputs : sequence of str, optional
        Names of motors, servos and actuators with a constant input. The default is all of them.
        The name of a wrench gives six inputs, such as "push.force.x" and "push.torque.z".
    outputs : sequence of str, optional
        Names of outputs of the model. The default is all that can travel. If there are none, the
        coordinates and velocities are outputs.
    parameters : sequence of str
        Fields that the importer may change before a run, such as "bodies.rod.damping.0", or with
        their range, "forces.hold.kp=0:10".
    scenario : str, optional
        A scenario of the model, with its initial state and its forces.
    method : str
        "rk4", "semi_implicit_euler", "dopri5", "dop853", with contacts "moreau_jean", or "auto".
    step : float, optional
        Step size [s]. The default is that of the scenario, or 1e-3.
    rtol : float, optional
        Relative tolerance, with which "dopri5" and "dop853" choose their steps.
    platforms : sequence of str, optional
        Names such as "x86_64-linux". The default is each for which this installation has a library.

    Returns
    -------
    Report
        What will be an input, an output and a parameter, and what was left out.

    Raises
    ------
    InputError
        If something of the model cannot travel, with the reason. No file is written in this case.
    FileError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import pgraph_core as pg
    >>> folder = tempfile.mkdtemp()
    >>> pg.write_fmu(pg.Model.serial(2), f"{folder}/arm.fmu").loaded
    True
    """
    model, path = model_of("write_fmu", model), named(path, ".fmu")
    if version not in (2, 3) or isinstance(version, bool):
        raise InputError(Problem("write_fmu", "version", f"must be 3 or 2, got {shown(version)}"))
    report, chosen = Report(path.name), _kinds(model, kinds)
    wanted = _wanted(model, inputs, outputs, parameters, scenario, method, step, rtol, report)
    exported = Exported(model, wanted._replace(rates=MODEL_EXCHANGE in chosen))
    refused = _no_exchange(exported)
    if refused and MODEL_EXCHANGE in chosen:
        if kinds is not None:
            raise InputError(Problem("write_fmu", "kinds", refused))
        report.add("left out", "model exchange", refused)
        chosen = (CO_SIMULATION,)
        exported = Exported(model, wanted)
    content = exported.content()
    token = f"{struct.unpack('<Q', content[-8:])[0]:016x}"
    fmu = Fmu(exported, _identifier(path), token, chosen)
    described = fmi3(fmu) if version == 3 else fmi2(fmu)
    files = {"modelDescription.xml": described, "resources/model.bin": content,
             "resources/model.json": model.to_json().encode()}  # fmt: skip
    for name in _platforms(platforms, report):
        one = PLATFORMS[name]
        folder = name if version == 3 else one.fmi2
        suffix = Path(one.file).suffix
        files[f"binaries/{folder}/{fmu.identifier}{suffix}"] = library(name)
    write_atomic(path, _zipped(files))
    _told(exported, report)
    return report


@explained
def write_c(
    model: Model | Dynamics,
    folder: str | Path,
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    parameters: Sequence[str] = (),
    scenario: str | None = None,
    method: str = "auto",
    step: float | None = None,
    rtol: float | None = None,
    platforms: Sequence[str] | None = None,
) -> Report:
    """Write a model as a C library with examples, for programs and controllers without Python.

    The folder gets the header `pgraph.h`, a library for each platform, the model as `model.bin`,
    and examples: in C with CMake, in Python by ctypes, and a loop with a fixed step that allocates
    nothing.

    Parameters
    ----------
    model : Model or Mechanism
        The model.
    folder : str or path
        The folder, which is created if it does not exist.
    inputs, outputs, parameters, scenario, method, step, rtol, platforms :
        As for `write_fmu`.

    Returns
    -------
    Report
        What will be an input, an output and a parameter, and what was left out.

    Raises
    ------
    InputError
        If something of the model cannot travel, with the reason. No file is written in this case.
    FileError
        If a file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import pgraph_core as pg
    >>> pg.write_c(pg.Model.serial(2), tempfile.mkdtemp()).loaded
    True
    """
    model, folder = model_of("write_c", model), Path(folder)
    report = Report(folder.name)
    wanted = _wanted(model, inputs, outputs, parameters, scenario, method, step, rtol, report)
    exported = Exported(model, wanted)
    files = {path.name.removesuffix(".in"): path.read_bytes() for path in EXAMPLES.iterdir()}
    files |= {"pgraph.h": (SOURCES / "pgraph.h").read_bytes(), "model.bin": exported.content()}
    for name in _platforms(platforms, report):
        files[f"{name}/{PLATFORMS[name].file}"] = library(name)
        if PLATFORMS[name].file.endswith(".dll"):
            files[f"{name}/pgraph.def"] = _exports(files["pgraph.h"].decode())
    for name, content in files.items():
        path = folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            text = f"cannot be made a folder: {error.strerror}; choose another place"
            raise FileError(Problem(str(path.parent), "", text)) from None
        write_atomic(path, content)
    _told(exported, report)
    return report


# -- arguments -------------------------------------------------------------------------------------


def _kinds(model: Model, kinds: Sequence[str] | None) -> tuple[str, ...]:
    if kinds is None:
        return KINDS
    given = (kinds,) if isinstance(kinds, str) else tuple(kinds)
    if not given or any(kind not in KINDS for kind in given):
        text = f"must contain 'cs' (co-simulation) or 'me' (model exchange), got {shown(kinds)}"
        raise InputError(Problem("write_fmu", "kinds", text))
    return tuple(kind for kind in KINDS if kind in given)


def _no_exchange(exported: Exported) -> str:
    """Return the reason why a model has no model exchange, or ""."""
    if METHODS[exported.method].time_stepping:
        return (
            "contacts and limits by time stepping have no continuous derivative, so this model has "
            "no model exchange; use co-simulation, kinds=['cs']"
        )
    if exported.model.stateful:
        return (
            "controls, lags or muscles have states of their own, so this model has no model "
            "exchange; use co-simulation, kinds=['cs']"
        )
    return ""


def _wanted(
    model: Model, inputs: Any, outputs: Any, parameters: Any, scenario: Any, method: Any,
    step: Any, rtol: Any, report: Report,
) -> Wanted:  # fmt: skip
    """Return what an export contains, after checking it. Raises InputError."""
    for name, value in (("step", step), ("rtol", rtol)):
        if value is not None and not (is_number(value) and 0 < value < float("inf")):
            text = f"must be a finite number > 0, got {shown(value)}"
            raise InputError(Problem("export", name, text))
    names = {"inputs": inputs, "outputs": outputs, "parameters": parameters}
    for name, value in names.items():
        if isinstance(value, str) or (
            value is not None and not all(isinstance(one, str) for one in value)
        ):
            text = f"must be a list of names, as in {name}=['NAME'], got {shown(value)}"
            raise InputError(Problem("export", name, text))
    for one in model.outputs:
        if one.imperfect is not None and (outputs is None or one.name in outputs):
            text = "is exact: its noise and its delay stay behind"
            report.add("left out", f"output '{one.name}'", text, part=one.name)
    return Wanted(
        None if inputs is None else tuple(inputs), None if outputs is None else tuple(outputs),
        tuple(parameters), scenario, method, None if step is None else float(step),
        None if rtol is None else float(rtol),
    )  # fmt: skip


def _platforms(platforms: Sequence[str] | None, report: Report) -> list[str]:
    """Return the platforms that are written. Raises InputError if there is no library for any."""
    if platforms is None:
        found = [name for name in PLATFORMS if not stale(name)]
        if untested := [name for name in found if not PLATFORMS[name].tested]:
            report.add("warning", choices(untested), "no test has run these libraries")
        if here() not in found:
            report.add("left out", "this platform", "this installation has no library for it")
        if not found:
            library(next(iter(PLATFORMS)))  # says how to make it
        return found
    given = [platforms] if isinstance(platforms, str) else list(platforms)
    if not given:
        text = f"must name one of {choices(PLATFORMS)}, got {shown(platforms)}"
        raise InputError(Problem("export", "platforms", text))
    for name in given:
        library(name)
    return given


def _exports(header: str) -> bytes:
    """Return the module definition of a DLL, from which Visual Studio makes its import library."""
    names = re.findall(r"^PGRAPH_API .*?(pgraph_\w+)\(", header, re.M)
    return "\n".join(["LIBRARY pgraph.dll", "EXPORTS", *(f"  {x}" for x in names), ""]).encode()


def _identifier(path: Path) -> str:
    """Return the name of a file as an identifier of C."""
    name = re.sub(r"\W", "_", path.stem, flags=re.ASCII)
    return name if re.match(r"[A-Za-z_]", name) else f"m_{name}"


def _zipped(files: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, content in files.items():
            info = zipfile.ZipInfo(name, STAMP)
            info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(info, content, compresslevel=9)
    return out.getvalue()


def _told(exported: Exported, report: Report) -> None:
    """Add what the variables of an export are, and its method."""
    for name, why in exported.left_out:
        report.add("left out", f"output '{name}'", why, part=name)
    words = {INPUT: "an input", OUTPUT: "an output", PARAMETER: "a parameter"}
    if not any(one.kind == OUTPUT for one in exported.variables):
        words[STATE] = "an output, since the model has no others"
    for one in exported.variables:
        if one.kind in words:
            unit = f" [{one.unit}]" if one.unit else ""
            report.add("read", f"'{one.name}'", f"is {words[one.kind]}{unit}")
    step = f"steps of {exported.setup.step:g} s"
    if exported.by_tolerance:
        step = f"steps of its choice, rtol {exported.wanted.rtol:g}"
    report.add("read", "method", f"is {exported.method} with {step}")
