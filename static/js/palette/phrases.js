/** Ready-made phrases in the palette. */

import { readJson } from "../connection/read.js";
import { whyNotNow } from "../control/lease.js";
import { languageName } from "../formats/languages.js";
import { leftOf } from "../tasks/lesson_tasks.js";
import { muteText } from "../tasks/say.js";

/** @param {import("./control_palette.js").Driving} driving @returns {Promise<import("./palette.js").Entry[]>} */
export async function phrases({ data, offers, tasks, mayAct, request }) {
  const failed = gettext("The phrases could not be read. Load the page again.");
  const read = await readJson(data.phrases, failed);
  const left = leftOf(tasks(), "phrases", read.phrases, ({ text }) => text);
  return left.map(({ text, language, tags = [] }) => ({
    name: text,
    does: interpolate(gettext("Phrase: the robot says it, in %s"), [languageName(language)]),
    more: tags.join(" "),
    language,
    why: () => muteText(offers()) || (mayAct() ? "" : whyNotNow()),
    act: () => request({ t: "say", text, language }),
  }));
}
