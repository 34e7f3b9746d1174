"""Field types of the configuration: numbers that may be written as expressions, names, poles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, ClassVar, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import PydanticCustomError

from hgorun.config.expressions import ExpressionError, check_name, nearest, parse
from hgorun.config.nearest import listed
from hgorun.config.separators import misread
from hgorun.config.tokens import DECIMAL_POINT, ends_a_number
from hgorun.errors import printable

SEEDS = 2**63
"""How many seeds there are, from 0 on."""
_COMMA = f"{DECIMAL_POINT[0].upper()}{DECIMAL_POINT[1:]}"


class Block(BaseModel):
    """A mapping of the configuration: unknown keys are errors, values do not change."""

    # built when first used: most blocks are only ever parts of others, or what others are derived from
    model_config = ConfigDict(extra="forbid", frozen=True, protected_namespaces=(), defer_build=True)
    written_as: ClassVar[str] = ""
    """What may be written where something else than a mapping was found."""
    read_before: ClassVar[tuple[str, ...]] = ()
    """Keys of the mapping that are taken out of it before it is checked: known to a reader of messages."""
    together: ClassVar[frozenset[object]] = frozenset()
    """Keys that are not known here, and of which one message says what is to be said of all."""

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: object) -> Any:
        if isinstance(data, cls):
            return data
        fields = cls.model_fields
        if not isinstance(data, dict):
            raise PydanticCustomError(
                "not_a_mapping",
                "expected a mapping with keys {keys}; found {found}{example}",
                {
                    "keys": listed(cls._keys()),
                    "found": describe(data),
                    "example": _example(cls.written_as, data),
                },
            )
        wrong = [key for key in data if key not in fields or data[key] is None]
        if wrong:
            first, *others = wrong
            told = [key for key in others if not {first, key} <= cls.together]
            kind = data.get("type") if "type" in fields and fields["type"].is_required() else None
            of_others = [cls._wrong(key, data[key]) for key in told]
            raise cls._wrong(first, data[first], of_others, kind if isinstance(kind, str) else "")
        return data

    @classmethod
    def _wrong(
        cls, key: object, value: object, others: Sequence[PydanticCustomError] | None = None, kind: str = ""
    ) -> PydanticCustomError:
        """That a key is not known, or has no value; the first of a block, which has others, says what is known.

        ``kind`` is what the block is called in lists.
        """
        if key in cls.model_fields:
            return PydanticCustomError("no_value", "this key has no value", {"key": key, "others": others or ()})
        known = cls._keys()
        inside = f" {_COMMA}." if ends_a_number(str(key)) else cls._inside(key, value)
        return PydanticCustomError(
            "unknown_key",
            "{name} stands at the top of a file, and is not a key of a single run"
            if key in cls.read_before
            else "unknown key {name}.{hint}"
            if others is None
            else "unknown key {name}.{hint} Known here: {keys}",
            {
                "key": key,
                "name": repr(key),
                "hint": inside or nearest(str(key), known),
                "keys": listed(known, str(key), kind and f"hgorun show {kind}"),
                "others": others or (),
            },
        )

    @classmethod
    def _inside(cls, key: object, value: object) -> str:
        """That a key belongs into blocks below this one, where it does."""
        fields = cls.model_fields.items()
        having = [
            f"`{name}`" for name, one in fields if any(key in block.model_fields for block in _blocks(one.annotation))
        ]
        return (
            f" It is a key of {' and '.join(filter(None, (', '.join(having[:-1]), *having[-1:])))}." if having else ""
        )

    @classmethod
    def _keys(cls) -> tuple[str, ...]:
        """All keys that are known here."""
        return tuple(dict.fromkeys((*cls.model_fields, *cls.read_before)))


def _example(written_as: str, found: object) -> str:
    """What to write where a mapping was expected."""
    remedy = misread(found) if isinstance(found, str) else ""
    return f"; {remedy}" if remedy else f"; write {written_as}" if written_as else ""


def _blocks(annotation: object) -> Iterator[type[Block]]:
    """The blocks that the value of a key may be, or may hold."""
    if isinstance(annotation, type) and issubclass(annotation, Block):
        yield annotation
    for part in get_args(annotation):
        yield from _blocks(part)


def number(value: object) -> float:
    """A finite float from a number or from an expression of numbers and constants."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"expected a number or an expression of numbers, found {describe(value)}")
    return parse(value, names=()).number()


def describe(value: object) -> str:
    """What was found, for a message."""
    if value is None:
        return "nothing"
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, (list, tuple)):
        return "a list"
    text = printable(repr(value))
    return text if len(text) <= 60 else text[:57] + "..."


