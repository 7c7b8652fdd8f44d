"""Questions and choices among lanes, so that one source serves numbers and lanes (lanes.py).

Such a source has `choose` for a branch, & and | for `and` and `or`. Both sides of a choice are computed: a lane that is
not chosen may hold anything, NaN included. A number beside lanes counts for all of them.
"""

import math
import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

from mpm_core.simd.lanes import LANES, Lanes, common_lanes


class LaneMask(types.Type):
    """LANES answers, yes or no."""

    def __init__(self):
        super().__init__(name="LaneMask")


MASK = LaneMask()


@register_model(LaneMask)
class _LaneMaskModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.VectorType(ir.IntType(1), LANES))


def _define(function, count: int, lower, answers: bool = False) -> None:
    """Let `function` take `count` lanes or numbers, and give lanes or answers: lower(builder, *values) -> value."""

    class Template(AbstractTemplate):
        def generic(self, args, kws):
            kind = common_lanes(args)
            return signature(MASK if answers else kind, *[kind] * count) if kind and len(args) == count else None

    infer_global(function)(type(f"_Lanes_{function.__name__}", (Template,), {}))
    lower_builtin(function, *[Lanes] * count)(lambda context, builder, sig, args: lower(builder, *args))


def _library(name: str):
    """A function of LLVM's."""

    def lower(builder, *values):
        vector = values[0].type
        called = f"llvm.{name}.v{LANES}{vector.element.intrinsic_name}"
        kind = ir.FunctionType(vector, [vector] * len(values))
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, called), values)

    return lower


def _comparison(sign: str):
    return lambda builder, a, b: builder.fcmp_ordered(sign, a, b)


for _operation, _sign in ((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">=")):
    _define(_operation, 2, _comparison(_sign), answers=True)
_define(min, 2, lambda builder, a, b: builder.select(builder.fcmp_ordered("<", b, a), b, a))
_define(max, 2, lambda builder, a, b: builder.select(builder.fcmp_ordered(">", b, a), b, a))
_define(operator.neg, 1, lambda builder, a: builder.fneg(a))
_define(abs, 1, _library("fabs"))
_define(math.sqrt, 1, _library("sqrt"))
_define(math.copysign, 2, _library("copysign"))


class _OfMasks(AbstractTemplate):
    def generic(self, args, kws):
        return signature(MASK, MASK, MASK) if tuple(args) == (MASK, MASK) else None


for _operation, _instruction in ((operator.and_, "and_"), (operator.or_, "or_")):
    infer_global(_operation)(type(f"_Masks_{_instruction}", (_OfMasks,), {}))
    lower_builtin(_operation, LaneMask, LaneMask)(
        lambda context, builder, sig, args, name=_instruction: getattr(builder, name)(*args)
    )


@intrinsic
def choose(typing, question, yes, no):
    """`yes` where the question is answered so, else `no`: numbers or lanes; two numbers become lanes of float64."""
    kind = common_lanes((yes, no)) or (Lanes(types.float64) if question == MASK else typing.unify_types(yes, no))

    def generate(context, builder, sig, args):
        return builder.select(*args)

    return kind(question, kind, kind), generate
