"""The long list of inputs: `script/test long`."""
