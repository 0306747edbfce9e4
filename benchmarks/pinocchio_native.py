"""Pinocchio's forward dynamics in a loop of its own language, where it can be compiled."""

from __future__ import annotations

import ctypes
import hashlib
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from pgraph_peers import pinocchio as in_pinocchio
from pgraph_peers.rows import PLACEHOLDER, Row

from .scenes import Scene

SOURCE = Path(__file__).with_name("pinocchio_loop.cpp")
OPTIONS = (  # the last three are Pinocchio's own: boost::variant of more than 20 joints
    "-std=c++17",
    "-O3",
    "-march=native",
    "-DNDEBUG",
    "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
    "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
)
KINDS = {"translate": 4, "ball": 5, "free": 6}
HINGES = {(1.0, 0.0, 0.0): 0, (0.0, 1.0, 0.0): 1, (0.0, 0.0, 1.0): 2}  # else 3


def library(*, compiling: bool) -> ctypes.CDLL | str:
    """The compiled loop, made if `compiling` (a minute, once), or why there is none."""
    prefixes = [p for p in Path(pin.__file__).parents if p.name == "cmeel.prefix"]
    include = (*prefixes, Path("/usr"))[0] / "include"
    places = [include, include / "eigen3", Path("/usr/include/eigen3")]
    key = "".join((SOURCE.read_text(encoding="utf-8"), *OPTIONS, pin.__version__))
    digest = hashlib.sha256(key.encode()).hexdigest()[:16]
    path = SOURCE.parent / "__pycache__" / f"pinocchio_loop-{digest}.so"
    if not path.exists():
        if not compiling:
            return "it is compiled by a full run"
        if shutil.which("g++") is None:
            return "it needs g++"
        if not (include / "pinocchio").is_dir() or not any((p / "Eigen").is_dir() for p in places):
            return "it needs the headers of Pinocchio and Eigen (pip install cmeel-eigen)"
        path.parent.mkdir(exist_ok=True)
        folders = [word for place in places for word in ("-I", str(place))]
        command = ["g++", *OPTIONS, "-shared", "-fPIC", *folders, str(SOURCE), "-o", str(path)]
        if subprocess.run(command, capture_output=True).returncode:
            return "it does not compile here"
    return ctypes.CDLL(str(path))


def loop(scene: Scene, loaded: ctypes.CDLL) -> tuple[Callable[[int], object], np.ndarray]:
    """(a function that runs aba n times, v' in our coordinates)."""
    model, *_ = in_pinocchio.build(scene.model, scene.rows)
    q, T, Tdot_v = in_pinocchio.coordinates(scene.rows, scene.state.q, scene.state.v)
    v, tau = T @ scene.state.v, np.linalg.solve(T.T, scene.state.tau)
    made, vdot = _made(scene, model, loaded), np.empty(model.nv)
    call = loaded.forward_dynamics
    call.argtypes = (*[ctypes.c_void_p] * 5, ctypes.c_int)
    call.restype = None
    arrays = (q, v, tau, vdot)

    def run(n: int) -> object:
        return call(made, *(x.ctypes.data for x in arrays), n)

    run(1)
    return run, np.linalg.solve(T, vdot - Tdot_v)


def _made(scene: Scene, model: Any, loaded: ctypes.CDLL) -> ctypes.c_void_p:
    """The C++ model of the joints of a Python one; lives as long as the process."""
    joints = range(1, model.njoints)
    places, inertias = model.jointPlacements, model.inertias
    moving = [row for row in scene.rows if row.kind != PLACEHOLDER]
    integers = ([model.parents[j] for j in joints], [_kind(row) for row in moving])
    floats = (
        [[*places[j].rotation.ravel(), *places[j].translation] for j in joints],
        [row.axis for row in moving],
        [inertias[j].mass for j in joints],
        [inertias[j].lever for j in joints],
        [inertias[j].inertia for j in joints],
        model.armature,
        scene.model.gravity,
    )
    arrays = [np.ascontiguousarray(x, np.int64) for x in integers]
    arrays += [np.ascontiguousarray(x, np.float64) for x in floats]
    make = loaded.make
    make.argtypes, make.restype = (ctypes.c_int, *[ctypes.c_void_p] * 9), ctypes.c_void_p
    return ctypes.c_void_p(make(len(moving), *(x.ctypes.data for x in arrays)))


def _kind(row: Row) -> int:
    if row.kind == "rotate":
        return HINGES.get(tuple(row.axis.tolist()), 3)
    return KINDS[row.kind]
