"""Calls from Python into machine code, by a single function that reads the signature of a kernel.

The function of a kernel receives its arguments as words of 8 bytes. `enter` is a function of
CPython's convention METH_FASTCALL. It finds in its `self`, a bytes object of words, what the kernel
takes, and lays the arguments out: numbers as they are, an array as the struct that kernels read
(owner, parent, number of entries, bytes of each, place, shape, strides), tuples member after
member. It releases the GIL if the kernel does, and converts the results to Python objects.

Kernels do not depend on this function, so their code is the same for every version of Python and
NumPy.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir

from .kinds import Array, Group, Kind, Signature

INT, UNSIGNED, REAL, ARRAY, TUPLE, NONE = range(6)
OF_SCALAR = {"i8": INT, "of_duals": INT, "u8": UNSIGNED, "f8": REAL, "none": NONE}
# words of the table, then a word for each result, then for each argument its message and its kind
(
    FUNCTION, ARGUMENTS, WORDS_NEEDED, NOGIL, RESULTS, IN_TUPLE, HEAD, NDARRAY, COUNT_MESSAGE,
    FAILURE_MESSAGE, FIRST_RESULT,
) = range(11)  # fmt: skip
MOST_RESULTS = 8  # results
ORDERED, WRITEABLE = 0x101, 0x400  # NumPy's flags: C-contiguous and aligned, and writeable
EQUAL = 2  # Py_EQ

BYTE, HALF, WORD, DOUBLE = ir.IntType(8), ir.IntType(32), ir.IntType(64), ir.DoubleType()
OBJECT, WORDS, VOID = BYTE.as_pointer(), WORD.as_pointer(), ir.VoidType()
# functions of Python's stable interface: result, arguments
PYTHON: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "PyBytes_AsString": (OBJECT, (OBJECT,)),
    "PyErr_Clear": (VOID, ()),
    "PyErr_Occurred": (OBJECT, ()),
    "PyErr_SetString": (VOID, (OBJECT, OBJECT)),
    "PyEval_RestoreThread": (VOID, (OBJECT,)),
    "PyEval_SaveThread": (OBJECT, ()),
    "PyFloat_AsDouble": (DOUBLE, (OBJECT,)),
    "PyFloat_FromDouble": (OBJECT, (DOUBLE,)),
    "PyLong_AsLongLong": (WORD, (OBJECT,)),
    "PyLong_AsUnsignedLongLong": (WORD, (OBJECT,)),
    "PyLong_FromLongLong": (OBJECT, (WORD,)),
    "PyNumber_Index": (OBJECT, (OBJECT,)),
    "PyObject_RichCompareBool": (HALF, (OBJECT, OBJECT, HALF)),
    "PyTuple_GetItem": (OBJECT, (OBJECT, WORD)),
    "PyTuple_New": (OBJECT, (WORD,)),
    "PyTuple_SetItem": (HALF, (OBJECT, WORD, OBJECT)),
    "PyTuple_Size": (WORD, (OBJECT,)),
    "PyType_IsSubtype": (HALF, (OBJECT, OBJECT)),
    "Py_DecRef": (VOID, (OBJECT,)),
    "Py_IncRef": (VOID, (OBJECT,)),
}
DATA = ("PyExc_TypeError", "PyExc_RuntimeError", "PyTuple_Type", "_Py_NoneStruct")
ENTER = "pgraph_enter"


class _Code:
    """A function in LLVM IR under construction."""

    def __init__(self, module: ir.Module, name: str, result: Any, arguments: tuple[Any, ...]):
        self.module = module
        self.function = ir.Function(module, ir.FunctionType(result, arguments), name)
        self.builder = ir.IRBuilder(self.function.append_basic_block())

    def python(self, name: str, *args: Any) -> Any:
        """Call a function of the Python C API."""
        result, kinds = PYTHON[name]
        known = self.module.globals.get(name)
        known = known or ir.Function(self.module, ir.FunctionType(result, kinds), name)
        return self.builder.call(known, args)

    def data(self, name: str) -> Any:
        """Return the address of an object of the Python C API."""
        known = self.module.globals.get(name)
        return known or ir.GlobalVariable(self.module, BYTE, name)

    def exception(self, name: str) -> Any:
        """Return an exception class of Python."""
        return self.builder.load(self.builder.bitcast(self.data(name), OBJECT.as_pointer()))

    def word(self, words: Any, at: Any) -> Any:
        """words[at]."""
        return self.builder.load(self.place(words, at))

    def place(self, words: Any, at: Any) -> Any:
        """&words[at]."""
        return self.builder.gep(words, [WORD(at) if isinstance(at, int) else at])

    def field(self, address: Any, kind: Any) -> Any:
        """Load the value at an address."""
        return self.builder.load(self.builder.inttoptr(address, kind.as_pointer()))

    def pointer(self, word: Any) -> Any:
        """Return a word as the address of an object."""
        return self.builder.inttoptr(word, OBJECT)

    def loop(self, count: Any, body: Callable[[Any], None]) -> None:
        """Emit `body(i)` for i from 0 to count - 1."""
        b = self.builder
        head, inside, after = (b.append_basic_block() for _ in range(3))
        before = b.block
        b.branch(head)
        b.position_at_end(head)
        i: Any = b.phi(WORD)
        i.add_incoming(WORD(0), before)
        b.cbranch(b.icmp_signed("<", i, count), inside, after)
        b.position_at_end(inside)
        body(i)
        i.add_incoming(b.add(i, WORD(1)), b.block)
        b.branch(head)
        b.position_at_end(after)


def module() -> str:
    """Return the text of the module that contains `enter`."""
    made = ir.Module()
    _enter(made, _Take(made).function)
    return str(made)


class _Take:
    """take(object, &description, &words, head, ndarray): returns 1 if the object fits and is laid
    out.

    `wrong` is the block in which the function returns 0. Each kind of argument has a method, which
    generates the corresponding block of the switch.
    """

    def __init__(self, made: ir.Module):
        double = WORDS.as_pointer()
        self.code = _Code(made, "take", HALF, (OBJECT, double, double, WORD, WORD))
        self.b = self.code.builder
        self.function = self.code.function
        self.function.linkage = "internal"
        self.given, self.at_kind, self.at_word, self.head, self.ndarray = self.function.args
        self.kind, self.words = self.b.load(self.at_kind), self.b.load(self.at_word)
        operation = self.code.word(self.kind, 0)
        place = self.b.sub(self.b.add(self.b.ptrtoint(self.given, WORD), self.head), WORD(8))
        self.type = self.code.field(place, OBJECT)
        self.wrong = self.b.append_basic_block()
        choice = self.b.switch(operation, self.wrong)
        cases = {
            INT: self.integer, UNSIGNED: self.unsigned, REAL: self.real, ARRAY: self.array,
            TUPLE: self.members, NONE: self.none,
        }  # fmt: skip
        for number, lay_out in cases.items():
            block = self.b.append_basic_block()
            choice.add_case(WORD(number), block)
            self.b.position_at_end(block)
            lay_out()
        self.b.position_at_end(self.wrong)
        self.b.ret(HALF(0))

    def must(self, good: Any) -> None:
        """Branch to `wrong` unless the condition is true."""
        block = self.b.append_basic_block()
        self.b.cbranch(good, block, self.wrong)
        self.b.position_at_end(block)

    def done(self, kinds: int, count: Any) -> None:
        """Return 1 after consuming this many words of the description and the arguments."""
        self.b.store(self.code.place(self.kind, kinds), self.at_kind)
        self.b.store(self.code.place(self.words, count), self.at_word)
        self.b.ret(HALF(1))

    def put(self, value: Any, at: Any) -> None:
        """words[at] = value."""
        self.b.store(value, self.code.place(self.words, at))

    def is_a(self, wanted: Any) -> Any:
        """Check whether the object is an instance of a type or a subtype."""
        b = self.b

        def below() -> Any:
            found = self.code.python("PyType_IsSubtype", self.type, wanted)
            return b.icmp_signed("!=", found, HALF(0))

        same = b.icmp_unsigned("==", self.type, wanted)
        return _either(b, same, lambda: ir.IntType(1)(1), below)

    def number(self, value: Any, suspicious: Any) -> None:
        """Lay out a number, and check for a Python error if the number is suspicious."""
        with self.b.if_then(suspicious, likely=False):
            failed = self.code.python("PyErr_Occurred")
            self.must(self.b.icmp_unsigned("==", failed, OBJECT(None)))
        self.b.store(value, self.b.bitcast(self.words, value.type.as_pointer()))
        self.done(1, 1)

    def integer(self) -> None:
        """A signed integer."""
        value = self.code.python("PyLong_AsLongLong", self.given)
        self.number(value, self.b.icmp_signed("==", value, WORD(-1)))

    def unsigned(self) -> None:
        """Lay out an unsigned integer, such as an address."""
        index = self.code.python("PyNumber_Index", self.given)
        self.must(self.b.icmp_unsigned("!=", index, OBJECT(None)))
        value = self.code.python("PyLong_AsUnsignedLongLong", index)
        self.code.python("Py_DecRef", index)
        self.number(value, self.b.icmp_signed("==", value, WORD(-1)))

    def real(self) -> None:
        """Lay out a float. Arrays with a single number are rejected."""
        self.must(self.b.not_(self.is_a(self.code.pointer(self.ndarray))))
        value = self.code.python("PyFloat_AsDouble", self.given)
        self.number(value, self.b.fcmp_ordered("==", value, DOUBLE(-1.0)))

    def array(self) -> None:
        """Lay out an array. Its kind has the axes, NumPy's description, entry size, and flags."""
        b, code = self.b, self.code
        self.must(self.is_a(code.pointer(self.ndarray)))
        start = b.add(b.ptrtoint(self.given, WORD), self.head)
        axes = code.word(self.kind, 1)
        number = code.field(b.add(start, WORD(8)), HALF)
        self.must(b.icmp_signed("==", b.sext(number, WORD), axes))
        flags = b.zext(code.field(b.add(start, WORD(48)), HALF), WORD)
        asked = code.word(self.kind, 4)
        self.must(b.icmp_signed("==", b.and_(flags, asked), asked))
        descr = code.field(b.add(start, WORD(40)), OBJECT)
        wanted = code.pointer(code.word(self.kind, 2))
        with b.if_then(b.icmp_unsigned("!=", descr, wanted), likely=False):
            same = code.python("PyObject_RichCompareBool", descr, wanted, HALF(EQUAL))
            self.must(b.icmp_signed("==", same, HALF(1)))
        self.put(WORD(0), 0)
        self.put(WORD(0), 1)
        self.put(code.word(self.kind, 3), 3)
        self.put(code.field(start, WORD), 4)
        self.axes(
            axes,
            code.field(b.add(start, WORD(16)), WORDS),
            code.field(b.add(start, WORD(24)), WORDS),
        )

    def axes(self, axes: Any, shape: Any, strides: Any) -> None:
        """Lay out the number of entries, the shape and the strides of an array."""
        b, code = self.b, self.code
        self.put(WORD(1), 2)

        def axis(i: Any) -> None:
            size = code.word(shape, i)
            self.put(b.mul(code.word(self.words, 2), size), 2)
            self.put(size, b.add(i, WORD(5)))
            self.put(code.word(strides, i), b.add(b.add(i, axes), WORD(5)))

        code.loop(axes, axis)
        self.done(5, b.add(WORD(5), b.add(axes, axes)))

    def members(self) -> None:
        """Lay out a tuple. Its kind has the number of members, followed by their kinds."""
        b, code = self.b, self.code
        self.must(self.is_a(code.data("PyTuple_Type")))
        count = code.word(self.kind, 1)
        self.must(b.icmp_signed("==", code.python("PyTuple_Size", self.given), count))
        b.store(code.place(self.kind, 2), self.at_kind)

        def member(i: Any) -> None:
            one = code.python("PyTuple_GetItem", self.given, i)
            rest = self.at_kind, self.at_word, self.head, self.ndarray
            self.must(b.icmp_signed("!=", b.call(self.function, [one, *rest]), HALF(0)))

        code.loop(count, member)
        b.ret(HALF(1))

    def none(self) -> None:
        """Lay out None, which needs no word."""
        self.must(self.b.icmp_unsigned("==", self.given, self.code.data("_Py_NoneStruct")))
        self.done(1, 0)


