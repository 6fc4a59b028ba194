"""The report stage: one post-mortem as json, html, junit and files for other tools."""

from slamreplay.stage import callable_stage

callable_stage(__name__)
