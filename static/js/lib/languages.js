/** Languages by name. Codes are BCP 47. */

/** Objects that name languages, by the language of the names. */
const known = new Map();

export function pageLanguage() {
  return document.documentElement.lang || "en";
}

/** A language's name; its code if the name is not known. */
export function languageName(code, locale = pageLanguage()) {
  try {
    if (!known.has(locale))
      known.set(
        locale,
        new Intl.DisplayNames([locale], { type: "language", languageDisplay: "standard" }),
      );
    return known.get(locale).of(code);
  } catch {
    return code;
  }
}

/** Every language of two letters that has a name, with the region where most speak it: robots want to know. */
function everyCode(locale) {
  const names = new Intl.DisplayNames([locale], { type: "language", fallback: "none" });
  const letters = [..."abcdefghijklmnopqrstuvwxyz"];
  const codes = letters
    .flatMap((a) => letters.map((b) => a + b))
    .filter((code) => names.of(code))
    .map((code) => new Intl.Locale(code).maximize())
    .filter(({ region }) => region)
    .map(({ language, region }) => `${language}-${region}`);
  return [...new Set(codes)];
}

function languageOf(code) {
  return code.split("-")[0];
}

/**
 * Every language that could be chosen: the robot's own first, the others by name.
 * @param {string[]} own of the robot
 * @returns {{code: string, name: string, own: boolean}[]}
 */
export function languageChoices(own, locale = pageLanguage()) {
  const first = own.map((code) => ({ code, name: languageName(code, locale), own: true }));
  const spoken = new Set(own.map(languageOf));
  const others = everyCode(locale)
    .filter((code) => !spoken.has(languageOf(code)))
    .map((code) => ({ code, name: languageName(code, locale), own: false }))
    .sort((a, b) => a.name.localeCompare(b.name, locale));
  return [...first, ...others];
}

/** A text within a sentence of another language: it runs its own way, and nothing around it does. */
export function isolated(text) {
  return `\u2068${text}\u2069`;
}

/** Marks an element's text as being in a language, whichever way that is written. */
export function inLanguage(element, code) {
  element.lang = code;
  element.dir = "auto";
  return element;
}
