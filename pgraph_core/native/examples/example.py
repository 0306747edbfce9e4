"""Run the model for one second by ctypes: no other package is needed."""

import ctypes
import platform
import sys
from pathlib import Path

HERE = Path(__file__).parent
SYSTEM = {"linux": ("linux", "so"), "win32": ("windows", "dll"), "darwin": ("darwin", "dylib")}
ARCH = {"AMD64": "x86_64", "arm64": "aarch64"}

number, size, text, place = ctypes.c_double, ctypes.c_size_t, ctypes.c_char_p, ctypes.c_void_p
system, suffix = SYSTEM[sys.platform]
machine = ARCH.get(platform.machine(), platform.machine())
library = ctypes.CDLL(str(HERE / f"{machine}-{system}" / f"pgraph.{suffix}"))
for name, result, *arguments in (
    ("size", size, place, size, ctypes.POINTER(text)), ("create", place, place, size, place),
    ("start", ctypes.c_int, place, number), ("first_time", number, place),
    ("advance", ctypes.c_int, place, number), ("message", text, place),
    ("count", ctypes.c_int, place), ("name", text, place, ctypes.c_int),
    ("get", ctypes.c_int, place, ctypes.c_int, ctypes.POINTER(number)),
):  # fmt: skip
    function = getattr(library, f"pgraph_{name}")
    function.restype, function.argtypes = result, arguments

content = (HERE / "model.bin").read_bytes()
model = ctypes.create_string_buffer(content, len(content) + 64)
why = text()
needed = library.pgraph_size(model, len(content), why)
if not needed:
    raise SystemExit((why.value or b"").decode())
memory = ctypes.create_string_buffer(needed + 64)
begin = ctypes.addressof(memory)
p = library.pgraph_create(model, len(content), begin + (64 - begin % 64))


def checked(code: int) -> None:
    """Stop with the message of a call that failed."""
    if code:
        raise SystemExit(library.pgraph_message(p).decode())


checked(library.pgraph_start(p, library.pgraph_first_time(p)))
names = [library.pgraph_name(p, k).decode() for k in range(library.pgraph_count(p))]
print(",".join(names))
for row in range(11):
    values = []
    for k in range(len(names)):
        value = number()
        checked(library.pgraph_get(p, k, value))
        values.append(value.value)
    print(",".join(f"{x:.17g}" for x in values))
    if row < 10:
        checked(library.pgraph_advance(p, 0.1))
