"""Every test runs in double precision, with strict promotion, and with the package's type annotations checked."""

import equinox as eqx
import jax
import pytest
from jaxtyping import install_import_hook

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
