from ._deviation import Deviation as Deviation
from ._parametrise import Parametrisation as Parametrisation, parametrise as parametrise
from ._coverage import Coverage as Coverage, coverage as coverage
from ._fit import Fit as Fit, fit as fit
from ._cloud import CloudFit as CloudFit, Stage as Stage, fit_cloud as fit_cloud
