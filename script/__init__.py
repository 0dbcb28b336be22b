"""Commands of development, such as `script/demo` and `script/test`; `stack/` runs the whole console."""
