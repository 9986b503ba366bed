"""Tuples of arrays that compiled functions get by reference.

By value such a tuple is hundreds of arguments, and functions that take it compile slowly. A reference has the tuple's
attributes, read-only; tuples within tuples are references too. A reference does not keep the arrays alive. Arrays of a
function's arguments live until it returns. For other tuples, the function that makes the reference must call ``keep``.
"""

from __future__ import annotations

from typing import Any

from numba.core import cgutils, types
from numba.core.imputils import impl_ret_borrowed
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, models, register_model


class Reference(types.Type):
    """A pointer to a named tuple."""

    def __init__(self, target: Any) -> None:
        self.target = target
        super().__init__(name=f"Reference({target})")


@register_model(Reference)
class _ReferenceModel(models.PrimitiveModel):
    def __init__(self, manager: Any, reference: Any) -> None:
        super().__init__(manager, reference, manager.lookup(reference.target).get_value_type().as_pointer())


@infer_getattr
class _ReferenceAttributes(AttributeTemplate):
    key = Reference

    def generic_resolve(self, reference: Any, name: str) -> Any:
        target = reference.target
        if name not in target.fields:
            return None
        field = target[target.fields.index(name)]
        return Reference(field) if isinstance(field, types.BaseNamedTuple) else field


@lower_getattr_generic(Reference)
def _load(context: Any, builder: Any, reference: Any, pointer: Any, name: str) -> Any:
    position = reference.target.fields.index(name)
    field, address = reference.target[position], cgutils.gep_inbounds(builder, pointer, 0, position)
    if isinstance(field, types.BaseNamedTuple):
        return address
    return impl_ret_borrowed(context, builder, field, builder.load(address))


@intrinsic
def refer(typing_context: Any, target: Any) -> Any:
    """Return a reference to a named tuple, valid in this function and in those that it calls."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return cgutils.alloca_once_value(builder, arguments[0])

    return Reference(target)(target), generate


@intrinsic
def keep(typing_context: Any, target: Any) -> Any:
    """Keep a tuple's arrays alive until this line."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.get_dummy_value()

    return types.void(target), generate
