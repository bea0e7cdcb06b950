"""Bullet's own C interface as compiled code calls it: pybullet's extension module is Bullet's library as well.

pybullet keeps the handles of its clients in a private table. Where the library does not say where that is (not an ELF
file, or a stripped one), there is no handle, and whoever wants to step Bullet does so through pybullet.
"""

from __future__ import annotations

import ctypes
import mmap
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numba import extending, types

NO_HANDLE = 0
TORQUE_CONTROL, LINK_FRAME, BASE = 1, 1, -1
_TABLE, _ANCHOR = "sPhysicsClients1", "b3ConnectPhysicsDirect"
_SYMBOL_TABLE = 2  # type of an ELF section
_SECTION = np.dtype("<u4, <u4, <u8, <u8, <u8, <u8, <u4, <u4, <u8, <u8")
_SYMBOL = np.dtype([("name", "<u4"), ("rest", "<u4"), ("value", "<u8"), ("size", "<u8")])
_ADDRESS, _INT, _DOUBLE = types.intp, types.int32, types.float64


def _function(name: str, result: Any, *arguments: Any) -> Any:
    return types.ExternalFunction(name, result(*arguments))


submit = _function("b3SubmitClientCommandAndWaitStatus", _ADDRESS, _ADDRESS, _ADDRESS)
request_state = _function("b3RequestActualStateCommandInit", _ADDRESS, _ADDRESS, _INT)
actual_state = _function("b3GetStatusActualState", _INT, *[_ADDRESS] * 8)
joint_control = _function("b3JointControlCommandInit2", _ADDRESS, _ADDRESS, _INT, _INT)
set_torque = _function("b3JointControlSetDesiredForceTorque", _INT, _ADDRESS, _INT, _DOUBLE)
external_force = _function("b3ApplyExternalForceCommandInit", _ADDRESS, _ADDRESS)
set_external_torque = _function("b3ApplyExternalTorque", types.void, _ADDRESS, _INT, _INT, _ADDRESS, _INT)
step_simulation = _function("b3InitStepSimulationCommand", _ADDRESS, _ADDRESS)
request_contacts = _function("b3InitRequestContactPointInformation", _ADDRESS, _ADDRESS)
set_contact_body_a = _function("b3SetContactFilterBodyA", types.void, _ADDRESS, _INT)
set_contact_body_b = _function("b3SetContactFilterBodyB", types.void, _ADDRESS, _INT)
contacts = _function("b3GetContactPointInformation", types.void, _ADDRESS, _ADDRESS)
CONTACT, LINK_A, NORMAL_FORCE = 22, 3, 13  # size of b3ContactPointData in doubles; where its link (ints) and force are


def _as_pointer(kind: Any) -> Any:
    """Return what makes an address a pointer to numbers of a kind, in compiled code."""

    def convert(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Sequence[Any]) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

        pointer: Any = types.CPointer
        return pointer(kind)(types.intp), generate

    return extending.intrinsic(convert)


as_doubles, as_ints = _as_pointer(_DOUBLE), _as_pointer(_INT)


def client_handle(library: str, client: int) -> int:
    """Return the C handle of a pybullet client, or `NO_HANDLE`; compiled code can call the functions above from now on.

    Args:
        library: Path of pybullet's extension module, which is loaded already.
        client: pybullet's number of the client.
    """
    table = _client_table(library)
    if table == NO_HANDLE:
        return NO_HANDLE
    return ctypes.cast(table, ctypes.POINTER(ctypes.c_void_p))[client] or NO_HANDLE


@cache
def _client_table(library: str) -> int:
    addresses = _symbols(Path(library), (_TABLE, _ANCHOR))
    if len(addresses) < 2:
        return NO_HANDLE
    llvm.load_library_permanently(library)
    here = ctypes.cast(getattr(ctypes.CDLL(library), _ANCHOR), ctypes.c_void_p).value
    return NO_HANDLE if here is None else here - addresses[_ANCHOR] + addresses[_TABLE]


def _symbols(library: Path, names: Sequence[str]) -> dict[str, int]:
    """Addresses of symbols in a 64-bit ELF file, relative to where it is loaded, as far as it tells them."""
    with library.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        if content[:6] != b"\x7fELF\x02\x01":
            return {}
        start, count = int.from_bytes(content[40:48], "little"), int.from_bytes(content[60:62], "little")
        sections = np.frombuffer(content[start : start + 64 * count], _SECTION)
        for section in sections[sections["f1"] == _SYMBOL_TABLE]:
            strings = sections[section["f6"]]
            texts = content[int(strings["f4"]) : int(strings["f4"] + strings["f5"])]
            symbols = np.frombuffer(content[int(section["f4"]) : int(section["f4"] + section["f5"])], _SYMBOL)
            return _addresses(symbols, texts, names)
    return {}


def _addresses(symbols: np.ndarray, texts: bytes, names: Sequence[str]) -> dict[str, int]:
    addresses = {}
    for name in names:
        at = texts.find(f"\0{name}\0".encode()) + 1
        rows = symbols[symbols["name"] == at]
        if at > 0 and len(rows):
            addresses[name] = int(rows["value"][0])
    return addresses
