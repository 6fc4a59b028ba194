"""The report stage: one post-mortem as json, html, junit and files for other tools."""
