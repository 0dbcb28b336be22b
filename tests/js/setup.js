/** Django's catalog of texts, as its script puts it on a page: here every text is its own translation. */

globalThis.gettext = (text) => text;
globalThis.ngettext = (one, many, count) => (count === 1 ? one : many);
globalThis.interpolate = (text, values, named) =>
  named
    ? text.replace(/%\((\w+)\)s/g, (_, name) => String(values[name]))
    : values.reduce((said, value) => said.replace("%s", value), text);
