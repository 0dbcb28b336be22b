"""The demo's door: its sign-in page has a button for each role.

It exists only in web processes with `script.stack.door.settings`, which `script/demo` starts, for this computer alone.
`script/serve` always starts `fleet.settings`, which know neither the address nor the buttons.
"""
