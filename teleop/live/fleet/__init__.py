"""The fleet page: each robot's card is made once, and rights are read once, for all pages of this web process."""
