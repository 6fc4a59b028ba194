"""The report stage: one post-mortem as json, html, junit and files for other tools."""

from slamreplay.stage import callable_stage

#: The file by which the folder of a report is known.
REPORT_FILE = "report.json"

callable_stage(__name__)
