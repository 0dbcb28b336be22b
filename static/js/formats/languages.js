/** Languages by name. Codes are BCP 47. */

/** `Intl.DisplayNames` objects, by the language in which they name languages. */
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

/** Every two-letter language that has a name, with its most likely region: robots need the region. */
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
 * Return every language that can be chosen: the robot's own first, the others sorted by name.
 * @param {string[]} own codes of the robot's own languages
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

const OPPOSITE = { ArrowLeft: "ArrowRight", ArrowRight: "ArrowLeft" };

/** Return a key as on a page from left to right: there, the right arrow goes on in the reading direction. */
export function readingKey(key) {
  return document.dir === "rtl" ? (OPPOSITE[key] ?? key) : key;
}

/** Isolate a text in a sentence of another language: its writing direction does not change the sentence. */
export function isolated(text) {
  return `\u2068${text}\u2069`;
}

/** Sets the language of an element's text; the browser finds the writing direction. */
export function inLanguage(element, code) {
  element.lang = code;
  element.dir = "auto";
  return element;
}
