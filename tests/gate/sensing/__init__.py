"""From messages to points: depth pictures and laser scans."""
