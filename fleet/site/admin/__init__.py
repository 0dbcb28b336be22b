"""The admin of robots and profiles. It lies here because it joins registry, access and supervisor."""

from fleet.site.admin import robots as robots
