"""Static files as production serves them."""

from whitenoise.storage import CompressedManifestStaticFilesStorage


class HashedStaticFiles(CompressedManifestStaticFilesStorage):  # type: ignore[misc]  # WhiteNoise is untyped
    """Hashed names, compressed, and the imports between ES modules rewritten to the hashed names."""

    support_js_module_import_aggregation = True

    # One for each module on the longest way of imports: Django's five are just enough today. In a circle no number is.
    max_post_process_passes = 20
