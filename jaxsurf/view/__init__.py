from ._cloud import cloud as cloud
from ._deviation import deviation as deviation
from ._plot import plot as plot
from ._shade import shade as shade
from ._sheet import png_bytes as png_bytes