def _enter(made: ir.Module, take: Any) -> None:
    """enter(self, arguments, number of arguments), called by METH_FASTCALL."""
    code = _Code(made, ENTER, OBJECT, (OBJECT, OBJECT.as_pointer(), WORD))
    b, (own, given, number) = code.builder, code.function.args
    table = b.bitcast(code.python("PyBytes_AsString", own), WORDS)
    words = b.alloca(WORD, code.word(table, WORDS_NEEDED))
    results = b.alloca(WORD, WORD(MOST_RESULTS))
    at_kind, at_word = b.alloca(WORDS), b.alloca(WORDS)

    def fail(exception: str, message: Any) -> None:
        code.python("PyErr_Clear")
        code.python("PyErr_SetString", code.exception(exception), code.pointer(message))
        b.ret(OBJECT(None))

    count = code.word(table, ARGUMENTS)
    with b.if_then(b.icmp_signed("!=", number, count), likely=False):
        fail("PyExc_TypeError", code.word(table, COUNT_MESSAGE))
    b.store(words, at_word)
    made_of = code.word(table, RESULTS)
    b.store(code.place(table, b.add(made_of, WORD(FIRST_RESULT))), at_kind)

    def argument(i: Any) -> None:
        kind = b.load(at_kind)
        message = code.word(kind, 0)
        b.store(code.place(kind, 1), at_kind)
        one = b.load(b.gep(given, [i]))
        head, ndarray = code.word(table, HEAD), code.word(table, NDARRAY)
        good = b.call(take, [one, at_kind, at_word, head, ndarray])
        with b.if_then(b.icmp_signed("==", good, HALF(0)), likely=False):
            fail("PyExc_TypeError", message)

    code.loop(count, argument)
    status = _called(code, table, words, results)
    with b.if_then(b.icmp_signed("!=", status, HALF(0)), likely=False):
        fail("PyExc_RuntimeError", code.word(table, FAILURE_MESSAGE))
    with b.if_then(b.icmp_signed("==", made_of, WORD(0))):
        none = code.data("_Py_NoneStruct")
        code.python("Py_IncRef", none)
        b.ret(none)

    with b.if_then(b.icmp_signed("==", code.word(table, IN_TUPLE), WORD(0))):
        b.ret(_boxed(code, table, results, WORD(0)))
    several = code.python("PyTuple_New", made_of)
    code.loop(
        made_of,
        lambda i: code.python("PyTuple_SetItem", several, i, _boxed(code, table, results, i)),
    )
    b.ret(several)


