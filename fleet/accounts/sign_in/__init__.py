"""Sign-in: password, second factor, single sign-on, and the limits for those who guess. Built on django-allauth."""