def word_or(words: Sequence[str], kinds: tuple[type, ...], *others: str) -> BeforeValidator:
    """Say all that a key may be where a value is neither one of its words nor of the other kind that it has.

    Parameters
    ----------
    words : sequence of str
    kinds : tuple of type
        Of values that are no words, which are checked further.
    *others : str
        How these are written.
    """
    *first, last = (*words, *others)
    every = f"{', '.join(first)} or {last}"

    def checked(value: object) -> object:
        if (isinstance(value, kinds) and not isinstance(value, bool)) or (isinstance(value, str) and value in words):
            return value
        near = nearest(value, words) if isinstance(value, str) else ""
        raise ValueError(f"expected {every}, found {describe(value)}{near and f'.{near}'}")

    return BeforeValidator(checked)


def expression(value: object) -> str:
    """An expression as text, from text or a number."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"expected an expression (text or a number), found {describe(value)}")
    parse(value)
    return value if isinstance(value, str) else repr(float(value))


def _name(value: object) -> str:
    if not isinstance(value, str):
        raise ValueError(f"expected a name, found {describe(value)}")
    check_name(value)
    return value


def _pole(value: object) -> complex:
    if isinstance(value, str):
        try:
            return complex(value.replace(" ", "").replace("i", "j"))
        except ValueError:
            pass
    elif isinstance(value, complex):
        return value
    try:
        return complex(number(value))
    except (ValueError, ExpressionError) as error:
        raise ValueError(f'a pole is a number or text such as "-1+2j", found {describe(value)}') from error


def _poles(value: object) -> complex | tuple[complex, ...]:
    given: Sequence[object] = value if isinstance(value, Sequence) and not isinstance(value, str) else [value]
    poles = tuple(map(_pole, given))
    for pole in poles:
        if not (math.isfinite(pole.real) and math.isfinite(pole.imag)):
            raise ValueError(f"poles must be finite, found {pole}")
        if pole.real >= 0:
            raise ValueError(f"poles must have a negative real part, found {pole_text(pole)}")
        if poles.count(pole) != poles.count(pole.conjugate()):
            raise ValueError(f"complex poles come in conjugate pairs: {pole_text(pole)} has no partner")
    return poles if given is value else poles[0]


def pole_text(pole: complex) -> str:
    """A pole as it is written in a configuration."""
    return f"{pole.real:g}" if pole.imag == 0 else f"{pole.real:g}{pole.imag:+g}j"


NUMBER_SCHEMA = {"anyOf": [{"type": "number"}, {"type": "string"}]}


def _above(limit: str) -> dict[str, Any]:
    return {"anyOf": [{"type": "number", limit: 0}, {"type": "string"}]}


def _absolute(value: Any) -> Any:
    """A standard deviation is no part of a value."""
    if isinstance(value, str) and "%" in value:
        raise ValueError(f"{value}: std is absolute, in the model's unit: give the noise of a usual value")
    return value


Number = Annotated[float, BeforeValidator(number), WithJsonSchema(NUMBER_SCHEMA)]
Positive = Annotated[float, BeforeValidator(number), Field(gt=0), WithJsonSchema(_above("exclusiveMinimum"))]
Absolute = Annotated[Positive, BeforeValidator(_absolute)]
NonNegative = Annotated[float, BeforeValidator(number), Field(ge=0), WithJsonSchema(_above("minimum"))]
Window = tuple[Number, Number]
ExpressionText = Annotated[str, BeforeValidator(expression), WithJsonSchema(NUMBER_SCHEMA)]
Name = Annotated[str, BeforeValidator(_name)]
Poles = Annotated[
    complex | tuple[complex, ...],
    BeforeValidator(_poles),
    WithJsonSchema({"anyOf": [*NUMBER_SCHEMA["anyOf"], {"type": "array", "items": NUMBER_SCHEMA}]}),
]


def _ordered(value: tuple[float, float]) -> tuple[float, float]:
    if not value[0] < value[1]:
        raise ValueError(f"expected [low, high] with low < high, found [{value[0]:g}, {value[1]:g}]")
    return value


def _nonempty(value: tuple[Any, ...]) -> tuple[Any, ...]:
    if not value:
        raise ValueError("expected at least one entry, found an empty list")
    return value


# Not min_length: pydantic would then report entries that are wrong as missing.
NonEmpty = AfterValidator(_nonempty)


def _no_bound(value: object) -> object:
    """One number is no interval; a bound of an absolute value may be meant."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        bound = abs(value) or 1
        raise ValueError(f"expected [low, high], such as [{-bound:g}, {bound:g}], found {value:g}")
    return value


Interval = Annotated[tuple[Number, Number], BeforeValidator(_no_bound), AfterValidator(_ordered)]
