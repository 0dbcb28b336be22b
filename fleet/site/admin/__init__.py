"""The admin of robots, profiles and people. It lies here because it joins registry, access, supervisor and reports."""

from fleet.site.admin import bridge_hosts as bridge_hosts
from fleet.site.admin import people as people
from fleet.site.admin import robots as robots
