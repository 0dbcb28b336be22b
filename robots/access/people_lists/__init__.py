"""Lists of people, as text or as files: their encoding, their columns, the people in them. Pure."""
