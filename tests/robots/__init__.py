"""The robots' side of the console without a bridge: registry, places, records, stops, supervisor."""
