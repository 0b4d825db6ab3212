from ._html import report_html as report_html, write_report as write_report
from ._provenance import provenance as provenance
from ._report import Report as Report, Table as Table
