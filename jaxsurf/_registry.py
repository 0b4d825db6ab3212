"""Names under which `save` and `load` know the classes."""

from typing import TypeVar

_CLASSES: dict[str, type] = {}
_C = TypeVar("_C", bound=type)


def register(cls: _C) -> _C:
    """Class decorator: make a module known to `js.save` and `js.load` under its own name."""
    if _CLASSES.setdefault(cls.__name__, cls) is not cls:
        raise TypeError(f"The name {cls.__name__!r} is registered twice.")
    return cls


def registered_class(name: str) -> type | None:
    """The class registered under `name`, or `None`."""
    return _CLASSES.get(name)


def registered_names() -> tuple[str, ...]:
    """All registered names, in alphabetical order."""
    return tuple(sorted(_CLASSES))
