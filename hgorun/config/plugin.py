"""Classes that anybody may write: a method of one that fails, or returns something wrong, is named.

hgorun calls methods that it has not written. Here, in one place, each of them is wrapped when its class is made.
Classes of hgorun's own are left as they are: a check of every value that they return would cost as much as a short run.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, cached_property, wraps
from inspect import getattr_static
from numbers import Real
from pathlib import Path
from types import FunctionType, NoneType, UnionType
from typing import Any, ClassVar, Self, Union, get_args, get_origin, get_type_hints
from weakref import WeakSet

import casadi as ca
import numpy as np
from pydantic import BaseModel, ValidationError

from hgorun.config.types import Block
from hgorun.errors import PluginError, called

_Method = Callable[..., object]

_GUARDED: WeakSet[_Method] = WeakSet()
_PYDANTIC = frozenset(dir(BaseModel))
# what may stand for a type besides its own instances: it is understood where the value is used
_ALSO: dict[type, tuple[type, ...]] = {
    float: (Real, np.number),
    bool: (np.bool_,),
    np.ndarray: (Sequence, Real),
    ca.SX: (ca.DM, Real, np.ndarray),
    Sequence: (ca.SX, ca.DM, np.ndarray),
}


class Plugin(Block):
    """Base of observers, plants and noise, whoever writes them.

    A method is wrapped where a class overrides an inherited one, since then hgorun calls it: an exception in it, or
    a value that is not of the type that the inherited method declares, becomes a :class:`PluginError`.
    """

    kind: ClassVar[str] = "class"

    type: str

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        if cls.__module__.startswith("hgorun."):  # what is wrong there is ours, and tests find it
            return
        own_type = str(vars(cls).get("__annotations__", {}).get("type", "str"))
        if not re.match(r"str\b|typing\.Literal|Literal|<class 'str'>", own_type):
            raise PluginError(
                f"{cls.kind} {cls.__name__!r}: `type` is the name of the {cls.kind} in every block; its own key needs "
                "another name"
            )
        for name, own, inherited in _overriding(cls):
            wrapped = _wrapped(cls.kind, name, own, inherited)
            if wrapped is not None:
                setattr(cls, name, wrapped)

    @classmethod
    def model_validate(cls, obj: Any, **keywords: Any) -> Self:
        """The block, checked. Validators refuse it with a ValueError; anything else is a mistake in one of them."""
        try:
            return super().model_validate(obj, **keywords)
        except ValidationError:
            raise
        except Exception as error:
            name = obj.get("type", cls.__name__) if isinstance(obj, dict) else cls.__name__
            with called(cls.kind, str(name), "a validator"):
                raise error


def _overriding(cls: type) -> Iterator[tuple[str, object, object]]:
    """The public names that a class redefines: what is defined last, and what was at first."""
    owners = [c for c in cls.__mro__ if not issubclass(BaseModel, c)]
    for name in dict.fromkeys(name for c in owners for name in vars(c) if not name.startswith("_")):
        definitions = [vars(c)[name] for c in owners if name in vars(c)]
        if len(definitions) > 1 and name not in _PYDANTIC:
            yield name, getattr_static(cls, name), definitions[-1]


def _wrapped(kind: str, name: str, own: object, inherited: object) -> object | None:
    """The attribute with its function guarded; None where there is nothing to do."""
    function = _function(own)
    if function is None or function in _GUARDED or getattr(function, "__isabstractmethod__", False):
        return None
    guarded = _guarded(kind, name, function, _function(inherited))
    if isinstance(own, property):
        return property(guarded)
    if isinstance(own, cached_property):
        made = cached_property(guarded)
        made.__set_name__(object, name)
        return made
    return type(own)(guarded) if isinstance(own, (classmethod, staticmethod)) else guarded


def _function(attribute: object) -> _Method | None:
    """What an attribute of a class calls."""
    for kind, inner in ((property, "fget"), (cached_property, "func"), (classmethod, "__func__")):
        if isinstance(attribute, kind):
            attribute = getattr(attribute, inner)
    return attribute if isinstance(attribute, FunctionType) else None


def _guarded(kind: str, name: str, function: _Method, declared: _Method | None) -> _Method:
    @wraps(function)
    def guarded(owner: Any, *arguments: object, **keywords: object) -> object:
        try:
            value = function(owner, *arguments, **keywords)
        except Exception as error:
            with called(kind, _name(owner), name):
                raise error
        expected = _declared(declared)
        if not _fits(value, expected):
            code = function.__code__
            place = f"{Path(code.co_filename).name}:{code.co_firstlineno}"
            message = f"{kind} {_name(owner)!r}: {name} returned {_said(value)}, expected {_words(expected)} ({place})"
            raise PluginError(message, (kind, _name(owner)))
        return value

    _GUARDED.add(guarded)
    return guarded


def _name(owner: Any) -> str:
    """What a configuration calls an instance; of a class its own name."""
    return owner.__name__ if isinstance(owner, type) else str(owner.type)


@cache
def _declared(function: _Method | None) -> object:
    """The type of what a function declares to return; Any where there is none, or it cannot be found."""
    try:
        found = get_type_hints(function).get("return", Any) if function is not None else Any
    except (NameError, TypeError):
        return Any
    return Any if found is NoneType else found


def _fits(value: object, declared: object) -> bool:
    """Whether a value is of a declared type; what cannot be decided is taken to be so."""
    origin, inner = get_origin(declared), get_args(declared)
    if origin in (Union, UnionType):
        return any(_fits(value, one) for one in inner)
    kind = origin or declared
    if kind is Any or not isinstance(kind, type):
        return True
    if isinstance(value, str):
        return issubclass(str, kind) and kind is not Sequence
    if not isinstance(value, (kind, *_ALSO.get(kind, ()))):
        return False
    if isinstance(value, Mapping) and len(inner) == 2:
        return all(_fits(k, inner[0]) and _fits(v, inner[1]) for k, v in value.items())
    if isinstance(value, tuple) and len(inner) == 2 and inner[1] is Ellipsis:
        return all(_fits(part, inner[0]) for part in value)
    if isinstance(value, tuple) and kind is tuple and inner:
        return len(value) == len(inner) and all(map(_fits, value, inner))
    if isinstance(value, (list, tuple)) and len(inner) == 1:
        return all(_fits(part, inner[0]) for part in value)
    return True


def _said(value: object) -> str:
    text = f"{type(value).__name__} {value!r}"
    return text if len(text) < 80 else type(value).__name__


def _words(declared: object) -> str:
    """A type as its declaration reads, without modules."""
    if declared is float:
        return "a number"
    text = declared.__name__ if isinstance(declared, type) and not get_args(declared) else str(declared)
    return re.sub(r"\w+\.", "", text)
