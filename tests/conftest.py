"""Every test runs in double precision, with strict promotion, and with the package's type annotations checked."""

import jax
from jaxtyping import install_import_hook

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")

with install_import_hook("jaxsurf", "beartype.beartype"):
    import jaxsurf  # noqa: F401