def _called(code: _Code, table: Any, words: Any, results: Any) -> Any:
    """Call the kernel, without the GIL if the table specifies this. Returns its status."""
    b = code.builder
    kind = ir.FunctionType(HALF, [WORDS, WORDS]).as_pointer()
    function = b.inttoptr(code.word(table, FUNCTION), kind)
    nogil = b.icmp_signed("!=", code.word(table, NOGIL), WORD(0))

    def released() -> Any:
        thread = code.python("PyEval_SaveThread")
        status = b.call(function, [words, results])
        code.python("PyEval_RestoreThread", thread)
        return status

    return _either(b, nogil, released, lambda: b.call(function, [words, results]))


def _boxed(code: _Code, table: Any, results: Any, i: Any) -> Any:
    """Return result i as a Python object."""
    b, value = code.builder, code.word(results, i)
    real = b.icmp_signed("==", code.word(table, b.add(i, WORD(FIRST_RESULT))), WORD(REAL))
    return _either(
        b,
        real,
        lambda: code.python("PyFloat_FromDouble", b.bitcast(value, DOUBLE)),
        lambda: code.python("PyLong_FromLongLong", value),
    )


def _either(b: Any, condition: Any, one: Callable[[], Any], other: Callable[[], Any]) -> Any:
    """Return the first value if the condition is true, and the second value otherwise."""
    values: list[tuple[Any, Any]] = []
    with b.if_else(condition) as (then, otherwise):
        for branch, value in ((then, one), (otherwise, other)):
            with branch:
                values.append((value(), b.block))
    found = b.phi(values[0][0].type)
    for value, block in values:
        found.add_incoming(value, block)
    return found


