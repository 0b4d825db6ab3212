"""Every test runs in double precision, with strict promotion, and with the package's type annotations checked."""

import os
import subprocess
import sys

import equinox as eqx
import jax
import pytest
from jaxtyping import install_import_hook

# Almost all of a test's time is compilation of programs that run once: they are compiled in a third of the time.
_QUICK = "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false --xla_cpu_parallel_codegen_split_count=1"


def pytest_configure(config: pytest.Config) -> None:
    """Asks for quick compilation, unless the caller has flags of their own or this jaxlib no longer knows ours."""
    if "XLA_FLAGS" in os.environ or hasattr(config, "workerinput"):
        return
    asked = {**os.environ, "XLA_FLAGS": _QUICK}
    tried = [sys.executable, "-c", "import jax; jax.devices()"]
    if subprocess.run(tried, env=asked, capture_output=True).returncode == 0:  # an unknown flag ends the process
        os.environ["XLA_FLAGS"] = _QUICK


jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")

# For good, since some rooms are imported at their first use; an int will do where a float is expected.
install_import_hook("jaxsurf", "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))")


@pytest.fixture(scope="module", autouse=True)
def _forget_compiled_programs():
    """Thousands of compiled programs in one process use up its memory maps, and the compiler then crashes."""
    yield
    jax.clear_caches()
    eqx.clear_caches()
