"""Rules of single sign-on: groups and other claims of the organisation become courses and roles."""
