"""Named places of maps. Robots share a map, and its places, while their newest maps have the same content."""
