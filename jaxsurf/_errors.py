"""Errors that a user can mend, and packages that a user can install."""

import importlib
from types import ModuleType


class InputError(ValueError):
    """Bad input: one sentence that names the argument, what was expected, what came and what to do.

    The command line prints the sentence and exits with status 2; everything else is a bug and shows its traceback.
    """


class MissingPackageError(InputError, ImportError):
    """An optional package is needed; the sentence ends with the `pip install` line."""


def import_optional(module: str, *, extra: str, purpose: str) -> ModuleType:
    """Import an optional package inside the function that needs it.

    `extra` is the extra of this project that brings the package, `purpose` completes "... is needed for {purpose}".
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingPackageError(
            f"The package `{module.split('.')[0]}` is needed for {purpose} and cannot be imported ({error}): "
            f"install it with `pip install 'jaxsurf[{extra}]'`."
        ) from error


class GeometryWarning(UserWarning):
    """What was asked for is defined, and probably not what is wanted; the message says where and what to take instead."""
