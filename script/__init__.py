"""Commands of development, such as `script/demo` and `script/test`, and `stack/`: the console's processes together."""
