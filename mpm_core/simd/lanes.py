"""Eight numbers side by side in a vector register, as a type that numba kernels can calculate with and compare.

LLVM turns a loop over a few places into vector instructions only if it can prove that no two arrays overlap, which it
cannot in kernels as large as the elastic operator's. Here the vector instructions are written explicitly.
On a processor with shorter registers LLVM takes several of them.

A point (a row of a nodal array) takes 4 numbers in 3-D, the last one always 0, and 2 in 2-D: then it is read and
written as one piece and turned by shuffles. Multiplication followed by addition may be fused (one rounding).

Comparison and selection make one source serve numbers and lanes. Such a source has `choose` for a branch, & and | for
`and` and `or`. Both sides of a choice are computed: a lane that is not chosen may hold anything, NaN included. A number
together with lanes counts for all of them.
"""

import math
import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model

LANES = 8
POINT_WIDTH = {2: 2, 3: 4}
"""by dimension: numbers per row of a nodal array"""

_INDEX = ir.IntType(32)


class Lanes(types.Type):
    """LANES numbers of one type (float64 or float32)."""

    def __init__(self, element):
        self.element = element
        super().__init__(name=f"Lanes({element})")


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.VectorType(manager.lookup(kind.element).get_value_type(), LANES))


@lower_cast(types.Number, Lanes)
def _spread(context, builder, source, target, value):
    """One number for all lanes."""
    value = context.cast(builder, value, source, target.element)
    single = builder.insert_element(ir.Constant(context.get_value_type(target), ir.Undefined), value, _INDEX(0))
    return _shuffle(builder, single, single, [0] * LANES)


def common_lanes(kinds) -> Lanes | None:
    """The type of lanes among these types, where all others are that too or numbers for all lanes."""
    lanes = {kind for kind in kinds if isinstance(kind, Lanes)}
    others = [kind for kind in kinds if not isinstance(kind, Lanes | types.Number)]
    return lanes.pop() if len(lanes) == 1 and not others else None


class _Elementwise(AbstractTemplate):
    def generic(self, args, kws):
        kind = common_lanes(args)
        return signature(kind, kind, kind) if kind and len(args) == 2 else None


def _define(operation, instruction: str) -> None:
    def lower(context, builder, sig, args):
        return getattr(builder, instruction)(*args, flags=("contract",))

    infer_global(operation)(type(f"_Lanes_{instruction}", (_Elementwise,), {}))
    lower_builtin(operation, Lanes, Lanes)(lower)


for _operations, _instruction in (
    ((operator.add, operator.iadd), "fadd"),
    ((operator.sub, operator.isub), "fsub"),
    ((operator.mul, operator.imul), "fmul"),
    ((operator.truediv, operator.itruediv), "fdiv"),
):
    for _operation in _operations:
        _define(_operation, _instruction)


def _element_pointer(context, builder, array_type, array, index):
    return builder.gep(context.make_array(array_type)(context, builder, array).data, [index])


def _alignment(context, array_type) -> int:
    return context.get_abi_sizeof(context.get_value_type(array_type.dtype))


def _shuffle(builder, first, second, order):
    return builder.shuffle_vector(first, second, ir.Constant(ir.VectorType(_INDEX, len(order)), list(order)))


@intrinsic
def load(typing, array, start):
    """The numbers array[start : start + LANES] of a flat array."""
    kind = Lanes(array.dtype)

    def generate(context, builder, sig, args):
        pointer = _element_pointer(context, builder, sig.args[0], args[0], args[1])
        value = builder.load(builder.bitcast(pointer, context.get_value_type(kind).as_pointer()))
        value.align = _alignment(context, sig.args[0])
        return value

    return kind(array, types.intp), generate


