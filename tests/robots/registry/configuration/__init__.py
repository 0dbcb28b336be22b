"""The configuration of profiles and robots: validation, safer values, stick, limbs, navigation."""
