"""What numba makes of kernels.machine.references: the type of a reference, how its fields are read, calls of an address.

The layout of a table is that of kernels.machine.binding.
"""

from __future__ import annotations

from functools import cache
from inspect import Parameter, Signature, signature
from types import NoneType
from typing import Any

import numpy as np
from llvmlite import ir
from numba import from_dtype, typeof, types
from numba.core import cgutils
from numba.core.imputils import lower_getattr_generic, lower_setattr_generic
from numba.core.typing.templates import AttributeTemplate, make_intrinsic_template
from numba.extending import NativeValue, infer_getattr, models, register_model, typeof_impl, unbox

from hybrid.kernels.machine.references import Intrinsic, NamedNumbers, examples, is_array, key_of, layout_of

_WORD = ir.IntType(64)


class Reference(types.Type):
    """Type of a NamedTuple of a class that is kept by reference."""

    def __init__(self, of: type) -> None:
        self.of = of
        super().__init__(name=f"Reference({of.__module__}.{of.__qualname__})")


class Names(types.Type):
    """Type of the named numbers of a class: the address of the first."""

    def __init__(self, of: type[NamedNumbers]) -> None:
        self.of, self.dtype = of, from_dtype(np.dtype(of._number))
        super().__init__(name=f"Names({of.__module__}.{of.__qualname__})")


def type_of(value: Any) -> Any:
    """numba's type of a value, as an entry takes it."""
    return type_for(key_of(value))


def type_for(key: Any) -> Any:
    """numba's type for a key of kernels.machine.references."""
    if is_array(key):
        dtype, dimensions, flags = key
        layout, readonly, aligned = layout_of(flags)
        made: Any = types.Array  # its type knows of fewer layouts than it takes
        return made(from_dtype(dtype), dimensions, layout, readonly=readonly, aligned=aligned)
    if isinstance(key, tuple):
        return types.BaseTuple.from_types(tuple(map(type_for, key[1:])), key[0])
    if key in examples:
        return Reference(key)
    if issubclass(key, NamedNumbers):
        return Names(key)
    return types.none if key is NoneType else from_dtype(np.dtype(key))


@cache
def _fields_of(of: type) -> dict[str, tuple[int, Any]]:
    """Of a class: where each field begins in its table, and its type."""
    fields, at = {}, 0
    for name, value in examples[of]._asdict().items():
        kind = type_of(value)
        fields[name] = at, kind
        at += size(kind)
    return fields


def size(kind: Any) -> int:
    """Numbers of a table that a value of a type takes."""
    if isinstance(kind, Reference):
        return sum(size(x) for _, x in _fields_of(kind.of).values())
    if isinstance(kind, types.NamedTuple):
        return sum(size(x) for x in kind.types)
    return 1 + kind.ndim if isinstance(kind, types.Array) else 1 + isinstance(kind, Names)