@intrinsic(prefer_literal=True)
def load_row(typing, array, start, length):
    """`length` (a constant) times LANES numbers of a flat array, one after the other from `start`, as a tuple."""
    kind = types.UniTuple(Lanes(array.dtype), length.literal_value)

    def generate(context, builder, sig, args):
        start = context.cast(builder, args[1], sig.args[1], types.intp)
        values = []
        for number in range(kind.count):
            place = builder.add(start, context.get_constant(types.intp, number * LANES))
            pointer = _element_pointer(context, builder, sig.args[0], args[0], place)
            value = builder.load(builder.bitcast(pointer, context.get_value_type(kind.dtype).as_pointer()))
            value.align = _alignment(context, sig.args[0])
            values.append(value)
        return context.make_tuple(builder, kind, values)

    return kind(array, start, length), generate


@intrinsic
def store(typing, array, start, value):
    """Write the numbers to array[start : start + LANES] of a flat array."""

    def generate(context, builder, sig, args):
        pointer = _element_pointer(context, builder, sig.args[0], args[0], args[1])
        pointer = builder.bitcast(pointer, args[2].type.as_pointer())
        builder.store(args[2], pointer, align=_alignment(context, sig.args[0]))
        return context.get_dummy_value()

    return types.void(array, types.intp, value), generate


@intrinsic
def fill(typing, array, value):
    """LANES copies of one number, of the type of `array`'s elements."""
    kind = Lanes(array.dtype)

    def generate(context, builder, sig, args):
        vector = context.get_value_type(kind)
        single = builder.insert_element(ir.Constant(vector, ir.Undefined), args[1], _INDEX(0))
        return _shuffle(builder, single, single, [0] * LANES)

    return kind(array, array.dtype), generate


@intrinsic
def prefetch(typing, array, index):
    """Ask the processor to bring array[index] of a flat array into its cache; changes nothing."""

    def generate(context, builder, sig, args):
        pointer = _element_pointer(context, builder, sig.args[0], args[0], args[1])
        pointer = builder.bitcast(pointer, ir.IntType(8).as_pointer())
        kind = ir.FunctionType(ir.VoidType(), [pointer.type, _INDEX, _INDEX, _INDEX])
        instruction = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
        builder.call(instruction, [pointer, _INDEX(0), _INDEX(3), _INDEX(1)])  # to read, to stay, data
        return context.get_dummy_value()

    return types.void(array, types.intp), generate


def _point_pointers(context, builder, sig, args, width):
    """Pointers to the rows table[start : start + LANES] of a flat nodal array."""
    data = context.make_array(sig.args[0])(context, builder, args[0]).data
    place = _element_pointer(context, builder, sig.args[1], args[1], args[2])
    point = ir.VectorType(context.get_value_type(sig.args[0].dtype), width).as_pointer()
    pointers = []
    for lane in range(LANES):
        row = builder.sext(builder.load(builder.gep(place, [_INDEX(lane)])), ir.IntType(64))
        element = builder.mul(row, ir.IntType(64)(width))
        pointers.append(builder.bitcast(builder.gep(data, [element]), point))
    return pointers


def _joined(builder, parts):
    """Vectors one after the other in one vector."""
    while len(parts) > 1:
        whole = range(2 * parts[0].type.count)
        parts = [_shuffle(builder, *parts[i : i + 2], whole) for i in range(0, len(parts), 2)]
    return parts[0]


def _low_pairs(start):
    """Elements start and start + 1 of every four, of two vectors in turn."""
    return [e for four in range(0, LANES, 4) for e in (four + start, four + start + 1, four + start + LANES,
                                                       four + start + 1 + LANES)]  # fmt: skip


def _alternate(start):
    """Elements start and start + 2 of every four, alternately from two vectors."""
    return [e for four in range(0, LANES, 4) for e in (four + start, four + start + LANES, four + start + 2,
                                                       four + start + 2 + LANES)]  # fmt: skip


@intrinsic
def gather_points_3(typing, array, table, start):
    """Components x, y, z of the rows table[start : start + LANES] of a flat nodal array."""
    kind = types.UniTuple(Lanes(array.dtype), 3)

    def generate(context, builder, sig, args):
        points = []
        for pointer in _point_pointers(context, builder, sig, args, POINT_WIDTH[3]):
            points.append(builder.load(pointer))
            points[-1].align = _alignment(context, sig.args[0])
        first, second, third, fourth = (_joined(builder, points[k::4]) for k in range(4))
        even = _shuffle(builder, first, second, _alternate(0)), _shuffle(builder, third, fourth, _alternate(0))
        odd = _shuffle(builder, first, second, _alternate(1)), _shuffle(builder, third, fourth, _alternate(1))
        x, y, z = (_shuffle(builder, *pair, _low_pairs(k)) for pair, k in ((even, 0), (odd, 0), (even, 2)))
        return context.make_tuple(builder, kind, [x, y, z])

    return kind(array, table, types.intp), generate


