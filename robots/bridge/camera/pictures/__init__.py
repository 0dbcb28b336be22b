"""Pictures as bytes: what browsers show, and how each form is read and made."""
