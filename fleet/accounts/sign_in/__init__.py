"""Sign-in: password, second factor, single sign-on, first account, limits on guessing.

Built on django-allauth.
"""
