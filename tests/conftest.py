"""Every test runs in double precision, with strict promotion, and with the package's type annotations checked."""

import jax
from jaxtyping import install_import_hook

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")

# For good, since some rooms are imported at their first use; an int will do where a float is expected.
install_import_hook("jaxsurf", "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))")
