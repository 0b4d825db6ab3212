"""One shape or a list of shapes, as a writer takes them."""

from collections.abc import Callable
from typing import Any, TypeVar

from .._errors import InputError

Written = TypeVar("Written")


def each_shape(shapes: Any, convert: Callable[[Any], Written], *, function: str) -> list[Written]:
    """Convert one shape or each shape of a list or tuple; errors in a list say which shape it was."""
    if not isinstance(shapes, list | tuple):
        return [convert(shapes)]
    if not shapes:
        raise InputError(f"`shapes` of {function} must hold at least one shape, got an empty {type(shapes).__name__}.")
    converted = []
    for i, shape in enumerate(shapes):
        try:
            converted.append(convert(shape))
        except InputError as error:
            raise InputError(f"`shapes[{i}]`: {error}") from error
    return converted
