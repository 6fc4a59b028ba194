"""Which maps are still in use: those of the last days of a site."""

from __future__ import annotations

from datetime import date, timedelta

from slamreplay.fleet.counted import Counted

#: A map that no log of so many days was judged against was replaced; a floor may rest a weekend.
DAYS = 7


class InUse:
    """The last day of each map, and of each site."""

    def __init__(self, logs: Counted) -> None:
        self._site: dict[str | None, date] = {}
        self._map: dict[tuple[str | None, str | None], date] = {}
        sites, versions = (logs.texts[name].tolist() for name in ("site", "map_version"))
        for site, version, day in zip(sites, versions, logs.day.tolist(), strict=True):
            if day is not None:
                self._site[site] = max(day, self._site.get(site, day))
                self._map[site, version] = max(day, self._map.get((site, version), day))

    def of(self, site: str | None, version: str) -> bool:
        """Whether a map was in use in the site's last days; also where no clock tells."""
        last, end = self._map.get((site, version)), self._site.get(site)
        return last is None or end is None or end - last <= timedelta(days=DAYS)
