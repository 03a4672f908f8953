"""What a message is: a frozen dataclass whose fields carry their units; the list of all.

Everything else about a message (its bytes, the check on arrival, its JSON schema, the table
in proto/README.md) is derived from this one definition.
"""

from __future__ import annotations

from dataclasses import MISSING, FrozenInstanceError, dataclass, field, fields
from typing import (
    Annotated,
    Any,
    NoReturn,
    TypeVar,
    cast,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Unit:
    """Unit of a field, what the field means, and the names of its parts if it is an array."""

    unit: str
    meaning: str = ""
    parts: tuple[str, ...] = ()


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def _layout(cls: type[T]) -> type[T]:
    """Fields, slots, comparison and text of a dataclass; neither a constructor nor a lock."""
    return dataclass(slots=True, unsafe_hash=True, init=False)(cls)


@_layout
class Message:
    """What every sample says first: when it was measured, and its number on its key."""

    stamp: Annotated[int, Unit("ns", "when it was measured: UNIX epoch on the robot's clock")]
    seq: Annotated[int, Unit("1", "number of this sample on its key")] = field(
        default=0, kw_only=True
    )


@dataclass(frozen=True, slots=True)
class FieldSpec:
    """One field of a message, as read from its annotation.

    `kind` is the bare Python type, `length` the fixed number of parts of an array (None for a
    scalar and for an array of open length), `required` whether the wire must carry it.
    """

    name: str
    kind: Any
    unit: Unit
    length: int | None
    required: bool


MESSAGES: dict[str, type[Message]] = {}
"""Every message class by name; the name is its version."""

M = TypeVar("M", bound=Message)


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def message(cls: type[M]) -> type[M]:
    """Make `cls` a message: frozen, slotted, and listed in MESSAGES.

    One of the same name and fields, of another node's file, is the same class; TypeError if its
    fields are others.
    """
    made = unlisted(cls)
    known = MESSAGES.setdefault(made.__name__, made)
    if field_specs(known) != field_specs(made):
        raise TypeError(f"there is a message class {made.__name__} already, with other fields")
    return cast(type[M], known)


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def unlisted(cls: type[M]) -> type[M]:
    """The same, but known to nobody by its name. ValueError for a field whose name starts with _.

    Such names are those of the code that is generated for a class.
    """
    for name in vars(cls).get("__annotations__", ()):
        if name.startswith("_"):
            raise ValueError(f"{cls.__name__}.{name}: a field's name begins with a letter")
    made = _frozen(_layout(cls))
    field_specs(made)
    return made


def _frozen(layout: type[M]) -> type[M]:
    """A class of the same layout whose instances do not change once they are made.

    While one is being made it belongs to the open class below: a frozen dataclass goes the long
    way round for each field, and samples are made some thousand times a second.
    """
    items = fields(layout)
    names: dict[str, Any] = {"_layout": layout, "_become": object.__setattr__}
    words: dict[bool, list[str]] = {True: [], False: []}  # by keyword only, or not
    for item in items:
        default = "" if item.default is MISSING else f"=_d_{item.name}"
        words[item.kw_only is True].append(item.name + default)
        names[f"_d_{item.name}"] = item.default
    lines = [
        f"def made(_self, {', '.join([*words[False], '*', *words[True]])}):",
        " _become(_self, '__class__', _layout)",
        *(f" _self.{item.name} = {item.name}" for item in items),
        " _self.__class__ = _frozen",
    ]
    exec("\n".join(lines), names)  # noqa: S102 - our own field names, as dataclasses does
    names["made"].__qualname__ = f"{layout.__name__}.__init__"  # as who forgets a field is told
    frozen: type[M] = type(
        layout.__name__,
        (layout,),
        {
            "__doc__": layout.__doc__,
            "__module__": layout.__module__,
            "__qualname__": layout.__qualname__,
            "__slots__": (),
            "__init__": names["made"],
            "__setattr__": _refuse,
            "__delattr__": _refuse,
            "__reduce__": _reduce,
        },
    )
    names["_frozen"] = frozen
    return frozen


def _refuse(self: Message, name: str, *_value: object) -> NoReturn:
    raise FrozenInstanceError(f"{type(self).__name__} is not changed once it is made: {name}")


def _reduce(self: Message) -> tuple[Any, ...]:
    return _remake, (type(self), {item.name: getattr(self, item.name) for item in fields(self)})


def _remake(cls: type[Message], values: dict[str, Any]) -> Message:
    return cls(**values)


def field_specs(cls: type[Message]) -> tuple[FieldSpec, ...]:
    """Fields of a message class in wire order; TypeError where one carries no unit."""
    if cls not in _specs:
        _specs[cls] = _read_specs(cls)
    return _specs[cls]


_specs: dict[type[Message], tuple[FieldSpec, ...]] = {}


def _read_specs(cls: type[Message]) -> tuple[FieldSpec, ...]:
    hints = get_type_hints(cls, include_extras=True)
    specs = []
    for item in fields(cls):
        kind, *notes = get_args(hints[item.name]) or (None,)
        units = [note for note in notes if isinstance(note, Unit)]
        if not units:
            raise TypeError(f"{cls.__name__}.{item.name} carries no unit")
        parts = get_args(kind) if get_origin(kind) is tuple else ()
        length = len(parts) if parts and parts[-1] is not Ellipsis else None
        required = item.default is MISSING and item.default_factory is MISSING
        specs.append(FieldSpec(item.name, kind, units[-1], length, required))
    return tuple(specs)