def read_function(example: Any) -> Any:
    """What numba is told of kernels.machine.references.reader."""
    kind = Reference(type(example))

    def read(typingctx: Any, table: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return context.make_array(signature.args[0])(context, builder, args[0]).data

        return kind(table), generate

    return read


def rows_function(example: Any) -> Any:
    """What numba is told of kernels.machine.references.rows."""
    kind, of = types.Array(types.float64, 2, "C"), Reference(type(example))

    def rows(typingctx: Any, value: Any, at: Any, columns: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return _array(context, builder, kind, cgutils.gep_inbounds(builder, args[0], args[1]), 0, args[2])

        return kind(of, types.int64, types.int64), generate

    return rows


def call_function(returned: Any) -> Any:
    """What numba is told of kernels.machine.references.caller."""
    result = typeof(returned)

    def call(typingctx: Any, address: Any, table: Any) -> Any:
        return result(types.int64, table), _call

    return call


@cache
def _function_type(of: Intrinsic) -> Any:
    """The type of an intrinsic function."""
    told = globals()[of._what](of._example)
    return types.Function(make_intrinsic_template(of, told, told.__name__))


@typeof_impl.register(Intrinsic)
def _type_of_intrinsic(of: Intrinsic, _: Any) -> Any:
    return _function_type(of)


def _call(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    kinds = signature.args[1:]
    code = context.call_conv.get_function_type(signature.return_type, kinds).as_pointer()
    return _answer(context, builder, builder.inttoptr(args[0], code), signature.return_type, kinds, args[1:])


def _answer(context: Any, builder: Any, called: Any, returned: Any, kinds: Any, args: Any) -> Any:
    """What a kernel returns.  One fails where it calls another that cannot be compiled, and its caller with it."""
    status, found = context.call_conv.call_function(builder, called, returned, kinds, args)
    with cgutils.if_unlikely(builder, status.is_error):
        context.call_conv.return_status_propagate(builder, status)
    return found


@cache
def type_of_linked(of: Any) -> Any:
    """The type of a kernels.machine.compile.Linked.

    Its address stands in a variable of its name, 0 until it is asked for: kernels.machine.linked_code.
    """
    return types.Function(make_intrinsic_template(of, _linked_function(of), of.symbol))


def _linked_function(of: Any) -> Any:
    """What numba is told of a linked kernel."""
    returned, kinds = typeof(of.returned), tuple(map(type_of, of.arguments()))

    def call(typingctx: Any, *args: Any) -> Any:
        return returned(*kinds), generate

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        code = context.call_conv.get_function_type(returned, kinds).as_pointer()
        called = builder.inttoptr(_linked_address(builder, of.symbol), code)
        return _answer(context, builder, called, returned, kinds, args)

    names = ["typingctx", *signature(of.py_func).parameters]
    call.__signature__ = Signature([Parameter(x, Parameter.POSITIONAL_ONLY) for x in names])  # type: ignore[attr-defined]
    return call


def _linked_address(builder: Any, symbol: str) -> Any:
    """The address of a linked kernel, asked for where it is not known."""
    known = builder.module.globals.get(f"{symbol}.address")
    variable = known or ir.GlobalVariable(builder.module, _WORD, f"{symbol}.address")
    place = cgutils.alloca_once_value(builder, builder.load(variable))
    with cgutils.if_unlikely(builder, builder.icmp_signed("==", builder.load(place), _WORD(0))):
        find = cgutils.get_or_insert_function(builder.module, ir.FunctionType(_WORD, []), f"{symbol}.find")
        builder.store(builder.call(find, []), place)
    return builder.load(place)


@register_model(Reference)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _WORD.as_pointer())


@infer_getattr
class _Attributes(AttributeTemplate):
    key = Reference

    def generic_resolve(self, kind: Any, name: str) -> Any:  # type: ignore[override]
        return _fields_of(kind.of).get(name, (0, None))[1]


@lower_getattr_generic(Reference)
def _attribute(context: Any, builder: Any, kind: Any, table: Any, name: str) -> Any:
    at, field = _fields_of(kind.of)[name]
    return _built(context, builder, field, table, at)[0]


@register_model(Names)
class _NamesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, manager.lookup(kind.dtype).get_data_type().as_pointer())


@infer_getattr
class _Named(AttributeTemplate):
    key = Names

    def generic_resolve(self, kind: Any, name: str) -> Any:  # type: ignore[override]
        if name == "plain":
            return types.Array(kind.dtype, 1, "C")
        return kind.dtype if name in kind.of._fields else None


def _place(builder: Any, kind: Any, first: Any, name: str) -> Any:
    return cgutils.gep_inbounds(builder, first, kind.of._fields.index(name))


@lower_getattr_generic(Names)
def _named(context: Any, builder: Any, kind: Any, first: Any, name: str) -> Any:
    if name == "plain":
        return _plain(context, builder, kind, first)
    return builder.load(_place(builder, kind, first, name))


def _plain(context: Any, builder: Any, kind: Any, first: Any) -> Any:
    """All of them as an array."""
    of = types.Array(kind.dtype, 1, "C")
    array, size = context.make_array(of)(context, builder), context.get_constant
    item = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    shape, strides = [size(types.intp, len(kind.of._fields))], [size(types.intp, item)]
    context.populate_array(array, data=first, shape=shape, strides=strides, itemsize=item, meminfo=None)
    return array._getvalue()


@lower_setattr_generic(Names)
def _name(context: Any, builder: Any, sig: Any, args: Any, name: str) -> None:
    builder.store(args[1], _place(builder, sig.args[0], args[0], name))


@unbox(Names)
def _unboxed_numbers(kind: Any, value: Any, c: Any) -> NativeValue:
    """From Python; of which class they are has been looked at before (kernels.machine.references)."""
    of = types.Array(kind.dtype, 1, "C")
    native = c.unbox(of, value)
    return NativeValue(c.context.make_array(of)(c.context, c.builder, native.value).data, is_error=native.is_error)


def _built(context: Any, builder: Any, kind: Any, table: Any, at: int) -> tuple[Any, int]:
    """The value of a type from the table's numbers at `at` on, and where the next begins."""

    if isinstance(kind, Reference):
        return cgutils.gep_inbounds(builder, table, at), at + size(kind)
    if isinstance(kind, types.NamedTuple):
        values = []
        for each in kind.types:
            value, at = _built(context, builder, each, table, at)
            values.append(value)
        return context.make_tuple(builder, kind, values), at
    if isinstance(kind, types.Array):
        return _array(context, builder, kind, table, at), at + 1 + kind.ndim
    if isinstance(kind, Names):
        first = context.get_value_type(kind)
        return builder.inttoptr(_number(builder, table, at), first), at + 2
    value = _number(builder, table, at)
    if isinstance(kind, types.Float):
        value = builder.bitcast(value, context.get_data_type(types.float64))
    elif isinstance(kind, types.Boolean):
        value = builder.icmp_signed("!=", value, value.type(0))
    return value, at + 1


def _number(builder: Any, table: Any, k: int) -> Any:
    """Number k of a table."""
    found = builder.load(cgutils.gep_inbounds(builder, table, k))
    found.set_metadata("invariant.load", builder.module.add_metadata([]))  # no kernel writes to a table
    return found


def _array(context: Any, builder: Any, kind: Any, table: Any, at: int, columns: Any = None) -> Any:
    """The array whose address stands at `at`, before its shape; columns: of one whose shape may be without them."""
    array = context.make_array(kind)(context, builder)
    item = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    given = kind.ndim if columns is None else 1
    shape = [_number(builder, table, at + 1 + k) for k in range(given)]
    shape += [] if columns is None else [columns]
    strides = [context.get_constant(types.intp, item)]
    for length in shape[:0:-1]:
        strides.insert(0, builder.mul(strides[0], length))
    data = builder.inttoptr(_number(builder, table, at), array.data.type)
    context.populate_array(array, data=data, shape=shape, strides=strides, itemsize=item, meminfo=None)
    return array._getvalue()


@unbox(Reference)
def _unboxed(kind: Any, value: Any, c: Any) -> NativeValue:
    """From Python: the table is made on the stack, for the call."""
    builder = c.builder
    table = cgutils.alloca_once(builder, _WORD, size=size(kind))
    failed = cgutils.alloca_once_value(builder, cgutils.false_bit)
    for k, (at, field) in enumerate(_fields_of(kind.of).values()):
        native = c.unbox(field, c.pyapi.tuple_getitem(value, k))
        with cgutils.if_unlikely(builder, native.is_error):
            builder.store(cgutils.true_bit, failed)
        for j, number in enumerate(_numbers(c.context, builder, field, native.value)):
            builder.store(number, cgutils.gep_inbounds(builder, table, at + j))
    # The optimiser must not know that the table was written to: it is read as if that had never been.
    same = ir.FunctionType(table.type, [table.type])
    hidden = builder.asm(same, "", "=r,0,~{memory}", [table], side_effect=True)
    return NativeValue(hidden, is_error=builder.load(failed))


def _numbers(context: Any, builder: Any, kind: Any, value: Any) -> list[Any]:
    """What a table holds of an array, a number or a NamedTuple by reference."""
    if isinstance(kind, Reference):
        return [builder.load(cgutils.gep_inbounds(builder, value, k)) for k in range(size(kind))]
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        return [builder.ptrtoint(array.data, _WORD), *cgutils.unpack_tuple(builder, array.shape)]
    if isinstance(kind, Names):
        return [builder.ptrtoint(value, _WORD), _WORD(len(kind.of._fields))]
    if isinstance(kind, types.Float):
        return [builder.bitcast(value, _WORD)]
    if isinstance(kind, types.Boolean):
        return [builder.zext(value, _WORD)]
    return [value]
