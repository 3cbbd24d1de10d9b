"""A check that packages' tests share: dataclasses are values, and those of arrays are compared by identity."""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil
import re

# A field of such a type makes a generated __eq__ raise: an array has no truth value.
ARRAYS = re.compile(r"\b(NDArray|FloatArray|BoolArray|IntArray|Array|Tensor|Ring|Heights)\b")


def complaints(package: str, mutable: set[str]) -> list[str]:
    """Return a line for each dataclass of a package that is not frozen, or compares arrays.

    mutable: names of the classes that are meant to change.
    """
    found = []
    seen: set[type] = set()
    names = [package, *(module.name for module in pkgutil.walk_packages([*_folders(package)], f"{package}."))]
    for name in names:
        if name.endswith("__main__"):
            continue
        for value in vars(importlib.import_module(name)).values():
            if isinstance(value, type) and dataclasses.is_dataclass(value) and value.__module__ == name:
                seen.add(value)
    for kind in sorted(seen, key=lambda kind: (kind.__module__, kind.__qualname__)):
        parameters = kind.__dataclass_params__  # type: ignore[attr-defined]
        if parameters.frozen == (kind.__name__ in mutable):
            found.append(f"{kind.__module__}.{kind.__name__}: frozen is {parameters.frozen}")
        arrays = [field.name for field in dataclasses.fields(kind) if ARRAYS.search(str(field.type))]
        if arrays and parameters.eq:
            found.append(f"{kind.__module__}.{kind.__name__}: compares arrays ({', '.join(arrays)}); use eq=False")
    return found


def _folders(package: str) -> list[str]:
    return list(importlib.import_module(package).__path__)
