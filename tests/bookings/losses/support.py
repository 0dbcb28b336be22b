"""Steps that tests of losses share."""

import re


def fields_of(asked):
    """Return the fields of the page that asks."""
    fields = {}
    for name, value in re.findall(r'<input type="hidden" name="([^"]+)" value="([^"]*)">', asked.text):
        fields.setdefault(name, []).append(value)
    fields.pop("csrfmiddlewaretoken", None)
    return fields


def confirm(door, asked, **more):
    """Press the button of the page that asks."""
    return door.post(asked.request["PATH_INFO"], fields_of(asked) | more)
