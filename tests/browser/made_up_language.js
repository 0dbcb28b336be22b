/**
 * Shows a page in a made-up language, from now on: "longer" has words that are 40 % longer, "mirrored" is written from
 * right to left. Figures, code, and what the server says in messages stay.
 */
(language) => {
  const HEBREW = "אבגדהוזחטיכלמנסעפצקרשתםןךף";
  const SPELLINGS = {
    longer: (word) => word + word.slice(-Math.ceil(0.4 * word.length)).toLowerCase(),
    mirrored: (word) => word.toLowerCase().replace(/[a-z]/g, (letter) => HEBREW[letter.charCodeAt(0) - 97]),
  };
  // Figures in a text (%(count)s, {count}) are no words; words of one or two letters may be units.
  const WORD = /%(?:\(\w+\))?s|\{[^}]*\}|\p{L}{3,}/gu;
  const spelt = (text) =>
    text.replace(WORD, (word) => (/[%{]/.test(word) ? word : SPELLINGS[language](word)));

  function respell(root) {
    const walk = document.createTreeWalker(root, NodeFilter.SHOW_TEXT, ({ parentElement }) =>
      parentElement?.closest("script, style, code, kbd, samp, pre, textarea, svg")
        ? NodeFilter.FILTER_REJECT
        : NodeFilter.FILTER_ACCEPT,
    );
    while (walk.nextNode()) walk.currentNode.data = spelt(walk.currentNode.data);
    for (const { content } of root.querySelectorAll("template")) respell(content);
    for (const field of root.querySelectorAll("[placeholder]")) field.placeholder = spelt(field.placeholder);
    for (const button of root.querySelectorAll("[type=submit][value]")) button.value = spelt(button.value);
  }

  respell(document);
  if (language === "mirrored") document.dir = "rtl";
  for (const name of ["gettext", "ngettext", "pgettext", "npgettext"]) {
    const inEnglish = globalThis[name];
    if (inEnglish) globalThis[name] = (...texts) => spelt(inEnglish(...texts));
  }
};
