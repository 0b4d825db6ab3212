from ._html import report_html as report_html
from ._html import write_report as write_report
from ._provenance import provenance as provenance
from ._report import Report as Report
from ._report import Table as Table
