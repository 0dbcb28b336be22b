/** Replaces Django's catalog of translations: every text translates to itself. */

globalThis.gettext = (text) => text;
globalThis.gettext_noop = globalThis.gettext;
globalThis.ngettext = (one, many, count) => (count === 1 ? one : many);
globalThis.interpolate = (text, values, named) =>
  named
    ? text.replace(/%\((\w+)\)s/g, (_, name) => String(values[name]))
    : values.reduce((said, value) => said.replace("%s", value), text);