# -- the table of a kernel -------------------------------------------------------------------------


class _Method(ctypes.Structure):
    """PyMethodDef."""

    _fields_ = [
        ("name", ctypes.c_char_p),
        ("call", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    ]


FASTCALL = 0x80
ALIVE: list[Any] = []  # objects whose addresses machine code holds


def function(name: str, signature: Signature, nogil: bool, enter: int, address: int) -> Any:
    """Return the function that Python calls. The kernel reads its argument words at `address`."""
    results = signature.result
    members = results.members if isinstance(results, Group) else (results,)
    out = [OF_SCALAR[one.code] for one in members if getattr(one, "code", "") != "void"]
    kinds: list[int] = []
    size = 0
    for i, kind in enumerate(signature.arguments, start=1):
        kinds.append(_text(f"{name}: argument {i} must be {in_words(kind)}"))
        more, words = _described(kind)
        kinds += more
        size += words
    count = _text(f"{name} takes {len(signature.arguments)} arguments")
    failed = _text(f"{name} failed")
    table = [
        address, len(signature.arguments), size, int(nogil), len(out),
        int(isinstance(results, Group)), object.__basicsize__, id(np.ndarray), count, failed,
    ]  # fmt: skip
    own = np.array([*table, *out, *kinds], dtype=np.uint64).tobytes()
    method = _Method(name.encode(), enter, FASTCALL, None)
    new = ctypes.pythonapi.PyCFunction_NewEx
    new.restype, new.argtypes = (
        ctypes.py_object,
        [ctypes.POINTER(_Method), ctypes.py_object, ctypes.c_void_p],
    )
    made = new(ctypes.byref(method), own, None)
    # the interpreter reads the method of a function when it ends, after it has freed modules
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(method))
    ALIVE.extend((own, made))
    return made


