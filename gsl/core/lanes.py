"""Lanes: eight numbers side by side, with which compiled code computes as it does with one number.

A compiled function that adds, multiplies, compares by `where` and so on knows no difference between a float and lanes:
what it gets is what it computes with, so one source serves one robot and eight at once. The eight fill a register of
AVX-512 or two of AVX2, and every lane has the bits that it would have alone.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model
from numba.np.arrayobj import make_array, populate_array

from gsl.core.compiled import compile_kernel

LANES = 8  # a replay window by window takes 5 to 6.7 times as long; 6 x 6 products by a plain trailing axis 4.5 times
_PLAIN = (types.Float, types.Integer)


def where(condition: bool, yes: float, no: float) -> float:
    """Return `yes` or `no`, both of which are computed; lane by lane in compiled code."""
    return yes if condition else no


@compile_kernel
def zeros_in_lanes(first: int, second: int) -> np.ndarray:
    """Return zeros for `side_by_side`, shape (first, second, LANES), such that no eight lie across two cache lines."""
    raw = np.zeros(first * second * LANES + LANES - 1)
    start = (-raw.ctypes.data // raw.itemsize) % LANES
    return raw[start : start + first * second * LANES].reshape((first, second, LANES))


def _side_by_side(typing_context: Any, array: Any) -> Any:
    """Return an array of floats (..., LANES) as an array of lanes (...); what is written to one is in both."""
    result = types.Array(lanes, array.ndim - 1, "C", aligned=False)

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        whole, made = make_array(array)(context, builder, arguments[0]), make_array(result)(context, builder)
        populate_array(
            made,
            data=builder.bitcast(whole.data, context.get_data_type(lanes).as_pointer()),
            shape=cgutils.unpack_tuple(builder, whole.shape)[:-1],
            strides=cgutils.unpack_tuple(builder, whole.strides)[:-1],
            itemsize=context.get_constant(types.intp, 8 * LANES),
            meminfo=whole.meminfo,
            parent=whole.parent,
        )
        context.nrt.incref(builder, array, arguments[0])
        return made._getvalue()

    return result(array), generate


side_by_side: Any = intrinsic(_side_by_side)


class _Lanes(types.Type):
    def can_convert_from(self, typing_context: Any, other: Any) -> Any:
        return Conversion.safe if isinstance(other, _PLAIN) else None


class _Mask(types.Type):
    """What comparisons of lanes tell."""


lanes, mask = _Lanes("lanes"), _Mask("mask")
_VECTOR, _BITS = ir.VectorType(ir.DoubleType(), LANES), ir.VectorType(ir.IntType(1), LANES)


@register_model(_Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)


@register_model(_Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _BITS)


@lower_cast(types.Float, lanes)
@lower_cast(types.Integer, lanes)
def _spread(context: Any, builder: Any, kind: Any, _: Any, value: Any) -> Any:
    nothing, order = ir.Constant(_VECTOR, ir.Undefined), ir.VectorType(ir.IntType(32), LANES)
    value = context.cast(builder, value, kind, types.float64)
    first = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, nothing, ir.Constant(order, [0] * LANES))


def _define(function: Any, result: Any, arguments: int, build: Callable[..., Any]) -> None:
    """Teach numba a function of lanes; a plain number among them stands for eight equal numbers."""

    class Typing(AbstractTemplate):
        key = function

        def generic(self, types_of: Any, named: Any) -> Any:
            fits = len(types_of) == arguments and all(kind == lanes or isinstance(kind, _PLAIN) for kind in types_of)
            return signature(result, *[lanes] * arguments) if fits and lanes in types_of else None

    infer_global(function, types.Function(Typing))
    lower_builtin(function, *[lanes] * arguments)(lambda context, builder, _, values: build(context, builder, *values))


def _operation(name: str) -> Callable[..., Any]:
    return lambda context, builder, *values: getattr(builder, name)(*values)


def _comparison(sign: str) -> Callable[..., Any]:
    return lambda context, builder, a, b: builder.fcmp_ordered(sign, a, b)


def _find_call(name: str) -> Callable[..., Any]:
    """Return what calls a function of LLVM."""

    def build(context: Any, builder: Any, a: Any) -> Any:
        kind = ir.FunctionType(_VECTOR, [_VECTOR])
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64"), [a])

    return build


def _better(sign: str) -> Callable[..., Any]:
    """Return minimum or maximum as Python has it: the first of two that are equal or no numbers."""
    return lambda context, builder, a, b: builder.select(builder.fcmp_ordered(sign, b, a), b, a)


def _one_by_one(function: Any) -> Callable[..., Any]:
    def build(context: Any, builder: Any, values: Any) -> Any:
        call = context.get_function(function, signature(types.float64, types.float64))
        for k in range(LANES):
            place = ir.Constant(ir.IntType(32), k)
            values = builder.insert_element(values, call(builder, [builder.extract_element(values, place)]), place)
        return values

    return build


for _plain, _in_place, _name in (
    (operator.add, operator.iadd, "fadd"),
    (operator.sub, operator.isub, "fsub"),
    (operator.mul, operator.imul, "fmul"),
    (operator.truediv, operator.itruediv, "fdiv"),
):
    _define(_plain, lanes, 2, _operation(_name))
    _define(_in_place, lanes, 2, _operation(_name))
for _compare, _sign in (
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.eq, "=="),
):
    _define(_compare, mask, 2, _comparison(_sign))
_define(operator.ne, mask, 2, lambda _, builder, a, b: builder.fcmp_unordered("!=", a, b))
_define(operator.neg, lanes, 1, _operation("fneg"))
for _absolute in (abs, np.abs):
    _define(_absolute, lanes, 1, _find_call("fabs"))
_define(np.rint, lanes, 1, _find_call("rint"))
_define(np.sqrt, lanes, 1, _find_call("sqrt"))
for _function in (np.sign, np.exp, np.log, np.sin, np.cos, np.tan, np.tanh, np.arctan):
    _define(_function, lanes, 1, _one_by_one(_function))
_define(min, lanes, 2, _better("<"))
_define(max, lanes, 2, _better(">"))


@infer_global(operator.pow)
class _Power(AbstractTemplate):
    def generic(self, types_of: Any, named: Any) -> Any:
        if len(types_of) != 2 or types_of[0] != lanes or not isinstance(types_of[1], types.IntegerLiteral):
            return None
        return signature(lanes, *types_of) if types_of[1].literal_value >= 0 else None


@lower_builtin(operator.pow, lanes, types.IntegerLiteral)
def _multiply(context: Any, builder: Any, kinds: Any, values: Any) -> Any:
    """Multiply in the order in which numba does it with one number."""
    result, square, left = ir.Constant(_VECTOR, [1.0] * LANES), values[0], kinds.args[1].literal_value
    while left:
        if left & 1:
            result = builder.fmul(result, square)
        left >>= 1
        square = builder.fmul(square, square)
    return result


@infer_global(where)
class _Where(AbstractTemplate):
    def generic(self, types_of: Any, named: Any) -> Any:
        kind = lanes if lanes in types_of or types_of[0] == mask else types.float64
        return signature(kind, types_of[0], kind, kind)


@lower_builtin(where, mask, lanes, lanes)
@lower_builtin(where, types.boolean, lanes, lanes)
@lower_builtin(where, types.boolean, types.float64, types.float64)
def _select(context: Any, builder: Any, _: Any, values: Any) -> Any:
    return builder.select(*values)
