"""The replay inside report.html: what there was to see, small enough to travel in the page."""