def _text(message: str) -> int:
    """Return the address of a string."""
    kept = ctypes.create_string_buffer(message.encode())
    ALIVE.append(kept)
    return ctypes.addressof(kept)


def _described(kind: Kind) -> tuple[list[int], int]:
    """Compute (the words that describe a kind, the number of words its values need)."""
    if isinstance(kind, Array):
        ALIVE.append(kind.dtype)
        flags = ORDERED if kind.read else ORDERED | WRITEABLE
        words = [ARRAY, kind.ndim, id(kind.dtype), kind.dtype.itemsize, flags]
        return words, 5 + 2 * kind.ndim
    if isinstance(kind, Group):
        parts = [_described(member) for member in kind.members]
        words = [TUPLE, len(parts)]
        for more, _ in parts:
            words += more
        return words, sum(size for _, size in parts)
    number = OF_SCALAR[kind.code]
    return [number], int(number != NONE)


def in_words(kind: Kind) -> str:
    """Describe the required argument in words."""
    if isinstance(kind, Array):
        entries = "records" if kind.dtype.names else kind.dtype.name
        how = "C-contiguous" if kind.read else "C-contiguous, writeable"
        return f"a {how} array of {entries} with {kind.ndim} axes"
    if isinstance(kind, Group):
        return f"a tuple of {len(kind.members)} members that fit"
    return {INT: "an integer", UNSIGNED: "an address", REAL: "a number", NONE: "None"}[
        OF_SCALAR[kind.code]
    ]


FITTING: dict[str, Any] = {
    "i8": (int, np.integer), "u8": (int, np.integer),
    "f8": (float, int, np.floating, np.integer), "none": type(None),
}  # fmt: skip


def fits(signature: Signature, args: tuple[Any, ...]) -> bool:
    """Check whether a signature accepts the arguments."""
    kinds = signature.arguments
    return len(kinds) == len(args) and all(map(_fits, kinds, args))


def _fits(kind: Kind, value: Any) -> bool:
    if isinstance(kind, Array):
        known = isinstance(value, np.ndarray) and value.dtype == kind.dtype
        ordered = known and value.flags.c_contiguous and value.flags.aligned
        return ordered and value.ndim == kind.ndim and (kind.read or value.flags.writeable)
    if isinstance(kind, Group):
        known = isinstance(value, tuple) and len(value) == len(kind.members)
        return known and all(map(_fits, kind.members, value))
    return isinstance(value, FITTING[kind.code])
