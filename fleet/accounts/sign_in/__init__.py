"""Sign-in: password, second factor, single sign-on, first account, limits for guesses. Built on django-allauth."""