@intrinsic
def add_to_points_3(typing, array, table, start, x, y, z):
    """Add to the rows table[start : start + LANES] of a flat nodal array, lane by lane: a row may come twice."""

    def generate(context, builder, sig, args):
        x, y, z = args[3:]
        nothing = ir.Constant(x.type, None)
        even = _shuffle(builder, x, y, _alternate(0)), _shuffle(builder, z, nothing, _alternate(0))
        odd = _shuffle(builder, x, y, _alternate(1)), _shuffle(builder, z, nothing, _alternate(1))
        fours = [_shuffle(builder, *pair, _low_pairs(k)) for pair, k in ((even, 0), (odd, 0), (even, 2), (odd, 2))]
        align = _alignment(context, sig.args[0])
        for lane, pointer in enumerate(_point_pointers(context, builder, sig, args, POINT_WIDTH[3])):
            four = fours[lane % 4]
            before = builder.load(pointer)
            before.align = align
            share = _shuffle(builder, four, four, range(4 * (lane // 4), 4 * (lane // 4) + 4))
            builder.store(builder.fadd(before, share), pointer, align=align)
        return context.get_dummy_value()

    return types.void(array, table, types.intp, x, y, z), generate


@intrinsic
def gather_points_2(typing, array, table, start):
    """Components x, y of the rows table[start : start + LANES] of a flat nodal array."""
    kind = types.UniTuple(Lanes(array.dtype), 2)

    def generate(context, builder, sig, args):
        points = []
        for pointer in _point_pointers(context, builder, sig, args, POINT_WIDTH[2]):
            points.append(builder.load(pointer))
            points[-1].align = _alignment(context, sig.args[0])
        low, high = _joined(builder, points[: LANES // 2]), _joined(builder, points[LANES // 2 :])
        parts = [_shuffle(builder, low, high, range(k, 2 * LANES, 2)) for k in range(2)]
        return context.make_tuple(builder, kind, parts)

    return kind(array, table, types.intp), generate


@intrinsic
def add_to_points_2(typing, array, table, start, x, y):
    """Add to the rows table[start : start + LANES] of a flat nodal array, lane by lane."""

    def generate(context, builder, sig, args):
        align = _alignment(context, sig.args[0])
        for lane, pointer in enumerate(_point_pointers(context, builder, sig, args, POINT_WIDTH[2])):
            before = builder.load(pointer)
            before.align = align
            share = _shuffle(builder, args[3], args[4], [lane, lane + LANES])
            builder.store(builder.fadd(before, share), pointer, align=align)
        return context.get_dummy_value()

    return types.void(array, table, types.intp, x, y), generate


class LaneMask(types.Type):
    """LANES answers, yes or no."""

    def __init__(self):
        super().__init__(name="LaneMask")


MASK = LaneMask()


@register_model(LaneMask)
class _LaneMaskModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.VectorType(ir.IntType(1), LANES))


def _define_for_lanes(function, count: int, lower, answers: bool = False) -> None:
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
    _define_for_lanes(_operation, 2, _comparison(_sign), answers=True)
_define_for_lanes(min, 2, lambda builder, a, b: builder.select(builder.fcmp_ordered("<", b, a), b, a))
_define_for_lanes(max, 2, lambda builder, a, b: builder.select(builder.fcmp_ordered(">", b, a), b, a))
_define_for_lanes(operator.neg, 1, lambda builder, a: builder.fneg(a))
_define_for_lanes(abs, 1, _library("fabs"))
_define_for_lanes(math.sqrt, 1, _library("sqrt"))
_define_for_lanes(math.copysign, 2, _library("copysign"))


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
