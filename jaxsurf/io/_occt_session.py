"""One quiet visit to OCCT: its messages held back, its process-wide settings changed and put back."""

import contextlib
import functools
import threading
from collections.abc import Iterator, Mapping

from .._errors import import_optional

# OCCT keeps the settings of its translators in one table per process.
_table_in_use = threading.RLock()


def occt(module: str):
    """A module of OCCT, such as `occt("Geom")`; imported on first use because that takes a second."""
    return import_optional(f"OCP.{module}", extra="cad", purpose="CAD files")


@functools.cache
def occt_errors() -> tuple[type[Exception], ...]:
    """The exceptions of OCCT; they share no base but Exception."""
    rooms = (occt("Standard"), occt("StdFail"), occt("Geom"))
    found = (thing for room in rooms for thing in vars(room).values())
    return tuple(thing for thing in found if isinstance(thing, type) and issubclass(thing, Exception))


@contextlib.contextmanager
def quiet_session(settings: Mapping[str, str | int | float]) -> Iterator[None]:
    """Run the block with these translator settings and without OCCT's reports on standard output."""
    # Settings made before a translator starts for the first time are lost without a word.
    occt("STEPControl").STEPControl_Controller.Init_s()
    occt("IGESControl").IGESControl_Controller.Init_s()
    table = occt("Interface").Interface_Static
    messenger = occt("Message").Message.DefaultMessenger_s()
    with _table_in_use:
        before = {key: table.CVal_s(key) for key in settings}
        printers = list(messenger.Printers())
        for printer in printers:
            messenger.RemovePrinter(printer)
        try:
            for key, value in settings.items():
                if not table.SetCVal_s(key, str(value)):
                    raise RuntimeError(f"OCCT does not accept {key} = {value}.")
            yield
        finally:
            for key, value in before.items():
                table.SetCVal_s(key, value)
            for printer in printers:
                messenger.AddPrinter(printer)
