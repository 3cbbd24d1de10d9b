"""A check that packages' tests share: dataclasses are values, and those of arrays are compared by identity."""

from __future__ import annotations

import abc
import dataclasses
import importlib
import pkgutil
import re

# A field of such a type makes a generated __eq__ raise: an array has no truth value.
ARRAYS = re.compile(r"\b(NDArray|FloatArray|BoolArray|IntArray|Array|Tensor|Ring|Heights)\b")


def complaints(package: str, mutable: set[str]) -> list[str]:
    """Return a line for each dataclass of a package that is not frozen, or compares arrays, and each that is none.

    mutable: names of the classes that are meant to change.
    """
    found = []
    seen: set[type] = set()
    names = [package, *(module.name for module in pkgutil.walk_packages([*_folders(package)], f"{package}."))]
    for name in names:
        if name.endswith("__main__"):
            continue
        for value in vars(importlib.import_module(name)).values():
            if not isinstance(value, type) or value.__module__ != name:
                continue
            if dataclasses.is_dataclass(value):
                seen.add(value)
            elif _has_fields_only(value):
                found.append(f"{name}.{value.__name__}: has fields that nothing sets; it lacks @dataclass")
    for kind in sorted(seen, key=lambda kind: (kind.__module__, kind.__qualname__)):
        parameters = kind.__dataclass_params__  # type: ignore[attr-defined]
        if parameters.frozen == (kind.__name__ in mutable):
            found.append(f"{kind.__module__}.{kind.__name__}: frozen is {parameters.frozen}")
        arrays = [field.name for field in dataclasses.fields(kind) if ARRAYS.search(str(field.type))]
        if arrays and parameters.eq:
            found.append(f"{kind.__module__}.{kind.__name__}: compares arrays ({', '.join(arrays)}); use eq=False")
    return found


def _has_fields_only(kind: type) -> bool:
    """Return True if a class declares fields and no way to set them, as one whose @dataclass was lost."""
    declares = bool(vars(kind).get("__annotations__")) and not getattr(kind, "_is_protocol", False)
    is_base = isinstance(kind, abc.ABCMeta)  # which declares what its subclasses set
    return declares and not is_base and kind.__init__ is object.__init__ and not hasattr(kind, "_fields")


def _folders(package: str) -> list[str]:
    return list(importlib.import_module(package).__path__)
