"""`python -m benchmarks [NAME ...]`: run, print the tables, keep the numbers, refresh the README."""

import argparse
import importlib
from pathlib import Path

from . import harness

HERE = Path(__file__).parent
NAMES = sorted(path.stem for path in HERE.glob("*.py") if path.stem[0] != "_" and path.stem != "harness")


def main(arguments: list[str] | None = None) -> None:
    """Run the named benchmarks, or all."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", choices=[*NAMES, []], metavar="NAME", help=", ".join(NAMES))
    parser.add_argument("--repeats", type=int, default=9, help="interleaved repeats, at least 7 (default 9)")
    parser.add_argument("--table-only", action="store_true", help="only rewrite the README from the results")
    options = parser.parse_args(arguments)
    for name in options.names or NAMES:
        results = HERE / "results" / f"{name}.json"
        module = importlib.import_module(f".{name}", __package__)
        own = hasattr(module, "report")  # what is no comparison makes a report and a table of its own
        if not options.table_only:
            found = module.report() if own else harness.run(module.rows(), max(7, options.repeats))
            harness.write(results, found)
        text = (module if own else harness).table(harness.read(results))
        print(text)
        harness.refresh(HERE.parent / "README.md", name, text)


if __name__ == "__main__":
    main()
